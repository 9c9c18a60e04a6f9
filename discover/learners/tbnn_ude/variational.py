"""Trajectories with their derivatives by every weight.

The variational equation dS/dt = J S + ∂f/∂θ, with S = ∂σ/∂θ and J = ∂f/∂σ, is integrated beside the
state. J is 4 × 4, so that four reverse passes give it and ∂f/∂θ, where forward passes would be one
per weight.
"""

from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from discover.forward.fluids import (
    at_samples,
    dynamics_of_fluid,
    solved_on_grid,
    with_cheap_tangents,
)
from discover.forward.steady_states import steady_state
from discover.forward.stepping import follow
from discover.laws.each_mode import over_modes
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.programs import compiled, on_device
from discover.protocols.kinematics import FOLLOWED
from tensor_library.algebra import contracted


def split_law(law: TensorBasisNetwork) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return the trainable part of a law (network and constants) and the rest."""
    spec = jax.tree.map(lambda _: False, law)
    spec = eqx.tree_at(
        lambda tree: (tree.network, tree.constants),
        spec,
        (jax.tree.map(eqx.is_inexact_array, law.network), True),
        is_leaf=lambda leaf: leaf is None,  # a law of constants has no network
    )
    return eqx.partition(law, spec)


def weights_of(law: TensorBasisNetwork) -> Float[Array, " p"]:
    """Return all trainable numbers of a law: those of the network, then the eight constants."""
    return ravel_pytree(split_law(law)[0])[0]


def _count_of(law: TensorBasisNetwork) -> int:
    return sum(leaf.size for leaf in jax.tree.leaves(split_law(law)[0]))


def places_of(law: TensorBasisNetwork) -> TensorBasisNetwork:
    """Return the law with every trainable number replaced by its place in `weights_of`."""
    leaves, structure = jax.tree.flatten(split_law(law)[0])
    ends = np.cumsum([leaf.size for leaf in leaves])
    # on the host, so that it is known while a program is traced
    return structure.unflatten(
        np.arange(end - leaf.size, end).reshape(leaf.shape)
        for end, leaf in zip(ends, leaves, strict=True)
    )


class Rebuild(eqx.Module):
    """Law from a vector that holds some of its numbers.

    The variational equation has a column for every entry, so numbers that never move in a round are
    left out; those that happen not to are held by a mask, which needs no other program.
    """

    template: TensorBasisNetwork  # a law; what is not in the vector comes from it
    positions: Int[Array, " q"]  # place of each entry among all trainable numbers, shape (q,)
    moves: Bool[Array, " q"]  # false where an entry keeps the template's value, shape (q,)
    scale: Float[Array, " q"]  # size of each entry's unit, shape (q,)

    @classmethod
    def of(
        cls,
        law: TensorBasisNetwork,
        moving: Bool[ArrayLike, "8"],
        scale: Float[ArrayLike, "8"],
        with_network: bool,
    ) -> "Rebuild":
        """Return the vector of the network's weights, where asked for, then the eight constants.

        Output weights of tensors that do not move are left out: the length depends on how many
        move. `law`: the template. `moving`: which constants move; of a network it must be known
        when a program is compiled. `scale`: unit of each constant.
        """
        n, weights, moving = _count_of(law), np.zeros(0, int), np.asarray(moving)
        if with_network:
            network: Any = places_of(law).network
            last = network.layers[-1]  # its bias is there: it was made with one
            idle = np.append(last.weight[~moving], last.bias[~moving])
            weights = np.setdiff1d(np.arange(n - N_COEFFICIENTS), idle)
        return cls(
            law,
            on_device(np.append(weights, np.arange(n - N_COEFFICIENTS, n))),
            on_device(np.append(np.ones(weights.size, bool), moving)),
            on_device(np.append(np.ones(weights.size), scale)),
        )

    @property
    def start(self) -> Float[Array, " q"]:
        """The vector that makes the template."""
        return _start(self)

    def __call__(self, weights: Float[Array, " q"]) -> TensorBasisNetwork:
        """Return the law with these numbers."""
        dynamic, static = split_law(self.template)
        held, unravel = ravel_pytree(dynamic)
        moved = jnp.where(self.moves, self.scale * weights, held[self.positions])
        return eqx.combine(unravel(held.at[self.positions].set(moved)), static)


@compiled
def _start(rebuild):
    return weights_of(rebuild.template)[rebuild.positions] / rebuild.scale


@compiled
def rebuilt(rebuild: Rebuild, weights: Float[Array, " q"]) -> TensorBasisNetwork:
    """Return the law with these numbers, by one compiled program."""
    return rebuild(weights)


class Along(NamedTuple):
    """Records of a law in the runs, at their samples, and its states there.

    `recorded`: in Pa, of creep the strain, shape (runs, n).
    """

    recorded: Float[Array, "runs n"]
    states: Float[Array, "runs n k 4"]  # dimensionless stress of every mode, shape (runs, n, k, 4)
    rate: Float[Array, "runs n"]  # in 1/s, shape (runs, n)


@compiled
def trajectories(law: TensorBasisNetwork, problem: TrainingProblem) -> Along:
    """Return what is recorded of a law at every sample, and its states there.

    A third of the work of `states_and_jacobian` where eight constants move.
    """

    def one(protocol, grid):
        seen = at_samples(problem.fluid(law), protocol, grid)
        return Along(seen.observed[:, 0], seen.states[..., :4], seen.rate)

    return problem.flows.over(one)


def side_by_side(
    weights: Float[Array, " p"], rebuild: Rebuild, problem: TrainingProblem
) -> tuple[Along, Float[Array, "runs n p"]]:
    """Return what `states_and_jacobian` does, computed for two halves of the runs in threads.

    Left to itself the compiled program uses two cores for longer than it takes on one. To be called
    from outside of any transformation.
    """
    n = len(problem.flows)
    # halves of one size share a program; of an odd number of runs the middle one is in both, which
    # of three is a third more work
    half = -(-n // 2)
    if n in (1, 3) or not problem.flows.is_uniform:
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
    """Return what is recorded and the states at the samples, with derivatives by each weight."""
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
