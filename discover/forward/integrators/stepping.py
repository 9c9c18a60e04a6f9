"""Modes stepped through a run at a given rate, with effects, or under an imposed stress."""

from collections.abc import Callable
from typing import NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from discover.forward.dynamics import Dynamics, Series
from discover.forward.grids.grid import IntegrationGrid
from discover.forward.starts.half_cycles import Cycle, periodic_start
from discover.forward.starts.steady_states import steady_state
from discover.protocols.kinematics import Kinematics
from discover.protocols.protocol import FlowProtocol
from tensor_library.algebra import contracted
from tensor_library.kinematics import VelocityGradient

Tree = TypeVar("Tree")

Observe = Callable[[Float[Array, "s *c k"], VelocityGradient], PyTree]
"""What is seen of the modes in a flow with this L in 1/s."""


def follow(
    dynamics: Dynamics,
    fixed: Dynamics,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    observe: Observe,
    start: Float[Array, "s *c k"] | None = None,
) -> PyTree:
    """Return what is observed at the samples of one grid, stacked along a new first axis.

    Made to be transformed. A law that diverges gives infinite or nan values, never an error.

    `dynamics`: the modes, with derivatives beside them where it has columns; without states or
    series. `fixed`: the same, through which no derivative passes. `start`: the modes at the first
    time; by default as `begun` says.
    """
    flow = protocol.kinematics
    if protocol.control == "steady":

        def at(number):
            stress = steady_state(dynamics, fixed, protocol.rate(number), flow)
            return observe(stress, protocol.velocity_gradient(number))

        return grid.of_states(at)
    rate, width = _stepped(protocol, grid)

    def seen(stress, rate):
        return observe(stress, rate if flow is None else rate * flow.gradient)

    def step(stress, inputs):
        rates, width = inputs
        stress = dynamics.after_step(stress, rates, width, flow)
        return stress, seen(stress, rates[2])

    start = begun(dynamics, fixed, protocol, grid) if start is None else start
    _, later = jax.lax.scan(step, start, (rate, width))
    first = seen(start, rate[0, 0])
    return jax.tree.map(
        lambda one, others: jnp.concatenate([one[None], others])[grid.sample_index], first, later
    )


def begun(
    dynamics: Dynamics, fixed: Dynamics, protocol: FlowProtocol, grid: IntegrationGrid
) -> Float[Array, "s *c k"]:
    """Return the modes at the start of a grid: at rest, or periodic where it begins with a cycle.

    A periodic state is solved for without derivatives; one step of Newton's method from there moves
    it by nothing, and its derivatives to those of the implicit function.
    """
    rest, _ = dynamics.rest()
    if grid.cycle is None:
        return rest
    rate, width = (of[: grid.cycle_steps] for of in _stepped(protocol, grid))

    def after_cycle(fluid: Dynamics, stress):
        def step(stress, inputs):
            number, rates, width = inputs
            after = fluid.after_step(stress, rates, width, protocol.kinematics)
            return jnp.where(number < grid.cycle, after, stress), None

        return jax.lax.scan(step, stress, (jnp.arange(grid.cycle_steps), rate, width))[0]

    def along(unit):
        direction = unit[:, None] * jnp.ones_like(state)
        return jax.jvp(lambda stress: after_cycle(fixed, stress), (state,), (direction,))[1]

    is_periodic = grid.cycle > 0
    period = grid.times[grid.cycle] - grid.times[0]
    slowness = fixed.modes.relaxation_time / jnp.where(period > 0.0, period, 1.0)
    alone, _ = fixed.rest()
    state, _ = periodic_start(
        lambda stress, levels: (after_cycle(fixed, stress), levels),
        (alone, ()),
        slowness,
        is_periodic,
    )
    state = jax.lax.stop_gradient(state)
    start = state if not dynamics.columns else rest.at[:, 0].set(state)
    change = after_cycle(dynamics, start) - start
    # of every mode, the derivative of the end of a cycle by its start: direction, component, mode
    ends = jax.lax.stop_gradient(jax.vmap(along)(jnp.eye(len(state))))
    matrix = jnp.eye(len(state)) - ends.T
    right = jnp.moveaxis(change, -1, 0).reshape(len(matrix), len(state), -1)
    step = jnp.moveaxis(jnp.linalg.solve(matrix, right), 0, -1).reshape(change.shape)
    return jnp.where(is_periodic, start + step, rest)


