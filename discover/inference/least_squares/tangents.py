"""Levenberg–Marquardt by optimistix, for residuals whose derivatives are computed beside them."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax
import numpy as np
import optimistix
from jaxtyping import Array, Bool, Float

Linearise = Callable[[Array, Any], tuple[Array, Array, Any]]
"""Of parameters and further arguments: residuals, their derivatives, and what is known beside."""

# By default the damping falls only after a step that keeps 99 % of its promise. Far from a minimum
# no step does: once some were rejected, the descent crawls to its last step. On a flow curve and
# an amplitude sweep of five modes it left every law of up to five terms beyond 40 % misfit, where
# one term reaches 6 % and four 3.5 %.
_BOLD = optimistix.ClassicalTrustRegion(
    high_cutoff=0.6, low_cutoff=0.1, high_constant=10.0, low_constant=0.1
)

# The solver's first damping is one, which is to be small beside the curvature: of scaled parameters
# that is of order one, of weights of a network far below.
_OF_SCALED, _OF_WEIGHTS = 10.0, 30.0

# Normal equations halve the digits, which is harmless here: the damping keeps them well
# conditioned, and they cost a sixth of an orthogonal factorisation.
_BY_STEPS = optimistix.LevenbergMarquardt(
    rtol=1e-9, atol=1e-11, linear_solver=lineax.Normal(lineax.Cholesky())
)

RUNAWAY = 1e3
"""Relative misfit of a trial that has no finite trajectory: it is always rejected."""


def descend(
    linearise: Linearise,
    start: Float[Array, " p"],
    args: Any,
    tolerance: Any,
    max_steps: int,
) -> tuple[Float[Array, " p"], Any]:
    """Return the parameters of least squares, and what is known beside the residuals there.

    The whole descent is one piece of a program.

    Parameters
    ----------
    linearise
        Returns residuals, shape (rows,), their derivatives, shape (rows, p), and anything else. Of
        parameters in scales of their own, so that the curvature is of order one.
    start
        Where to start.
    args
        Further arguments, which may be traced.
    tolerance
        Relative and absolute; may be traced, so that a coarse and a fine descent share a program.
    max_steps
        Largest number of steps, of which those rejected count too.
    """

    @eqx.filter_custom_jvp
    def residual(parameters, args):
        rows, _, beside = linearise(parameters, args)
        return _OF_SCALED * rows, beside

    @residual.def_jvp
    def _(primals, tangents):
        rows, columns, beside = linearise(*primals)
        # what is handed on beside the residuals is never differentiated
        still = jax.tree.map(jnp.zeros_like, beside)
        return (_OF_SCALED * rows, beside), (_OF_SCALED * (columns @ tangents[0]), still)

    solver = optimistix.LevenbergMarquardt(rtol=tolerance, atol=tolerance)
    solution = optimistix.least_squares(
        residual,
        eqx.tree_at(lambda one: one.search, solver, _BOLD),
        start,
        args=args,
        has_aux=True,
        max_steps=max_steps,
        throw=False,
    )
    return solution.value, solution.aux


def by_differentiation(residual: Callable[[Array, Any], Array]) -> Linearise:
    """Return what `descend` takes of a function of few parameters that returns residuals alone."""

    def linearise(parameters, args):
        rows, change = jax.linearize(lambda moved: residual(moved, args), parameters)
        columns = jax.vmap(change, out_axes=-1)(jnp.eye(parameters.size))
        return rows, columns, None

    return linearise


def bounded(
    residual: Float[Array, "*rows"], columns: Float[Array, "*rows_and_p"]
) -> tuple[Float[Array, "*rows"], Float[Array, "*rows_and_p"], Bool[Array, ""]]:
    """Return relative residuals and derivatives, and whether all are finite.

    Where they are not, a residual of the size of `RUNAWAY` is in their place, which rises no
    further: the step to it is rejected.
    """
    sane = jnp.all(jnp.isfinite(residual)) & jnp.all(jnp.isfinite(columns))
    residual = jnp.where(sane, residual, RUNAWAY / jnp.sqrt(1.0 * residual.size))
    return residual, jnp.where(sane, columns, 0.0), sane


class Linearised(eqx.Module):
    """An objective and its derivative at one set of weights, for a descent step by step.

    Attributes
    ----------
    weights
        Where it was linearised.
    rows
        The residuals, amplified.
    matrix
        Their derivatives by every weight.
    """

    weights: Float[Array, " p"]
    rows: Float[Array, " rows"]
    matrix: Float[Array, "rows p"]

    @classmethod
    def of(
        cls,
        weights: Float[Array, " p"],
        rows: Float[Array, " rows"],
        matrix: Float[Array, "rows p"],
    ) -> "Linearised":
        """Return an objective with these residuals and derivatives at some weights."""
        return cls(weights, _OF_WEIGHTS * rows, _OF_WEIGHTS * matrix)

    def __call__(
        self, weights: Float[Array, " p"], _args=None
    ) -> tuple[Float[Array, " rows"], None]:
        """Return the residuals of the linear model: all of them, as optimistix takes them."""
        return self.rows + self.matrix @ (weights - self.weights), None


@eqx.filter_jit
def first_state(linearised: Linearised):
    """Return the solver's state before the first step."""
    rows, aux = eqx.filter_eval_shape(linearised, linearised.weights)
    return _BY_STEPS.init(linearised, linearised.weights, None, {}, rows, aux, frozenset())


@eqx.filter_jit
def next_state(weights: Float[Array, " p"], linearised: Linearised, state):
    """Return the best weights and the solver's state after one more step.

    Parameters
    ----------
    weights
        The best weights so far.
    linearised
        The objective where the solver tries next, `state.y_eval`.
    state
        The solver's state.
    """
    weights, state, _ = _BY_STEPS.step(linearised, weights, None, {}, state, frozenset())
    return weights, state


def best_norm(state: Any) -> float:
    """Return the norm of the residuals at the best weights that a descent has met."""
    # in NumPy: every operation of JAX's outside a program is a program of its own to compile
    with np.errstate(over="ignore"):
        return float(np.linalg.norm(np.asarray(state.f_info.residual))) / _OF_WEIGHTS
