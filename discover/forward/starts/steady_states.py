"""Steady states of a fluid, one for each rate of a flow curve."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from discover.forward.dynamics import Dynamics, Levels
from discover.forward.starts.approach import (
    MOST_STEPS,
    Approach,
    approach,
    approach_step,
    arrived,
    moves,
    newton_step,
)
from discover.protocols.kinematics import Kinematics


class _Way(NamedTuple):
    """A way towards a steady state, with the states of the fluid and the rate that it feels."""

    index: Float[Array, ""]
    way: Approach
    levels: Levels
    felt: Float[Array, ""]
    moving: Bool[Array, ""]


def steady_states(
    dynamics: Dynamics, rates: Float[Array, " n"], flow: Kinematics | None = None
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """Return the recorded stress of the modes in Pa and the felt rate in 1/s in steady flow.

    Each state is approached from rest by linearly implicit Euler steps in pseudo-time that grow
    until they are Newton's   [Kelley & Keyes 1998, SIAM J. Numer. Anal. 35, 508]. Where a law has
    several steady states it is the one that a start-up leads to; where it has none, or the flow
    runs away, the values are not finite or far off.

    `dynamics`: the fluid; of elements in series only slip acts. `rates`: of the tool, in 1/s, shape
    (n,); zero is rest. `flow`: which flow has these rates; None is simple shear.
    """

    def one(rate):
        stress, levels, felt = _approach(dynamics, rate, flow)
        scale = dynamics.combined("modulus_factor", levels)
        return scale * dynamics.recorded(stress, flow), felt

    return jax.vmap(one)(rates)


def steady_state(
    dynamics: Dynamics, fixed: Dynamics, rate: Float[Array, ""], flow: Kinematics | None
) -> Float[Array, "s k"]:
    """Return the dimensionless modes in one steady flow, as `steady_states` reaches it.

    Not finite where none is reached. Derivatives are those of the implicit function: none passes
    through the steps.

    `dynamics`: the fluid; no state changes with it, and nothing gives way in series. `fixed`: the
    same, through which no derivative passes.
    """
    reached, _, _ = jax.lax.stop_gradient(_approach(fixed, rate, flow))
    return newton_step(lambda stress: dynamics.change(stress, rate, 1.0, flow), reached)


def _approach(dynamics: Dynamics, rate, flow):
    """Return modes and states of the fluid in steady flow, and the rate that it feels."""
    modes = dynamics.modes
    stress, levels = dynamics.rest()
    intensity = 1.0 if flow is None else flow.intensity
    weissenberg = intensity * jnp.abs(rate) * modes.relaxation_time
    scalars = dynamics.variables - 4 * dynamics.tensors

    def changes(levels, felt):
        slow = dynamics.combined("time_factor", levels)
        return lambda state: dynamics.change(state, felt, slow, flow)

    def step(now: _Way) -> _Way:
        index, way, levels, felt = now.index, now.way, now.levels, now.felt
        change = changes(levels, felt)
        way = approach_step(change, way, index, weissenberg, scalars)
        sheared, sheared_rate = dynamics.sheared(way.stress, felt, flow)
        sheared = dynamics.combined("modulus_factor", levels) * sheared
        levels = tuple(
            _steady_level(effect, values, sheared_rate, sheared)
            for effect, values in dynamics.states.items()
        )
        if dynamics.series is not None:
            # σ/γ̇ changes more slowly than σ: the iteration converges however strong the slip
            viscosity = dynamics.viscosity + sheared / jnp.where(felt == 0.0, 1.0, felt)
            felt = rate / (1.0 + dynamics.series.slip * viscosity)
        beside = [(now.felt, felt), *zip(now.levels, levels, strict=True)]
        moving = moves(now.way, way, weissenberg, beside)
        return _Way(index + 1.0, way, levels, felt, moving)

    start = _Way(
        jnp.zeros(()),
        approach(stress),
        levels,
        jnp.asarray(rate, dtype=stress.dtype),
        jnp.asarray(True),
    )
    end = jax.lax.while_loop(lambda now: now.moving & (now.index < MOST_STEPS), step, start)
    way, levels, felt = end.way, end.levels, end.felt
    return arrived(changes(levels, felt), way, weissenberg), levels, felt


def _steady_level(effect, values, rate, stress):
    source, decay = effect.source_and_decay(values, rate, stress)
    return source / decay