def _stepped(
    protocol: FlowProtocol, grid: IntegrationGrid
) -> tuple[Float[Array, "steps 3"], Float[Array, " steps"]]:
    """Return rates at the beginning, middle and end of every step, and its width in s."""
    first, width = grid.times[:-1], jnp.diff(grid.times)
    at_ends = jax.vmap(protocol.rate)(grid.times)
    in_middle = jax.vmap(protocol.rate)(first + 0.5 * width)
    return jnp.stack([at_ends[:-1], in_middle, at_ends[1:]], axis=1), width


def without_derivatives(tree: Tree) -> Tree:
    """Return a tree through which no derivative passes."""
    return jax.tree.map(
        lambda leaf: jax.lax.stop_gradient(leaf) if eqx.is_inexact_array(leaf) else leaf, tree
    )


# Below this fraction of the run a step only marks a jump of the rate, and nothing gives way in it
JUMP = 1e-9


def integrate(
    dynamics: Dynamics,
    times: Float[Array, " s"],
    rate: Float[Array, " m"],
    steps: Int[Array, ""],
    flow: Kinematics | None = None,
    cycle: Cycle | None = None,
) -> tuple[Float[Array, " s"], Float[Array, " s"]]:
    """Return the recorded stress of the modes in Pa and the felt rate in 1/s at step ends.

    `times`, `rate`: step ends, and the rate at ends and middles in turn. `steps`: how many are
    taken; padding follows. `flow`: None is simple shear. `cycle`: the last one before the record,
    in a batch of runs with a periodic start.
    """
    width = jnp.diff(times)
    if cycle is not None:
        # a state that stays where it is says nothing of where a cycle brings it
        dynamics = dynamics._replace(states_in_use=None)
    states, series = dynamics.states, dynamics.series
    combined = dynamics.combined

    def step(carry, inputs):
        stress, levels, missing, compliance_rate = carry
        (first_rate, middle_rate, last_rate), h, weights = inputs
        scale = combined("modulus_factor", levels)
        shear_before, felt_rate = dynamics.sheared(stress, middle_rate, flow)
        shear_before = scale * shear_before
        halfway, at_end = dynamics.later(levels, felt_rate, shear_before, (0.5 * h, h))
        slow_first = combined("time_factor", levels)
        slow_middle = combined("time_factor", halfway)
        slow_last = combined("time_factor", at_end)
        w = dynamics.weights_of_step(weights, h, slow_middle)

        # so that it is traced once, and not at each of the four stages
        remainder = jax.jit(dynamics.stage(w, slow_middle, flow))
        n1 = remainder(stress, (first_rate + compliance_rate, slow_first))
        if series is not None:
            scale_last = combined("modulus_factor", at_end)
            n1, compliance_rate = _compliance_rate(
                dynamics, scale_last, stress, shear_before, missing, compliance_rate, n1, w.whole,
                slow_middle, first_rate, last_rate, h, times[-1],
            )  # fmt: skip
        middle_rate, last_rate = middle_rate + compliance_rate, last_rate + compliance_rate
        n2 = remainder(w.second(stress, n1), (middle_rate, slow_middle))
        n3 = remainder(w.third(stress, n1, n2), (middle_rate, slow_middle))
        n4 = remainder(w.fourth(stress, n1, n3), (last_rate, slow_last))
        after = w.end(stress, n1, n2, n3, n4)

        # the states once more, now with the mean of the stress at both ends
        shear_after, felt_rate = dynamics.sheared(after, middle_rate, flow)
        stress_after = dynamics.recorded(after, flow)
        if states:
            guess = combined("modulus_factor", at_end) * shear_after
            middle_stress = 0.5 * (shear_before + guess)
            (levels,) = dynamics.later(levels, felt_rate, middle_stress, (h,))
            factor = combined("modulus_factor", levels)
            shear_after, stress_after = factor * shear_after, factor * stress_after
        if series is not None:
            torque = 0.5 * (
                shear_before + shear_after
                + dynamics.viscosity * (first_rate + last_rate + compliance_rate)
            )  # fmt: skip
            missing = missing + compliance_rate * h + series.slip_at(torque) * h * torque
        return (after, levels, missing, compliance_rate), (stress_after, compliance_rate)

    zero = jnp.zeros(())
    rest = dynamics.rest()
    start = (*rest, zero, zero)
    rates = (rate[:-2:2], rate[1::2], rate[2::2])
    inputs = (rates, width, dynamics.weights(width))
    begun_at, begun = -1, start
    if cycle is not None:
        begun_at, begun = cycle.start, _begun(step, start, inputs, cycle, times, dynamics)

    def taken(number, so_far):
        carry, recorded = so_far
        if cycle is not None:
            carry = jax.tree.map(lambda a, b: jnp.where(number == begun_at, b, a), carry, begun)
        carry, seen = step(carry, jax.tree.map(lambda of: of[number], inputs))
        return carry, recorded.at[:, number].set(jnp.stack(seen))

    begin = (start, jnp.zeros((2, len(width))))
    _, (stress, compliance_rate) = jax.lax.fori_loop(0, steps, taken, begin)
    felt = rate[::2]
    if series is not None:
        # constant in each step; at its ends the mean of both sides, behind the last one its own
        before, after = compliance_rate[:-1], compliance_rate[1:]
        inside = 0.5 * (before + jnp.where(jnp.arange(1, len(width)) < steps, after, before))
        felt = felt + jnp.concatenate([compliance_rate[:1], inside, compliance_rate[-1:]])
    return jnp.concatenate([jnp.zeros(1), stress]), felt


