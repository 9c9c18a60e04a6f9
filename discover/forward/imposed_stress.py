"""A fluid at a given stress: the strain is what it answers with."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.dynamics import Dynamics
from discover.protocols.kinematics import Kinematics

# Of (h ω)² with the ringing ω of tool and fluid: from where on a step follows it
_RESOLVED = 0.1


class Answer(NamedTuple):
    """What a fluid answers a given stress with, at step ends.

    Attributes
    ----------
    strain
        Recorded, zero at the first.
    stress
        Dimensionless, of the modes, shape (steps, s, k).
    rate
        In 1/s.
    """

    strain: Float[Array, " s"]
    stress: Float[Array, "s _ k"]
    rate: Float[Array, " s"]


def answer_to_stress(
    dynamics: Dynamics,
    times: Float[Array, " s"],
    imposed: Float[Array, " s"],
    inertia: Float[Array, ""] | float = 0.0,
    flow: Kinematics | None = None,
    fixed: Dynamics | None = None,
) -> Answer:
    """Return the strain at step ends, and the modes and the rate there.

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
    fixed
        The fluid once more, through which no derivative passes: where the rate is looked for, those
        of its law would cost much and say nothing.
    """
    fixed = dynamics if fixed is None else fixed
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

        def missing(rate, change):
            """Return what the balance misses."""
            moved = h * dynamics.recorded(change / modes.relaxation_time, flow)
            last = rate + swings * (rate - before)
            left = target - already - scale * moved - dynamics.viscosity * last
            return inertia * (last - before) / h - unbalanced - late * left

        def stage(state, _):
            """Return what of the slope is not linear relaxation, and the rate."""
            still = jax.lax.stop_gradient(state)

            def of_rate(rate):
                change = fixed.change(still, rate, slow, flow)
                return change, missing(rate, change)

            def tangent(rate):
                (_, value), slopes = jax.jvp(of_rate, (rate,), (jnp.ones_like(rate),))
                return jax.lax.stop_gradient((value, slopes))

            # the rate enters a law linearly but for terms that name it: two of Newton's steps
            value, (_, slope) = tangent(before)
            near = jax.lax.stop_gradient(before) - value / slope
            _, (along, slope) = tangent(near)
            change = dynamics.change(state, near, slow, flow)
            # the last step moves by θ as the implicit function does, and the change with it
            step = -missing(near, change) / slope
            change = change + along * step
            return w.remainder(state, slow * change, dynamics.decay), near + step

        after, rates = w.step(stress, stage, jnp.arange(4))
        mean = (rates[0] + 2.0 * (rates[1] + rates[2]) + rates[3]) / 6.0
        sheared_after, felt = dynamics.sheared(after, mean, flow)
        middle = 0.5 * (sheared + scale * sheared_after)
        (levels,) = dynamics.later(levels, felt, middle, (h,))
        strain = strain + h * mean
        last = mean + swings * (mean - before)
        return (after, levels, last, strain), (strain, after, last)

    stress, levels = dynamics.rest()
    zero = jnp.zeros((), dtype=stress.dtype)
    start = (stress, levels, zero, zero)
    _, later = jax.lax.scan(
        step, start, ((imposed[:-1], imposed[1:]), width, dynamics.weights(width))
    )
    strain, stress, rate = (
        jnp.concatenate([first[None], rest])
        for first, rest in zip((zero, stress, zero), later, strict=True)
    )
    if dynamics.series is None:
        return Answer(strain, stress, rate)
    # what gives way feels the same stress, and its strain is recorded with the fluid's
    slipped = jnp.cumsum(0.5 * (imposed[1:] + imposed[:-1]) * width)
    given = dynamics.series.compliance * (imposed - imposed[0])
    strain = strain + given + dynamics.series.slip * jnp.concatenate([jnp.zeros(1), slipped])
    return Answer(strain, stress, rate)
