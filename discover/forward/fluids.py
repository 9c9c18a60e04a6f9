"""Fluids in flows of any control for what needs derivatives by JAX; else there is `of_fluids`.

Every function here is made to be transformed: `jax.vmap`, `jax.jvp`, and reverse mode; a state that
is solved for has the derivative of the implicit function.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float, Inexact

from discover.forward.dynamics import Dynamics, Modes
from discover.forward.grid import IntegrationGrid
from discover.forward.stepping import (
    answer_to_stress,
    begun,
    follow,
    periodic_modes,
    without_derivatives,
)
from discover.laws.each_mode import of_each_mode, over_modes
from discover.laws.multimode import Fluid
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol
from tensor_library.algebra import VelocityGradient

Numbers = TypeVar("Numbers")

# Periodic states that are solved for side by side
_GROUP = 8


class AtSamples(NamedTuple):
    """What is seen of a fluid at the samples.

    `observed`: what is recorded, N1 and N2 in Pa; of an oscillation G′ + iG″, and zeros. `states`:
    dimensionless, of each mode; of an oscillation at zero strain.
    """

    observed: Inexact[Array, "n 3"]
    states: Float[Array, "n k s"]
    rate: Float[Array, " n"]  # in 1/s, shape (n,); of an oscillation its amplitude


def at_samples(fluid: Fluid, protocol: FlowProtocol, grid: IntegrationGrid) -> AtSamples:
    """Return what is seen of a fluid in one flow. Not finite where it runs away."""
    make = partial(dynamics_of_fluid, protocol=protocol)
    return samples_of_dynamics(make, fluid, fluid, protocol, grid)


def samples_of_dynamics(
    make: Callable[[Numbers], Dynamics],
    numbers: Numbers,
    fluid: Fluid,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
) -> AtSamples:
    """Return what `at_samples` does, of the modes that `make` makes of some numbers.

    `numbers`: a tree through which alone derivatives pass. `fluid`: of which these are the modes.
    """
    if protocol.control not in FOLLOWED:
        return solved_on_grid(make, numbers, protocol, grid)
    fixed = make(without_derivatives(numbers))
    states = follow(make(numbers), fixed, protocol, grid, lambda stress, _: stress.T)
    rate = jax.vmap(protocol.rate)(grid.sample_times)
    return AtSamples(_of_states(fluid, states, protocol, grid), states, rate)


def observed_in_reverse(
    fluid: Fluid, protocol: FlowProtocol, grid: IntegrationGrid, adjoint: Any
) -> Inexact[Array, "n 3"]:
    """Return what `AtSamples.observed` holds, at the samples of one grid.

    `adjoint`: how diffrax differentiates in reverse mode, in flows at a given rate in time.
    """
    if protocol.control != "rate":
        return at_samples(fluid, protocol, grid).observed
    make = partial(dynamics_of_fluid, protocol=protocol)
    start = begun(make(fluid), make(without_derivatives(fluid)), protocol, grid)
    from discover.forward.by_diffrax import followed_in_reverse  # diffrax takes a second to load

    modes = followed_in_reverse(dynamics_of_fluid, fluid, protocol, grid, start, adjoint)
    return _of_states(fluid, jnp.swapaxes(modes, 1, 2), protocol, grid)


def solved_on_grid(
    make: Callable[[Numbers], Dynamics],
    numbers: Numbers,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
) -> AtSamples:
    """Return what is seen where the rate is solved for: at a given stress, and of oscillations.

    `make`: the fluid of some numbers, a tree through which alone derivatives pass.
    """
    dynamics, fixed = make(numbers), make(without_derivatives(numbers))
    if protocol.control == "stress":
        return _at_given_stress(dynamics, fixed, protocol, grid)

    phase = grid.phase
    assert phase is not None  # of oscillations

    def one(number):
        strain, rate = protocol.strain_in_table(number), protocol.rate(number)
        return _in_alternation(dynamics, fixed, strain, rate, phase)

    # alike ones side by side, for all of a group take as many steps as the slowest
    order = jnp.argsort(-jax.vmap(protocol.strain_in_table)(grid.times))
    size = min(len(order), _GROUP)
    places = jnp.pad(order, (0, -len(order) % size), mode="edge")
    found = jax.lax.map(jax.vmap(one), grid.times[places].reshape(-1, size))
    of_sample = jnp.argsort(order)[grid.sample_index]  # not those that pad a record
    return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[of_sample], found)


def _in_alternation(
    dynamics: Dynamics, fixed: Dynamics, strain: Float[Array, ""], rate: Float[Array, ""],
    phase: Float[Array, " m"],
) -> AtSamples:  # fmt: skip
    """Return what is seen of one oscillation; see `AtSamples`.

    `strain`, `rate`: amplitudes. `phase`: ωt at step ends and middles in turn over half a cycle.
    """
    wave, frequency = rate * jnp.cos(phase), rate / strain
    rates = jnp.stack([wave[:-2:2], wave[1::2], wave[2::2]], axis=1)
    width = jnp.full(len(rates), (phase[2] - phase[0]) / frequency)
    count, period = jnp.asarray(len(rates)), 2.0 * jnp.pi / frequency
    start = periodic_modes(dynamics, fixed, rates, width, count, period, None, mirrored=True)

    def step(stress, inputs):
        weights, rates = inputs
        after = dynamics.stepped(weights, stress, rates, None)
        return after, dynamics.recorded(after, None)

    _, stress = jax.lax.scan(step, start, (dynamics.weights(width), rates))
    stress = stress + dynamics.viscosity * rates[:, 2]
    # of a periodic function the sum over a period is exact to all orders, and over half of it here
    modulus = 2j * jnp.mean(jnp.exp(-1j * phase[2::2]) * stress) / strain
    return AtSamples(modulus * jnp.array([1.0, 0.0, 0.0]), start.T, rate)


def _at_given_stress(
    dynamics: Dynamics, fixed: Dynamics, protocol: FlowProtocol, grid: IntegrationGrid
) -> AtSamples:
    imposed = jax.vmap(protocol.rate)(grid.times)  # the table holds the stress
    answer = answer_to_stress(dynamics, grid.times, imposed, protocol.kinematics, fixed)
    strain, states, rate = (part[grid.sample_index] for part in answer)
    s11, s22, s33, _ = jnp.tensordot(states[:, :4], dynamics.modes.modulus, axes=1).T
    observed = jnp.stack([strain, s11 - s22, s22 - s33], axis=-1)
    return AtSamples(observed, jnp.swapaxes(states, 1, 2), rate)


def _of_states(fluid, states: Float[Array, "n k s"], protocol: FlowProtocol, grid) -> Array:
    gradient = jax.vmap(protocol.velocity_gradient)(grid.sample_times)
    return observed_of_stress(jax.vmap(fluid.stress)(states, gradient), protocol)


def observed_of_stress(
    stress: Float[Array, "n 4 *c"], protocol: FlowProtocol
) -> Float[Array, "n 3 *c"]:
    """Return what is recorded of σ11, σ22, σ33, σ12 in Pa, N1 and N2."""
    s11, s22, s33, s12 = jnp.moveaxis(stress, 1, 0)
    recorded = protocol.recorded_stress(jnp.stack([s11, s22, s33, s12]))
    return jnp.stack([recorded, s11 - s22, s22 - s33], axis=1)


def dynamics_of_fluid(fluid: Fluid, protocol: FlowProtocol) -> Dynamics:
    """Return a fluid as the integrators take it."""
    law, count = fluid.law, fluid.n_modes

    def of_modes(name):
        values = of_each_mode(lambda law: getattr(law, name)(), law, count)
        # a choice of method, through which no derivative passes
        return jax.lax.stop_gradient(jnp.moveaxis(values, 0, -1))

    viscous = 1.0 if protocol.kinematics is None else protocol.kinematics.viscous
    return Dynamics(
        slope=over_modes(lambda law, *flow: law.stress_rate(*flow), law, -1),
        linear_relaxation=law.linear_relaxation,
        modes=Modes(fluid.modulus, fluid.relaxation_time),
        viscosity=jnp.asarray(fluid.solvent_viscosity * viscous),
        relaxations=of_modes("relaxations") if law.retracts else None,
        variables=law.variables,
        shares=of_modes("shares") if law.tensors else None,
    )


def with_cheap_tangents(
    stress_rate: Callable[[Any, Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]],
    given: Any,
) -> Callable[[Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]]:
    """Return the rate of a law whose tangents cost little, however many there are.

    Four pullbacks give the derivatives by stress, rate and every number of the law at once; each
    tangent is then a small matrix product. `stress_rate`: of `given` (not differentiated), of a
    tree of numbers, of σ and of λL.
    """
    # what is traced has to be handed in: a rule for derivatives must not close over it
    arrays, rest = eqx.partition(given, eqx.is_array)

    def of_all(arrays, numbers, stress, gradient):
        return stress_rate(eqx.combine(arrays, rest), numbers, stress, gradient)

    rate = jax.custom_jvp(of_all)

    def tangent(primals, tangents):
        arrays, *moving = primals
        still = [isinstance(leaf, SymbolicZero) for leaf in jax.tree.leaves(tangents[1])]
        if all(still):
            # few tangents, of the state or of the rate, are carried through the law
            flow = [
                jnp.zeros_like(value) if isinstance(moved, SymbolicZero) else moved
                for value, moved in zip(moving[1:], tangents[2:], strict=True)
            ]
            return jax.jvp(partial(of_all, arrays, moving[0]), tuple(moving[1:]), tuple(flow))
        value, pull = jax.vjp(partial(of_all, arrays), *moving)
        rows = jax.vmap(pull)(jnp.eye(value.shape[0]))
        total = jnp.zeros_like(value)
        pairs = zip(*map(jax.tree.leaves, (rows, tuple(tangents[1:]))), strict=True)
        for row, moved in pairs:
            if not isinstance(moved, SymbolicZero):
                total = total + jnp.tensordot(row, moved, axes=moved.ndim)
        return value, total

    rate.defjvp(tangent, symbolic_zeros=True)
    return partial(rate, arrays)