def _begun(step, start, inputs, cycle: Cycle, times, dynamics: Dynamics):
    """Return the carry at the start of the cycle, which the cycle brings back."""
    numbers = jnp.arange(cycle.steps)
    one_cycle = jax.tree.map(
        lambda of: jax.lax.dynamic_slice_in_dim(of, cycle.start, cycle.steps), inputs
    )

    def through(carry):
        def in_cycle(carry, numbered):
            number, one = numbered
            after, _ = step(carry, one)
            inside = number < cycle.end - cycle.start
            return jax.tree.map(lambda a, b: jnp.where(inside, a, b), after, carry), None

        return jax.lax.scan(in_cycle, carry, (numbers, one_cycle))[0]

    def after_cycle(stress, levels):
        stress, levels, *_ = through((stress, levels, *start[2:]))
        return stress, levels

    period = times[cycle.end] - times[cycle.start]
    slowness = dynamics.modes.relaxation_time / jnp.where(period > 0.0, period, 1.0)
    stress, levels = periodic_start(after_cycle, start[:2], slowness, period > 0.0)
    # what gives way in series comes back too
    _, _, *series = through((stress, levels, *start[2:]))
    return (stress, levels, *series)


def _compliance_rate(
    dynamics: Dynamics,
    scale,
    stress,
    before,
    missing,
    earlier,
    n1,
    w,
    slow,
    first_rate,
    last_rate,
    h,
    end,
):
    """Return the slope with it, and the rate that the series elements take in this step.

    Their strain at the end must be −C σ − ∫ s σ dt. The stress there is predicted by one
    exponential Euler step, linear in the rate; what this misses is taken to the next step in
    `missing`.
    """
    series, modes, viscous = dynamics.series, dynamics.modes, dynamics.viscosity
    assert series is not None
    full, whole = w.full, w.b1 + 2.0 * w.b23 + w.b4
    own_time = slow * modes.relaxation_time
    stretch = own_time * (1.0 + stress[1])
    predicted = scale * dynamics.summed(full * stress[3] + whole * n1[3])
    stiffness = scale * dynamics.summed(whole * stretch)
    # that of the start of the step; what it misses is carried on as well
    slip = series.slip_at(before)
    compliance = series.compliance + 0.5 * slip * h
    # torque at the ends for the rate that was given way to before
    predicted = predicted + viscous * (last_rate + earlier)
    before = before + viscous * (first_rate + earlier)
    taken = compliance * (predicted - (stiffness + viscous) * earlier)
    taken = taken + 0.5 * slip * h * before + missing
    now = -taken / (h + compliance * (stiffness + viscous))
    now = jnp.where(h > JUMP * end, now, earlier)
    change = (now - earlier) * own_time
    # the upper convected derivative is linear in the rate
    zero = jnp.zeros_like(stress[0])
    still = [zero] * (len(stress) - 4)  # of structure variables a step later is soon enough
    convected = [2.0 * stress[3], zero, zero, 1.0 + stress[1], *still]
    return n1 + change * jnp.stack(convected), now


RATE_OF_RATE = np.array([[0.0, 1.0], [-4.0, 3.0]])
"""dγ̇/dt where the rate is asked for, over 1/h, of the rates there less that before: of the parabola
through all three."""


class Answer(NamedTuple):
    """What a fluid answers a given stress with, at step ends."""

    strain: Float[Array, " s"]  # recorded, zero at the first
    stress: Float[Array, "s _ k"]  # dimensionless, of the modes, shape (steps, s, k)
    rate: Float[Array, " s"]  # in 1/s


