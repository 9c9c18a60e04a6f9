"""Integration of the modes together with what effects add to their state.

The scheme is Krogstad's exponential method for the modes. Beside them run the scalar states of the
fluid, with steps that are exact for constant coefficients, and the deformation that elements in
series with the fluid take away. What no candidate needs is not compiled.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from discover.forward.dynamics import Dynamics
from discover.forward.starts.periodic_start import Cycle, periodic_start
from discover.protocols.kinematics import Kinematics

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

    `dynamics`: the fluid, with what gives way in series with it. `times`, `rate`: step ends, shape
    (s,), and the rate at ends and middles in turn, shape (2 s − 1,). `steps`: how many steps are
    taken; those beyond are padding, and nothing is computed of them. `flow`: which flow has this
    rate; None is simple shear. `cycle`: the last cycle before the record, of a batch that holds
    runs with a periodic start.
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

    The strain that they have taken at the end of the step must be −C σ − ∫ s σ dt there. The
    stress at the end is predicted by one exponential Euler step, linear in the rate; what the
    prediction misses is carried in `missing` to the next step.
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
