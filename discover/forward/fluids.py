"""Fluids without instrument in flows of any control: what is recorded at the samples.

A law is followed in time at a given rate, at a given stress the rate is solved for, and steady and
periodic states are solved for as such. Every function here is made to be transformed: `jax.vmap`
over runs or laws, `jax.jvp`, and reverse mode; a state that is solved for has the derivative of the
implicit function.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float, Inexact

from discover.forward.dynamics import Dynamics, Modes
from discover.forward.imposed_stress import answer_to_stress
from discover.forward.starts.periodic_states import periodic_state
from discover.laws.each_mode import of_each_mode, over_modes
from discover.laws.multimode import Fluid
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol, recorded_at
from discover.simulate.flow_batch import FlowBatch, lay_out
from discover.simulate.following import without_derivatives
from discover.simulate.grid import IntegrationGrid
from discover.simulate.solve import (
    SimulationError,
    simulate,
    solve_on_grid,
    solve_states_on_grid,
)
from tensor_library.kinematics import VelocityGradient

Numbers = TypeVar("Numbers")

_SAMPLES, _STEPS = 64, 256

# Periodic states that are solved for side by side
_GROUP = 8


class AtSamples(NamedTuple):
    """What is seen of a fluid at the samples.

    Attributes
    ----------
    observed
        What is recorded, and N1 and N2 in Pa, shape (n, 3). Of an oscillation G′ + iG″, of which a
        run shows one, see `FlowBatch.over`; N1 and N2, for it belongs to no moment, are zero.
    states
        Dimensionless, of each mode, shape (n, k, s); of an oscillation at zero strain.
    rate
        In 1/s, shape (n,); of an oscillation its amplitude.
    """

    observed: Inexact[Array, "n 3"]
    states: Float[Array, "n k s"]
    rate: Float[Array, " n"]


def at_samples(fluid: Fluid, protocol: FlowProtocol, grid: IntegrationGrid) -> AtSamples:
    """Return what is seen of a fluid in one flow. Not finite where it runs away."""
    if protocol.control in FOLLOWED:
        states = solve_states_on_grid(fluid, protocol, grid)
        rate = jax.vmap(protocol.rate)(grid.sample_times)
        gradient = jax.vmap(protocol.velocity_gradient)(grid.sample_times)
        stress = jax.vmap(fluid.stress)(states, gradient)
        return AtSamples(_observed(stress, protocol), states, rate)
    return solved_on_grid(partial(dynamics_of_fluid, protocol=protocol), fluid, protocol, grid)


def observed_on_grid(
    fluid: Fluid, protocol: FlowProtocol, grid: IntegrationGrid, adjoint: Any = None
) -> Inexact[Array, "n 3"]:
    """Return what `AtSamples.observed` holds, at the samples of one grid."""
    if protocol.control in FOLLOWED:
        return _observed(solve_on_grid(fluid, protocol, grid, adjoint), protocol)
    return at_samples(fluid, protocol, grid).observed


@compiled
def observed_in_batch(fluid: Fluid, flows: FlowBatch) -> Float[Array, "runs n 3"]:
    """Return what is recorded of one fluid in a batch of runs, and N1 and N2."""
    return flows.over(partial(observed_on_grid, fluid))


def observe(
    fluid: Fluid, protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return what is recorded of a fluid in one flow of any control, and N1 and N2 in Pa.

    At a given rate to a tolerance, as `simulate` does.

    Parameters
    ----------
    fluid, protocol, times
        As in `simulate`.
    """
    if protocol.control in FOLLOWED:
        stress = simulate(fluid, protocol, times)
        recorded = recorded_at(protocol, stress.components)
        n1, n2 = stress.first_normal_stress_difference, stress.second_normal_stress_difference
        return np.stack([recorded, n1, n2], axis=-1)
    n = len(times)
    # lengths rounded up, so that flows share programs
    flows = lay_out([protocol], [times], n + -n % _SAMPLES).with_steps_in(_STEPS)
    observed = np.asarray(observed_in_batch(fluid, flows))[0, :n]
    if not np.all(np.isfinite(observed)):
        what = "bears this stress" if protocol.control == "stress" else "becomes periodic"
        raise SimulationError(
            f"The law could not be integrated: nothing shows that it {what}. Check its parameters "
            "and the flow."
        )
    return observed


