"""Trajectories together with their derivatives by every weight.

The variational equation dS/dt = J S + ∂f/∂θ, with S = ∂σ/∂θ and J = ∂f/∂σ, is integrated beside the
state as one ordinary differential equation. J is 4 × 4, or little more, and as many reverse passes
through a tiny network give it together with ∂f/∂θ, where one forward pass per weight would cost
hundreds.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from discover.forward.fluids import (
    dynamics_of_modes,
    solved_on_grid,
    with_cheap_tangents,
)
from discover.laws.each_mode import over_modes
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.weights import Rebuild
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
from discover.simulate.following import Following, follow
from discover.simulate.solve import exponential_steps
from discover.simulate.steady_states import steady_modes


class Along(NamedTuple):
    """What a law makes of the runs, at their samples.

    Attributes
    ----------
    recorded
        What is recorded, in Pa, of creep the strain, shape (runs, n).
    states
        Dimensionless stress of every mode, shape (runs, n, k, 4).
    rate
        In 1/s, shape (runs, n).
    """

    recorded: Float[Array, "runs n"]
    states: Float[Array, "runs n k 4"]
    rate: Float[Array, "runs n"]


def trajectories(law: TensorBasisNetwork, problem: TrainingProblem) -> Along:
    """Return what is recorded of a law at every sample, and its states there.

    Compiling an integration costs a hundred times its run, with derivatives or without. Misfits and
    states are therefore both read off the program that also trains the constants.
    """
    everything = jnp.ones(N_COEFFICIENTS)
    rebuild = Rebuild.of_constants(law, everything.astype(bool), everything)
    return side_by_side(rebuild.start, rebuild, problem)[0]


def side_by_side(
    weights: Float[Array, " p"], rebuild: Rebuild, problem: TrainingProblem
) -> tuple[Along, Float[Array, "runs n p"]]:
    """Return what `states_and_jacobian` does, computed for two halves of the runs in threads.

    Left to itself the compiled program uses two cores for longer than it takes on one: what it
    shares out is too small. To be called from outside of any transformation.
    """
    n = len(problem.flows)
    # halves of one size share a program; of an odd number of runs the middle one is in both
    half = -(-n // 2)
    if n < 2 or not problem.flows.is_uniform:
        return states_and_jacobian(weights, rebuild, problem)
    with ThreadPoolExecutor(1) as pool:
        last = pool.submit(states_and_jacobian, weights, rebuild, problem, half, np.int32(n - half))
        first = states_and_jacobian(weights, rebuild, problem, half, np.int32(0))
        jax.block_until_ready(first)
        return _joined(first, last.result(), 2 * half - n)


@partial(jax.jit, static_argnums=2)
def _joined(first, last, common: int):
    return jax.tree.map(lambda a, b: jnp.concatenate([a, b[common:]]), first, last)


@partial(compiled, runs_long=True)
def states_and_jacobian(
    weights: Float[Array, " p"],
    rebuild: Rebuild,
    problem: TrainingProblem,
    count: int | None = None,
    first: Int[Array, ""] | np.int32 | int = 0,
) -> tuple[Along, Float[Array, "runs n p"]]:
    """Return what is recorded and the states at the samples, and what each weight changes of it."""
    flows = problem.flows if count is None else problem.flows.some(first, count)
    modulus, relaxation_time = problem.modulus, problem.relaxation_time
    fluid = problem.fluid(rebuild(weights))
    n_weights = weights.shape[0]

    def one_mode(rebuild, state, sensitivity, time_scale, gradient):
        def change(s, w):
            return rebuild(w).stress_rate(s, time_scale * gradient) / time_scale

        # one evaluation and four pullbacks give both derivatives
        value, pull = jax.vjp(change, state, weights)
        by_state, by_weight = jax.vmap(pull)(jnp.eye(len(state)))
        return jnp.concatenate([value[:, None], by_state @ sensitivity + by_weight], axis=1)

    @jax.jit  # traced once for all stages of a step
    def field(t, y, protocol):
        gradient = protocol.velocity_gradient(t)
        gradients = jnp.broadcast_to(gradient, (*relaxation_time.shape, *gradient.shape))
        of_modes = over_modes(one_mode, rebuild)
        return of_modes(y[..., 0], y[..., 1:], relaxation_time, gradients)

    def observe(t, y, protocol):
        stress = y[:, :4]  # without structure variables, which no record holds
        return stress[..., 0], protocol.recorded_stress(
            jnp.tensordot(modulus, stress[..., 1:], axes=1)
        )

    def steady_run(protocol, grid):
        def at(time):
            gradient = jnp.multiply.outer(relaxation_time, protocol.velocity_gradient(time))

            def recorded(w):
                of_modes = over_modes(lambda made, *flow: made(w).stress_rate(*flow), rebuild)
                state = steady_modes(of_modes, gradient, fluid.rest())[:, :4]
                return protocol.recorded_stress(jnp.tensordot(modulus, state, axes=1)), state

            # one number recorded: a pullback costs what one weight's tangent would
            by_weight, state = jax.jacrev(recorded, has_aux=True)(weights)
            return state, by_weight

        return grid.of_states(at)

    def solved_run(protocol, grid):
        modes = modulus, relaxation_time, problem.solvent_viscosity

        def make(w):
            def of_mode(rebuild, stress, rate):
                law = with_cheap_tangents(
                    lambda made, w, *flow: made(w).stress_rate(*flow), rebuild
                )
                return law(w, stress, rate)

            return dynamics_of_modes(over_modes(of_mode, rebuild, -1), *modes, protocol)

        def recorded(w):
            found = solved_on_grid(make, w, protocol, grid)
            return found.observed[:, 0], found

        by_weight, found = jax.jacfwd(recorded, has_aux=True)(weights)
        return Along(found.observed[:, 0], found.states, found.rate), by_weight

    def one_run(protocol, grid):
        if protocol.control not in FOLLOWED:
            return solved_run(protocol, grid)
        states, by_weight = followed_run(protocol, grid)
        gradient = jax.vmap(protocol.velocity_gradient)(grid.sample_times)
        recorded = protocol.recorded_stress(jax.vmap(fluid.stress)(states, gradient).T)
        return Along(recorded, states, jax.vmap(protocol.rate)(grid.sample_times)), by_weight

    def followed_run(protocol, grid):
        if protocol.control == "steady":
            return steady_run(protocol, grid)
        start = jnp.pad(fluid.rest()[..., None], ((0, 0), (0, 0), (0, n_weights)))
        solver = exponential_steps(fluid, columns=True)

        def states_alone(t, states, protocol):
            return fluid.state_rate(states, protocol.velocity_gradient(t))

        alone = Following(states_alone, exponential_steps(fluid), fluid.rest(), protocol)
        return follow(Following(field, solver, start, protocol), grid, observe, alone)

    return flows.over(one_run)
