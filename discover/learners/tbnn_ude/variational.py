"""Trajectories together with their derivatives by every weight.

The variational equation dS/dt = J S + ∂f/∂θ, with S = ∂σ/∂θ and J = ∂f/∂σ, is integrated beside the
state as one ordinary differential equation. J is 4 × 4, and four reverse passes through a tiny
network give it together with ∂f/∂θ, where one forward pass per weight would cost hundreds.
"""

from collections.abc import Callable

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.simulate.exponential_runge_kutta import ExponentialRungeKutta4

Rebuild = Callable[[Float[Array, " p"]], AbstractConstitutiveLaw]


@eqx.filter_jit
def residual_and_jacobian(
    weights: Float[Array, " p"], rebuild: Rebuild, problem: TrainingProblem
) -> tuple[Float[Array, "runs n"], Float[Array, "runs n p"]]:
    """Return the residual and its derivative by every weight."""
    modulus, relaxation_time = problem.modulus, problem.relaxation_time
    fluid = problem.fluid(rebuild(weights))
    decay = jax.lax.stop_gradient(fluid.decay_rate())[:, None, None]
    n_weights = weights.shape[0]

    def one_mode(state, sensitivity, time_scale, shear_rate):
        def change(s, w):
            return rebuild(w).stress_rate(s, time_scale * shear_rate) / time_scale

        # one evaluation and four pullbacks give both derivatives
        value, pull = jax.vjp(change, state, weights)
        by_state, by_weight = jax.vmap(pull)(jnp.eye(4))
        return jnp.concatenate([value[:, None], by_state @ sensitivity + by_weight], axis=1)

    @jax.jit  # traced once for all stages of a step
    def field(t, y, protocol):
        rate = protocol.shear_rate(t)
        return jax.vmap(one_mode, (0, 0, 0, None))(y[..., 0], y[..., 1:], relaxation_time, rate)

    def observe(t, y, protocol):
        return jnp.tensordot(modulus, y[:, 3, :], axes=1)

    def one_run(protocol, grid):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(field),
            ExponentialRungeKutta4(decay),
            grid.times[0],
            grid.times[-1],
            None,
            jnp.zeros((modulus.shape[0], 4, 1 + n_weights)),
            args=protocol,
            saveat=diffrax.SaveAt(t0=True, steps=True, fn=observe),
            stepsize_controller=diffrax.StepTo(grid.times),
            adjoint=diffrax.ForwardMode(),
            max_steps=grid.times.shape[0] - 1,
            throw=False,
        )
        return jnp.asarray(solution.ys)[grid.sample_index]

    values = jax.vmap(one_run)(problem.protocols, problem.grids)
    mask = problem.grids.sample_mask
    residual = jnp.where(mask, values[..., 0] - problem.target, 0.0)
    return residual, jnp.where(mask[..., None], values[..., 1:], 0.0)
