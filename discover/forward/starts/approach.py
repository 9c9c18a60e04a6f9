"""The way to a steady state, in steps of pseudo-time that grow until they are Newton's."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

# A step that no chain could take (tr A = 3 + tr σ below zero) is taken again with the width of so
# many steps before, and widths then grow twice as fast until they have caught up. At most so often,
# so that there are steps left to arrive
_BACK, _MOST_AGAIN = 3.0, 80

# What may be left of the rate of change, of the largest there could be, and of what Newton's step
# would move every number, of itself. Where nothing is left, no step needs to be possible
_STILL, _NOTHING, _SMALL = 1e-3, 1e-9, 1e-3

# By how much a step may move a structure variable. Of chains it is a logarithm, which runs away
# where it has turned nearly all to zero that should hold it
_MOST_MOVED = 1.0

# Widths of steps, from a fraction of the fastest time of the flow to where a step is Newton's
_WIDTHS = 60
_FIRST, _LAST = 0.05, 1e8

MOST_STEPS = 240
"""So many are taken where chains stretch far, or nearly to their end; else some forty."""

# Width in relaxation times from which on a step is Newton's to a thousandth, and what it moves by
# rounding
_LONG, _ROUNDING = 1e3, 1e-13


class Approach(NamedTuple):
    """A way towards a steady state.

    `number`: of the next step of each mode, and how many were taken again, both of shape (k,).
    """

    stress: Float[Array, "s k"]  # of all modes
    number: Float[Array, " k"]
    again: Float[Array, " k"]  # see there


def approach(stress: Float[Array, "s k"]) -> Approach:
    """Return the way from modes at rest."""
    nothing = jnp.zeros(stress.shape[1], stress.dtype)
    return Approach(stress, nothing, nothing)


def approach_step(
    change: Callable[[Float[Array, "s k"]], Float[Array, "s k"]],
    way: Approach,
    index: Float[Array, ""],
    weissenberg_number: Float[Array, " k"],
    scalars: int,
) -> Approach:
    """Return the way after one step.

    Where chains grow faster than a step is long, a linearly implicit one goes the wrong way.

    `change`: rate of change of all modes. `index`: of the step. `weissenberg_number`: of each mode.
    `scalars`: how many structure variables that are no part of a tensor stand last in each mode.
    """
    width = pseudo_time_step(way.number, weissenberg_number)
    moved = linearly_implicit_step(change, way.stress, width)
    if scalars:
        before = way.stress[-scalars:]
        near = jnp.clip(moved[-scalars:], before - _MOST_MOVED, before + _MOST_MOVED)
        moved = moved.at[-scalars:].set(near)
    possible = jnp.all(jnp.isfinite(moved), axis=0) & _is_of_chains(moved)
    taken = possible | (way.again >= _MOST_AGAIN)
    onward = jnp.minimum(way.number + 2.0, jnp.minimum(index + 1.0, float(_WIDTHS)))
    return Approach(
        jnp.where(taken, moved, way.stress),
        jnp.where(taken, onward, jnp.maximum(way.number - _BACK, 0.0)),
        way.again + jnp.where(taken, 0.0, 1.0),
    )


def moves(
    before: Approach,
    after: Approach,
    weissenberg_number: Float[Array, " k"],
    beside: Sequence[tuple[Array, Array]] = (),
) -> Bool[Array, ""]:
    """Return whether another step may change anything: one of Newton's from here did, or none was.

    A step that is taken again moves nothing either.

    `before`, `after`: the way at the beginning and at the end of a step. `weissenberg_number`: of
    each mode. `beside`: what else is on the way, before and after the step.
    """
    width = pseudo_time_step(before.number, weissenberg_number)
    newton = jnp.all((after.number >= before.number) & (width > _LONG))
    return ~(newton & are_still([(before.stress, after.stress), *beside]))


def are_still(pairs: Sequence[tuple[Array, Array]]) -> Bool[Array, ""]:
    """Return whether nothing changed by more than rounding, of pairs before and after a step."""
    still = [jnp.all(jnp.abs(b - a) <= _ROUNDING * (1.0 + jnp.abs(a))) for a, b in pairs]
    return jnp.all(jnp.stack(still))


def arrived(
    change: Callable[[Float[Array, "s k"]], Float[Array, "s k"]],
    way: Approach,
    weissenberg_number: Float[Array, " k"],
) -> Float[Array, "s k"]:
    """Return the modes where the way ends; not finite where that is no steady state of chains.

    A law may have a state of rest that no flow reaches: of FENE-P, springs of no strength.
    """
    stress = way.stress
    now, jacobian = _with_jacobian(change, stress)
    left = jnp.max(jnp.abs(now), axis=0)
    # of a structure variable nothing says how large it should be
    most = (1.0 + weissenberg_number) * (1.0 + jnp.max(jnp.abs(stress[:4]), axis=0))
    # a stress that is small beside N1 may be far from steady where all is still by that measure
    moved = jnp.abs(_solved(-jacobian, now)) <= _STILL * (_SMALL + jnp.abs(stress))
    still = (left <= _STILL * most) & (jnp.all(moved, axis=0) | (left <= _NOTHING * most))
    return jnp.where(still & _is_of_chains(stress), stress, jnp.nan)


def _is_of_chains(stress):
    return jnp.sum(stress[:3], axis=0) > -3.0


def pseudo_time_step(
    number: Float[Array, " k"], weissenberg_number: Float[Array, " k"]
) -> Float[Array, " k"]:
    """Return the width of a step of each mode, in its relaxation times.

    `number`: of the step of each mode, from 0 on. `weissenberg_number`: rate of the flow times the
    relaxation time of each mode.
    """
    first = _FIRST / (1.0 + weissenberg_number)
    return first * (_LAST / first) ** (number / (_WIDTHS - 1))


def linearly_implicit_step(
    change: Callable[[Float[Array, "s k"]], Float[Array, "s k"]],
    stress: Float[Array, "s k"],
    width: Float[Array, " k"],
) -> Float[Array, "s k"]:
    """Return modes after one linearly implicit Euler step; an infinite one is Newton's.

    `change`: rate of change of all modes, each of which changes by itself. `stress`: where the step
    begins. `width`: of the step, in the unit of time of each mode.
    """
    now, jacobian = _with_jacobian(change, stress)
    matrix = jnp.eye(len(stress)) / width[:, None, None] - jacobian
    return stress + _solved(matrix, now)


def newton_step(
    change: Callable[[Float[Array, "s k"]], Float[Array, "s k"]], stress: Float[Array, "s k"]
) -> Float[Array, "s k"]:
    """Return modes after a step of Newton's method from where they are steady.

    It moves them by nothing, and by what the change depends on as the implicit function does.
    """
    now, jacobian = _with_jacobian(change, stress)
    return stress + _solved(jax.lax.stop_gradient(-jacobian), now)


def _with_jacobian(change, stress):
    """Return the change, and of each mode its derivative, shape (k, s, s)."""
    now, tangent = jax.linearize(change, stress)
    # each mode changes by itself: as many directions as it has numbers give every tangent
    unit = jnp.eye(len(stress))[:, :, None] * jnp.ones(stress.shape)
    return now, jnp.transpose(jax.vmap(tangent)(unit), (2, 1, 0))


def _solved(matrix: Float[Array, "k s s"], change: Float[Array, "s k"]) -> Float[Array, "s k"]:
    return jnp.linalg.solve(matrix, change.T[:, :, None])[:, :, 0].T
