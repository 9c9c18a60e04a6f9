"""Newton's steps towards states that a flow keeps: periodic ones, and steady ones of modes."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.forward.dynamics import Dynamics
from discover.protocols.kinematics import Kinematics

FROM_REST = 2
"""Cycles from rest before Newton's steps."""

MOST, TOLERANCE = 40, 1e-7
"""Most iterations for a cycle, and the relative change that ends them."""

# A step that made things worse is tried again this much shorter; below the other, it is rounding
_SHORTER, _EXACT = 0.25, 1e-12

# Of a mode that relaxes over many cycles, a cycle tells so little that rounding moves the step
_STATE_ROUNDING = 1e-13

# Of a change beside the modes, what it may add to their misfit
_BESIDE = 10.0

# Five steps in a row that led astray: of sixty laws at six strengths none came round later than
# that, but for states at the very edge of those that there are
HOPELESS = 5e-4


Arrays = Array | np.ndarray


class Approximation(NamedTuple):
    """An approximation to the modes, and the best one of each that was tried.

    `stress`, `best`: dimensionless, σ and structure variables. `best_misfit`, `best_step`: what a
    cycle changes in the best one, relative, and Newton's step from it. Arrays are JAX's or NumPy's.
    """

    stress: Float[Any, "s k"]
    best: Float[Any, "s k"]
    best_misfit: Float[Any, " k"]
    best_step: Float[Any, "s k"]
    share: Float[Any, " k"]  # of that step that is taken
    number: Float[Any, ""]  # of cycles gone through


def first_approximation(stress: Float[Array, "s k"], number: int = 0) -> Approximation:
    """Return where the iteration begins, after so many cycles from rest."""
    free = jnp.full(stress.shape[1], jnp.inf)
    return Approximation(
        stress=stress,
        best=stress,
        best_misfit=free,
        best_step=jnp.zeros_like(stress),
        share=jnp.ones_like(free),
        number=jnp.asarray(float(number)),
    )


def next_approximation(
    now: Approximation,
    after: Float[Arrays, "s k"],
    jacobian: Float[Arrays, "k s s"],
    moved: Float[Arrays, "*k"] | float = 0.0,
) -> tuple[Approximation, Bool[Arrays, " k"]]:
    """Return the next approximation, and of which modes this one was better than all before.

    A step that leads astray is shortened   [modified Newton method: Stoer & Bulirsch 2002,
    Introduction to Numerical Analysis, section 5.4].

    `after`: what a cycle makes of the modes. `jacobian`: of that, for each mode: direction,
    component. `moved`: by how much something beside the modes has changed since, which puts them
    off. Arrays are JAX's or all NumPy's.
    """
    of: Any = np if isinstance(after, np.ndarray) else jnp
    difference = after - now.stress
    misfit = _size(difference) / (1.0 + _size(now.stress))
    begins = now.number <= FROM_REST
    # never where it is not a number
    better = (misfit <= now.best_misfit + _BESIDE * moved) | (misfit < _EXACT)
    better = better | (begins & of.isfinite(misfit))
    matrix = of.eye(len(after)) - jacobian.swapaxes(1, 2)
    if of is np:  # which refuses to divide by nothing
        matrix = np.where(np.linalg.det(matrix)[:, None, None] == 0.0, np.nan, matrix)
    step = of.linalg.solve(matrix, difference.T[:, :, None])[:, :, 0].T
    step = of.where(now.number < FROM_REST, difference, step)
    step = of.where(better, step, now.best_step)
    best = of.where(better, now.stress, now.best)
    share = of.where(better, 1.0, _SHORTER * now.share)
    following = Approximation(
        stress=best + share * step,
        best=best,
        best_misfit=of.where(better, misfit, now.best_misfit),
        best_step=step,
        share=share,
        number=now.number + 1.0,
    )
    return following, better


def goes_on(
    now: Approximation, change: Float[Array, ""], most: int, tolerance: float
) -> Bool[Array, ""]:
    """Return whether to go through another cycle."""
    begins = now.number <= FROM_REST
    hopeful = (now.number < most) & (jnp.min(now.share) > HOPELESS)
    return begins | (hopeful & ~(change < tolerance))


def relative_change(
    now: Approximation, following: Approximation, slowness: Float[Arrays, " k"], tolerance: float
) -> Float[Arrays, " k"]:
    """Return how far each mode moved, relative, but for what rounding moves of slow ones.

    `slowness`: relaxation time of each mode over that of a cycle. `tolerance`: ends the iteration.
    """
    told = 1.0 + _STATE_ROUNDING / tolerance * slowness
    moved = _size(following.stress - now.stress) / (1.0 + _size(now.stress))
    return moved / told


def _size(stress: Float[Arrays, "s k"]) -> Float[Arrays, " k"]:
    return abs(stress).max(axis=0)


class _Iterate(NamedTuple):
    """An approximation to the modes, and by how much they moved last."""

    modes: Approximation
    change: Float[Array, ""]


