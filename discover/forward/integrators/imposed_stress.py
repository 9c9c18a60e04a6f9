"""A fluid at a given stress: the strain is what it answers with."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.forward.dynamics import Dynamics, Series
from discover.protocols.kinematics import Kinematics
from tensor_library.contraction import contracted

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

    In each step the rate is a straight line, and such that the balance σ + η γ̇ + I dγ̇/dt =
    σ_imposed holds in the middle and at the end: collocation of a Volterra equation of the first
    kind, of order two and stable whatever the modes' times, since one of the points is the end
    [Brunner 2004, Collocation Methods for Volterra Integral and Related Functional Differential
    Equations, chapter 2.4]. No differentiation of a measured strain comes in. The modes follow that
    rate by Krogstad's method, and what a step misses of the stress the next one makes good.

    `dynamics`: the fluid, with what gives way in series with it. `times`: step ends in s, shape
    (s,), increasing; at rest at the first. `imposed`: recorded stress there in Pa, shape (s,).
    `inertia`: I of the tool in Pa s². `flow`: which flow it is; None is simple shear. `fixed`: the
    fluid once more, through which no derivative passes: where the rate is looked for, those of its
    law would cost much and say nothing.
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
