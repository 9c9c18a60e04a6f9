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

from discover.forward.cheap_tangents import with_cheap_tangents
from discover.forward.fluids import dynamics_of_fluid, solved_on_grid
from discover.forward.integrators.at_given_rate import follow
from discover.forward.starts.steady_states import steady_state
from discover.laws.each_mode import over_modes
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.weights import Rebuild
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
from tensor_library.contraction import contracted


class Along(NamedTuple):
    """What a law makes of the runs, at their samples.

    `recorded`: what is recorded, in Pa, of creep the strain, shape (runs, n).
    """

    recorded: Float[Array, "runs n"]
    states: Float[Array, "runs n k 4"]  # dimensionless stress of every mode, shape (runs, n, k, 4)
    rate: Float[Array, "runs n"]  # in 1/s, shape (runs, n)


def trajectories(law: TensorBasisNetwork, problem: TrainingProblem) -> Along:
    """Return what is recorded of a law at every sample, and its states there.

    Compiling an integration costs a hundred times its run, with derivatives or without. Misfits and
    states are therefore both read off the program that also trains the constants.
    """
    everything = np.ones(N_COEFFICIENTS)
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
    modulus, fluid = problem.modulus, problem.fluid(rebuild(weights))

    def one_mode(rebuild, state, gradient):
        def change(s, w):
            return rebuild(w).stress_rate(s, gradient)

        stress, sensitivity = state[:, 0], state[:, 1:]
        # one evaluation and four pullbacks give both derivatives
        value, pull = jax.vjp(change, stress, weights)
        by_state, by_weight = jax.vmap(pull)(jnp.eye(len(stress)))
        return jnp.concatenate([value[:, None], by_state @ sensitivity + by_weight], axis=1)

    def dynamics(w, protocol, cheaply=False):
        """Return the modes of a law of these weights, as the integrators take it."""

        def stress_rate(made, w, *flow):
            return made(w).stress_rate(*flow)

        def of_mode(made, *flow):
            rate = with_cheap_tangents if cheaply else partial
            return rate(stress_rate, made)(w, *flow)

        return dynamics_of_fluid(fluid, protocol)._replace(slope=over_modes(of_mode, rebuild, -1))

    def followed_run(protocol, grid):
        alone = dynamics(weights, protocol)
        # traced once for all stages of a step
        of_modes = jax.jit(over_modes(one_mode, rebuild, -1))
        beside = alone._replace(slope=of_modes, columns=weights.shape[0])

        def observe(state, _):
            stress = state[:4]  # without structure variables, which no record holds
            recorded = protocol.recorded_stress(contracted(stress[:, 1:], modulus))
            return stress[:, 0].T, recorded

        return follow(beside, alone, protocol, grid, observe)

    def steady_run(protocol, grid):
        alone = dynamics(weights, protocol)

        def at(number):
            def recorded(w):
                made = dynamics(w, protocol)
                state = steady_state(made, alone, protocol.rate(number), protocol.kinematics)[:4]
                return protocol.recorded_stress(contracted(state, modulus)), state.T

            # one number recorded: a pullback costs what one weight's tangent would
            by_weight, state = jax.jacrev(recorded, has_aux=True)(weights)
            return state, by_weight

        return grid.of_states(at)

    def solved_run(protocol, grid):
        make = partial(dynamics, protocol=protocol, cheaply=True)

        def recorded(w):
            found = solved_on_grid(make, w, protocol, grid)
            return found.observed[:, 0], found

        by_weight, found = jax.jacfwd(recorded, has_aux=True)(weights)
        return Along(found.observed[:, 0], found.states, found.rate), by_weight

    def one_run(protocol, grid):
        if protocol.control not in FOLLOWED:
            return solved_run(protocol, grid)
        run = steady_run if protocol.control == "steady" else followed_run
        states, by_weight = run(protocol, grid)
        gradient = jax.vmap(protocol.velocity_gradient)(grid.sample_times)
        recorded = protocol.recorded_stress(jax.vmap(fluid.stress)(states, gradient).T)
        return Along(recorded, states, jax.vmap(protocol.rate)(grid.sample_times)), by_weight

    return flows.over(one_run)