def periodic_start(
    after_cycle: Callable[[Float[Array, "s k"]], Float[Array, "s k"]],
    rest: Float[Array, "s k"],
    slowness: Float[Array, " k"],
    is_periodic: Bool[Array, ""],
) -> Float[Array, "s k"]:
    """Return modes that a whole cycle brings back; not a number where none are found.

    Solved for and not waited for, by Newton's steps along the components of each mode, which change
    nearly by themselves   [shooting: Stoer & Bulirsch 2002, Introduction to Numerical Analysis,
    section 7.3; `next_approximation`].

    `after_cycle`: from modes to what they are a cycle later. `slowness`: relaxation times, in
    cycles. `is_periodic`: where not, `rest` is returned.
    """

    def improved(now: _Iterate) -> _Iterate:
        def along(unit):
            direction = unit[:, None] * jnp.ones(rest.shape)
            return jax.jvp(after_cycle, (now.modes.stress,), (direction,))

        after, slopes = jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(rest)))
        jacobian = jnp.moveaxis(slopes, 2, 0)  # mode, direction, component
        modes, better = next_approximation(now.modes, after, jacobian)
        change = jnp.max(relative_change(now.modes, modes, slowness, TOLERANCE))
        change = jnp.where(is_periodic, jnp.where(jnp.all(better), change, jnp.inf), 0.0)
        return _Iterate(modes, change)

    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(0, FROM_REST, lambda _, stress: after_cycle(stress), rest)
    end = jax.lax.while_loop(
        lambda now: goes_on(now.modes, now.change, MOST, TOLERANCE),
        improved,
        _Iterate(first_approximation(begun, FROM_REST), jnp.asarray(jnp.inf)),
    )
    found = jnp.where(end.change < TOLERANCE, end.modes.stress, jnp.nan)
    return jnp.where(is_periodic, found, rest)


# A step that no chain could take (tr A = 3 + tr σ below zero) is taken again with the width of so
# many steps before, and widths then grow twice as fast until they have caught up. At most so often,
# so that there are steps left to arrive
_BACK, _MOST_AGAIN = 3.0, 80

# What may be left of the rate of change, of the largest there could be, and of what Newton's step
# would move every number, of itself. Where nothing is left, no step needs to be possible
_STILL, _NOTHING, _SMALL = 1e-3, 1e-9, 1e-3

# Of the stress over its modulus and the square of one plus the Weissenberg number, what no state
# reaches that is steady: 2 of a Maxwell fluid in shear. Where nothing relaxes steps end beyond 1e8
_GROWN = 1e6

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
    """Return the way after one step; where chains outgrow it, a linearly implicit one goes astray.

    `change`: rate of change of all modes. `scalars`: structure variables of no tensor, last in
    each.
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
    before: Approach, after: Approach, weissenberg_number: Float[Array, " k"]
) -> Bool[Array, ""]:
    """Return whether another step may change anything: one of Newton's did, or none was."""
    width = pseudo_time_step(before.number, weissenberg_number)
    newton = jnp.all((after.number >= before.number) & (width > _LONG))
    return ~(newton & are_still([(before.stress, after.stress)]))


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
    # of what grows for ever a change is nothing beside what has grown
    size = jnp.max(jnp.abs(stress[:4]), axis=0) / (1.0 + weissenberg_number) ** 2
    return jnp.where(still & _is_of_chains(stress) & (size < _GROWN), stress, jnp.nan)


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
    """Return modes after a linearly implicit Euler step; an infinite one is Newton's."""
    now, jacobian = _with_jacobian(change, stress)
    matrix = jnp.eye(len(stress)) / width[:, None, None] - jacobian
    return stress + _solved(matrix, now)


def newton_step(
    change: Callable[[Float[Array, "s k"]], Float[Array, "s k"]], stress: Float[Array, "s k"]
) -> Float[Array, "s k"]:
    """Return modes after Newton's step from where they are steady, as the implicit function."""
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


class _Way(NamedTuple):
    """A way towards a steady state, and the number of steps taken."""

    index: Float[Array, ""]
    way: Approach
    moving: Bool[Array, ""]


def steady_state(
    dynamics: Dynamics, fixed: Dynamics, rate: Float[Array, ""], flow: Kinematics | None
) -> Float[Array, "s k"]:
    """Return the dimensionless modes in one steady flow, with derivatives of the implicit function.

    Approached from rest by linearly implicit Euler steps in pseudo-time that grow until they are
    Newton's   [Kelley & Keyes 1998, SIAM J. Numer. Anal. 35, 508]: of several states the one that a
    start-up leads to. Not finite, or far off, where none is reached. `fixed`: the fluid once more,
    through which no derivative passes.
    """
    intensity = 1.0 if flow is None else flow.intensity
    weissenberg = intensity * jnp.abs(rate) * fixed.modes.relaxation_time
    scalars = fixed.variables - 4 * fixed.tensors

    def change(stress):
        return fixed.change(stress, rate, flow)

    def step(now: _Way) -> _Way:
        way = approach_step(change, now.way, now.index, weissenberg, scalars)
        return _Way(now.index + 1.0, way, moves(now.way, way, weissenberg))

    end = jax.lax.while_loop(
        lambda now: now.moving & (now.index < MOST_STEPS),
        step,
        _Way(jnp.zeros(()), approach(fixed.rest()), jnp.asarray(True)),
    )
    reached = jax.lax.stop_gradient(arrived(change, end.way, weissenberg))
    return newton_step(lambda stress: dynamics.change(stress, rate, flow), reached)