def answer_to_stress(
    dynamics: Dynamics,
    times: Float[Array, " s"],
    imposed: Float[Array, " s"],
    inertia: Float[Array, ""] | float,
    flow: Kinematics | None,
    fixed: Dynamics | None = None,
) -> Answer:
    """Return the strain at step ends, and the modes and the rate there.

    In each step the rate is a straight line such that σ + η γ̇ + I dγ̇/dt = σ_imposed holds in the
    middle and at the end: collocation of a Volterra equation of the first kind, of order two and
    stable whatever the modes' times   [Brunner 2004, Collocation Methods for Volterra Integral and
    Related Functional Differential Equations, chapter 2.4]. The modes follow that rate by
    Krogstad's method.

    `times`: step ends in s, at rest at the first. `imposed`: recorded stress there in Pa.
    `inertia`: I of the tool in Pa s². `fixed`: the fluid once more, through which no derivative
    passes.
    """
    fixed = dynamics if fixed is None else fixed
    width = jnp.diff(times)

    def step(carry, inputs):
        stress, levels, before, bend, strain = carry
        (from_, target), h, weights = inputs
        sheared, felt = dynamics.sheared(stress, before, flow)
        sheared = dynamics.combined("modulus_factor", levels) * sheared
        halfway, ahead = dynamics.later(levels, felt, sheared, (0.5 * h, h))
        slow = dynamics.combined("time_factor", ahead)
        w = dynamics.weights_of_step(weights, h, slow)
        scale = jnp.stack([dynamics.combined("modulus_factor", at) for at in (halfway, ahead)])
        wanted = jnp.stack([0.5 * (from_ + target), target])
        accelerated = inertia / h * RATE_OF_RATE

        def followed(fluid: Dynamics, rates):
            """Return what the balance misses at rates in the middle and at the end; the modes."""
            middle, last = rates

            of_fluid = fluid.stage(w, slow, flow)

            def stage(state, rate):
                remainder = of_fluid(state, (rate, slow))
                return remainder, remainder

            in_stages = jnp.stack([2.0 * middle - last, middle, middle, last])
            after, remainders = w.step(stress, stage, in_stages)
            there = (w.middle(stress, *remainders), after)
            felt = jnp.stack([fluid.recorded(state, flow) for state in there])
            viscous = dynamics.viscosity * rates
            missing = wanted - scale * felt - viscous - contracted(accelerated, rates - before)
            return missing, after

        # one of Newton's steps, with slopes that no derivative passes through
        rates = jax.lax.stop_gradient(before + bend * h * jnp.array([0.5, 1.0]))

        def as_it_is(rates):
            missing, _ = followed(fixed, rates)
            return missing, missing

        stiffness, missing = jax.lax.stop_gradient(jax.jacfwd(as_it_is, has_aux=True)(rates))
        (a, b), (c, d) = -stiffness
        inverse = jnp.array([[d, -b], [-c, a]]) / (a * d - b * c)
        rates = rates + contracted(inverse, missing)

        def corrected(carry, share):
            rates, _ = carry
            missing, after = followed(dynamics, rates)
            return (rates + share * contracted(inverse, missing), after), None

        # one more with the same slopes, by which the rates move as the implicit function does, and
        # the modes at what that found
        (rates, after), _ = jax.lax.scan(corrected, (rates, stress), jnp.array([1.0, 0.0]))
        mean, last = rates
        sheared_after, felt = dynamics.sheared(after, mean, flow)
        middle = 0.5 * (sheared + scale[1] * sheared_after)
        (levels,) = dynamics.later(levels, felt, middle, (h,))
        strain = strain + h * mean
        bend = 2.0 * (last - mean) / h
        return (after, levels, last, bend, strain), (strain, after, last)

    stress, levels = dynamics.rest()
    zero = jnp.zeros((), dtype=stress.dtype)
    start = (stress, levels, zero, zero, zero)
    _, later = jax.lax.scan(
        step, start, ((imposed[:-1], imposed[1:]), width, dynamics.weights(width))
    )
    strain, stress, rate = (
        jnp.concatenate([first[None], rest])
        for first, rest in zip((zero, stress, zero), later, strict=True)
    )
    if dynamics.series is None:
        return Answer(strain, stress, rate)
    given = strain_in_series(dynamics.series, times, imposed)
    return Answer(strain + given, stress, rate)


def strain_in_series(
    series: Series, times: Float[Array, " s"], imposed: Float[Array, " s"]
) -> Float[Array, " s"]:
    """Return the strain of what gives way, which feels the same stress as the fluid.

    `series`: what gives way; slip that depends on the stress is left out.
    """
    slipped = jnp.cumsum(0.5 * (imposed[1:] + imposed[:-1]) * jnp.diff(times))
    given = series.compliance * (imposed - imposed[0])
    return given + series.slip * jnp.concatenate([jnp.zeros(1), slipped])
