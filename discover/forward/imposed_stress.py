"""A fluid at a given stress: the strain is what it answers with."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.dynamics import Dynamics
from discover.protocols.kinematics import Kinematics

# The rate enters a law linearly but for terms that name it, for which one more step is enough
_NEWTON_STEPS = 2

# Of (h ω)² with the ringing ω of tool and fluid: from where on a step follows it
_RESOLVED = 0.1


def strain_at_stress(
    dynamics: Dynamics,
    times: Float[Array, " s"],
    imposed: Float[Array, " s"],
    inertia: Float[Array, ""] | float = 0.0,
    flow: Kinematics | None = None,
) -> Float[Array, " s"]:
    """Return the strain at step ends, zero at the first.

    In each stage of a step of Krogstad's method the rate is the one with which the stress goes to
    what is imposed at the end of the step, in a straight line: of the balance
    σ(γ̇) + η γ̇ + I dγ̇/dt = σ_imposed the rate is solved for, so that no differentiation of a
    measured strain comes in. What a step misses of the stress the next one makes good.

    Parameters
    ----------
    dynamics
        The fluid, with what gives way in series with it.
    times
        Step ends in s, shape (s,), increasing; at rest at the first.
    imposed
        Recorded stress there in Pa, shape (s,).
    inertia
        I of the tool in Pa s².
    flow
        Which flow it is; None is simple shear.
    """
    width = jnp.diff(times)
    modes = dynamics.modes

    def step(carry, inputs):
        stress, levels, before, strain = carry
        (from_, target), h, weights = inputs
        sheared, felt = dynamics.sheared(stress, before, flow)
        sheared = dynamics.combined("modulus_factor", levels) * sheared
        (ahead,) = dynamics.later(levels, felt, sheared, (h,))
        slow = dynamics.combined("time_factor", ahead)
        w = dynamics.weights_of_step(weights, h, slow)
        scale = dynamics.combined("modulus_factor", ahead)
        already = scale * dynamics.recorded(stress, flow)
        # backward Euler where the tool hardly counts, the trapezoidal rule where it swings
        swings = jnp.abs(inertia) / (
            jnp.abs(inertia) + h * (dynamics.viscosity + _RESOLVED * h * jnp.sum(modes.modulus))
        )
        late = 1.0 - 0.5 * swings
        unbalanced = (1.0 - late) * (from_ - already - dynamics.viscosity * before)

        def stage(state):
            """Return the rate of a stage, and what of its slope is not linear relaxation."""

            def missing(rate):
                change = dynamics.change(state, rate, slow, flow)
                moved = h * dynamics.recorded(change / modes.relaxation_time, flow)
                last = rate + swings * (rate - before)
                left = target - already - scale * moved - dynamics.viscosity * last
                return inertia * (last - before) / h - unbalanced - late * left

            rate = before
            for _ in range(_NEWTON_STEPS):
                value, slope = jax.jvp(missing, (rate,), (jnp.ones_like(rate),))
                rate = rate - value / slope
            change = dynamics.change(state, rate, slow, flow)
            return rate, w.remainder(state, slow * change, dynamics.decay)

        r1, n1 = stage(stress)
        r2, n2 = stage(w.second(stress, n1))
        r3, n3 = stage(w.third(stress, n1, n2))
        r4, n4 = stage(w.fourth(stress, n1, n3))
        after = w.end(stress, n1, n2, n3, n4)
        mean = (r1 + 2.0 * (r2 + r3) + r4) / 6.0
        sheared_after, felt = dynamics.sheared(after, mean, flow)
        middle = 0.5 * (sheared + scale * sheared_after)
        (levels,) = dynamics.later(levels, felt, middle, (h,))
        strain = strain + h * mean
        last = mean + swings * (mean - before)
        return (after, levels, last, strain), strain

    stress, levels = dynamics.rest()
    zero = jnp.zeros((), dtype=stress.dtype)
    start = (stress, levels, zero, zero)
    _, strain = jax.lax.scan(
        step, start, ((imposed[:-1], imposed[1:]), width, dynamics.weights(width))
    )
    strain = jnp.concatenate([jnp.zeros(1), strain])
    if dynamics.series is None:
        return strain
    # what gives way feels the same stress, and its strain is recorded with the fluid's
    slipped = jnp.cumsum(0.5 * (imposed[1:] + imposed[:-1]) * width)
    given = dynamics.series.compliance * (imposed - imposed[0])
    return strain + given + dynamics.series.slip * jnp.concatenate([jnp.zeros(1), slipped])