def solved_on_grid(
    make: Callable[[Numbers], Dynamics],
    numbers: Numbers,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    together: bool = False,
) -> AtSamples:
    """Return what is seen where the rate is solved for: at a given stress, and of oscillations.

    Parameters
    ----------
    make
        The fluid of some numbers; derivatives pass through these alone.
    numbers
        A tree.
    protocol, grid
        Of one run, from `lay_out`.
    together
        Whether the samples are of use only together, and not one is solved for once another cannot.
    """
    dynamics, fixed = make(numbers), make(without_derivatives(numbers))
    if protocol.control == "stress":
        return _at_given_stress(dynamics, fixed, protocol, grid)

    phase = grid.phase
    assert phase is not None  # of oscillations
    axis = "states" if together else None

    def one(number):
        strain, rate = protocol.strain_in_table(number), protocol.rate(number)
        found = periodic_state(dynamics, fixed, strain, rate / strain, phase, axis)
        return AtSamples(found.modulus * jnp.array([1.0, 0.0, 0.0]), found.stress.T, rate)

    solve = jax.vmap(one, axis_name=axis)

    def group(wanted, numbers):
        if not together:
            return wanted, solve(numbers)
        shapes = jax.eval_shape(solve, numbers)
        found = jax.lax.cond(
            wanted,
            solve,
            lambda _: jax.tree.map(lambda leaf: jnp.full(leaf.shape, jnp.nan, leaf.dtype), shapes),
            numbers,
        )
        return wanted & jnp.all(jnp.isfinite(found.observed)), found

    # alike ones side by side, for all of a group take as many steps as the slowest; and the largest
    # strain first, for it is where a law has no state
    order = jnp.argsort(-jax.vmap(protocol.strain_in_table)(grid.times))
    size = min(len(order), _GROUP)
    places = jnp.pad(order, (0, -len(order) % size), mode="edge")
    _, found = jax.lax.scan(group, jnp.asarray(True), grid.times[places].reshape(-1, size))
    of_sample = jnp.argsort(order)[grid.sample_index]  # not those that pad a record
    return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[of_sample], found)


def _at_given_stress(
    dynamics: Dynamics, fixed: Dynamics, protocol: FlowProtocol, grid: IntegrationGrid
) -> AtSamples:
    imposed = jax.vmap(protocol.rate)(grid.times)  # the table holds the stress
    answer = answer_to_stress(dynamics, grid.times, imposed, 0.0, protocol.kinematics, fixed)
    strain, states, rate = (part[grid.sample_index] for part in answer)
    s11, s22, s33, _ = jnp.tensordot(states[:, :4], dynamics.modes.modulus, axes=1).T
    observed = jnp.stack([strain, s11 - s22, s22 - s33], axis=-1)
    return AtSamples(observed, jnp.swapaxes(states, 1, 2), rate)


def _observed(stress: Float[Array, "n 4"], protocol: FlowProtocol) -> Float[Array, "n 3"]:
    s11, s22, s33, _ = stress.T
    return jnp.stack([protocol.recorded_stress(stress.T), s11 - s22, s22 - s33], axis=-1)


def dynamics_of_fluid(fluid: Fluid, protocol: FlowProtocol) -> Dynamics:
    """Return a fluid as the integrators take it."""
    dynamics = dynamics_of_modes(
        over_modes(lambda law, *flow: law.stress_rate(*flow), fluid.law, -1),
        fluid.modulus,
        fluid.relaxation_time,
        fluid.solvent_viscosity,
        protocol,
        fluid.law.variables,
    )
    law, count = fluid.law, fluid.n_modes

    def of_modes(name):
        values = of_each_mode(lambda law: getattr(law, name)(), law, count)
        # a choice of method, through which no derivative passes
        return jax.lax.stop_gradient(jnp.moveaxis(values, 0, -1))

    return dynamics._replace(
        linear_relaxation=law.linear_relaxation,
        relaxations=of_modes("relaxations") if law.retracts else None,
        shares=of_modes("shares") if law.tensors else None,
    )


def dynamics_of_modes(
    slope: Callable[[Float[Array, "s k"], Float[Array, "*c k"]], Float[Array, "s k"]],
    modulus: Float[Array, " k"],
    relaxation_time: Float[Array, " k"],
    solvent_viscosity: Float[Array, ""] | float,
    protocol: FlowProtocol,
    variables: int = 0,
) -> Dynamics:
    """Return modes as the integrators take them.

    Parameters
    ----------
    slope
        Dimensionless dσ/dt of all modes, of their σ and their λL, modes along the last axis.
    modulus, relaxation_time, solvent_viscosity
        In Pa, s and Pa s.
    variables
        Structure variables of each mode.
    """
    viscous = 1.0 if protocol.kinematics is None else protocol.kinematics.viscous
    return Dynamics(
        slope=slope,
        # the natural split in any case; where it lies decides accuracy only
        linear_relaxation=True,
        declared=Modes(modulus, relaxation_time),
        extra=None,
        states={},
        series=None,
        viscosity=jnp.asarray(solvent_viscosity * viscous),
        variables=variables,
    )


def with_cheap_tangents(
    stress_rate: Callable[[Any, Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]],
    given: Any,
) -> Callable[[Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]]:
    """Return the rate of a law whose tangents cost little, however many there are.

    Four pullbacks give the derivative by stress, rate and every number of the law at once; each
    tangent is then a product with a small matrix, where one through the law evaluates all of it.

    Parameters
    ----------
    stress_rate
        Of what is given, of a tree of numbers by which is differentiated, of σ and of λL.
    given
        A tree through which no derivative passes.
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
