"""Levenberg–Marquardt for residuals whose derivatives are computed beside them."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix
from jaxtyping import Array, Bool, Float
from scipy.linalg import cho_factor, cho_solve

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

# Of what a step promised, the shares from which on it is taken, and from which on the damping falls
_LEAST_KEPT, _MOST_KEPT = 0.01, 0.99
_MORE_DAMPING, _LESS_DAMPING = 4.0, 1.0 / 3.5

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


class Linearised(NamedTuple):
    """An objective around some parameters: residuals (rows,), and derivatives (rows, p)."""

    rows: Float[Array, " rows"]
    matrix: Float[Array, "rows p"]


class Steps:
    """A descent step by step, each from a linearisation that is computed elsewhere.

    Levenberg–Marquardt with the damping of a trust region   [Moré 1978, The Levenberg-Marquardt
    algorithm; constants: Gould et al. 2005, 4OR 3, 227, as optimistix has them], in NumPy: for
    every number of rows and parameters a program would take longer to compile than its steps take.

    Attributes
    ----------
    best, norm
        The best parameters so far, shape (p,), and the norm of the residuals there.
    trial
        The parameters where the objective is to be linearised next.
    """

    def __init__(self, start: Float[Array | np.ndarray, " p"]):
        self.best = self.trial = np.asarray(start)
        self.norm = np.nan
        self._damping = 1.0
        self._known: tuple[np.ndarray, ...] | None = None

    def take(self, linearised: Linearised) -> None:
        """Take the step to the trial if it is one down, and find the next trial.

        A trial whose residuals are not finite is none down.
        """
        rows, matrix = (_OF_WEIGHTS * np.asarray(part) for part in linearised)
        with np.errstate(over="ignore", invalid="ignore"):  # of a trial that diverges
            if self._known is None or self._is_down(rows):
                self.best, self.norm = self.trial, float(np.linalg.norm(rows)) / _OF_WEIGHTS
                self._known = rows, matrix, matrix.T @ matrix, matrix.T @ rows
        _, _, curvature, slope = self._known
        damped = curvature + self._damping * np.eye(len(slope))
        self.trial = np.full_like(self.best, np.nan)
        if np.all(np.isfinite(damped)) and np.all(np.isfinite(slope)):
            with suppress(np.linalg.LinAlgError):  # more damping is asked for
                self.trial = self.best - cho_solve(cho_factor(damped), slope)

    def _is_down(self, rows: np.ndarray) -> bool:
        assert self._known is not None
        before, matrix, *_ = self._known
        promised = np.sum((before + matrix @ (self.trial - self.best)) ** 2) - np.sum(before**2)
        found = np.sum(rows**2) - np.sum(before**2)
        if not found <= _LEAST_KEPT * promised:
            self._damping *= _MORE_DAMPING
            return False
        if found < _MOST_KEPT * promised:
            self._damping *= _LESS_DAMPING
        return True
