"""The state in which a run begins whose oscillation had gone on for ever."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from discover.forward.starts.modified_newton import (
    FROM_REST,
    Approximation,
    first_approximation,
    goes_on,
    next_approximation,
    relative_change,
)

# Most iterations in all, and the relative change below which the next step would change nothing
# that is seen: Newton's error goes as its square
MOST, TOLERANCE = 40, 1e-7

Levels = tuple[Float[Array, "..."], ...]


class Cycle(NamedTuple):
    """The steps of the last cycle before the first sample; none of a run that is not periodic.

    `start`, `end`: positions of its first and last step ends.
    """

    start: Int[Array, ""]
    end: Int[Array, ""]
    steps: int  # the most that a run of the batch has in it, at least ``end − start``


class _Iterate(NamedTuple):
    """An approximation to modes and states, and by how much these and both together moved last."""

    modes: Approximation
    levels: Levels
    moved: Float[Array, ""]
    change: Float[Array, ""]


def periodic_start(
    after_cycle: Callable,
    rest: tuple[Float[Array, "s k"], Levels],
    slowness: Float[Array, " k"],
    is_periodic: Bool[Array, ""],
) -> tuple[Float[Array, "s k"], Levels]:
    """Return modes and states that a cycle brings back; not a number where none is found.

    It is solved for and not waited for: a mode that relaxes over a thousand cycles takes no more
    steps than another. Newton's steps take the derivative of the cycle along the components of
    each mode, and along each state, which change nearly by themselves   [shooting: Stoer & Bulirsch
    2002, Introduction to Numerical Analysis, section 7.3; `next_approximation`].

    `after_cycle`: from modes, shape (s, k), and states to what they are a cycle later. `rest`:
    modes and states at rest, from which the iteration begins. `slowness`: relaxation time of each
    mode, in cycles. `is_periodic`: where not, rest is returned.
    """

    def with_derivative(stress, levels):
        def along(stress_direction, level_directions):
            (stress_end, levels_end), (stress_slope, level_slopes) = jax.jvp(
                after_cycle, (stress, levels), (stress_direction, level_directions)
            )
            return stress_end, levels_end, stress_slope, level_slopes

        own = len(stress)
        unit = jnp.eye(own + len(levels))
        directions = unit[:, :own, None] * jnp.ones((1, *stress.shape))
        of_levels = tuple(
            jnp.multiply.outer(unit[:, own + i], jnp.ones_like(level))
            for i, level in enumerate(levels)
        )
        ends, levels_ends, slopes, level_slopes = jax.vmap(along)(directions, of_levels)
        jacobian = jnp.moveaxis(slopes[:own], 2, 0)  # mode, direction, component
        of_own = tuple(slope[own + i] for i, slope in enumerate(level_slopes))
        return ends[0], tuple(level[0] for level in levels_ends), jacobian, of_own

    def improved(now: _Iterate) -> _Iterate:
        after, levels_after, jacobian, own = with_derivative(now.modes.stress, now.levels)
        modes, better = next_approximation(now.modes, after, jacobian, now.moved)
        levels = tuple(
            before + (end - before) / (1.0 - slope)
            for before, end, slope in zip(now.levels, levels_after, own, strict=True)
        )
        moves = [jnp.max(jnp.abs(a - b)) for a, b in zip(levels, now.levels, strict=True)]
        moved = jnp.max(jnp.stack([jnp.zeros(()), *moves]))
        largest = jnp.maximum(moved, relative_change(now.modes, modes, slowness, TOLERANCE))
        change = jnp.where(is_periodic, jnp.where(jnp.all(better), largest, jnp.inf), 0.0)
        return _Iterate(modes, levels, moved, change)

    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(0, FROM_REST, lambda _, state: after_cycle(*state), rest)
    never = jnp.asarray(jnp.inf)
    start = _Iterate(first_approximation(begun[0], FROM_REST), begun[1], jnp.zeros(()), never)
    end = jax.lax.while_loop(
        lambda now: goes_on(now.modes, now.change, MOST, TOLERANCE), improved, start
    )
    found = jnp.where(end.change < TOLERANCE, end.modes.stress, jnp.nan)
    stress, levels = rest
    levels = tuple(jnp.where(is_periodic, a, b) for a, b in zip(end.levels, levels, strict=True))
    return jnp.where(is_periodic, found, stress), levels
