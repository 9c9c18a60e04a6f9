"""The state in which a run begins whose oscillation had gone on for ever."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

# Cycles from rest before Newton's steps, most iterations in all, and the relative change below
# which the next step would change nothing that is seen: Newton's error goes as its square
_FROM_REST, _MOST, _TOLERANCE = 2, 40, 1e-7

# A step that made things worse is tried again this much shorter; below the other, it is rounding
_SHORTER, _EXACT = 0.25, 1e-12

# Of a mode that relaxes over many cycles, a cycle tells so little that rounding moves the step
_ROUNDING = 1e-13

Levels = tuple[Float[Array, ""], ...]


class Cycle(NamedTuple):
    """The steps of the last cycle before the first sample; none of a run that is not periodic.

    Attributes
    ----------
    start, end
        Positions of its first and last step ends.
    steps
        The most that a run of the batch has in it, at least ``end − start``.
    """

    start: Int[Array, ""]
    end: Int[Array, ""]
    steps: int


class _Iterate(NamedTuple):
    """An approximation to the state, and the best one of each mode that was tried."""

    stress: Float[Array, "4 k"]
    levels: Levels
    best: Float[Array, "4 k"]
    best_misfit: Float[Array, " k"]
    best_step: Float[Array, "4 k"]
    share: Float[Array, " k"]
    number: Float[Array, ""]
    change: Float[Array, ""]


def periodic_start(
    after_cycle: Callable,
    rest: tuple[Float[Array, "4 k"], Levels],
    slowness: Float[Array, " k"],
    is_periodic: Bool[Array, ""],
) -> tuple[Float[Array, "4 k"], Levels]:
    """Return modes and states that a cycle brings back; not a number where none is found.

    It is solved for and not waited for: a mode that relaxes over a thousand cycles takes no more
    steps than another. Newton's steps take the derivative of the cycle along the four components of
    each mode, and along each state, which change nearly by themselves; a step that leads astray is
    shortened   [shooting and the modified Newton method: Stoer & Bulirsch 2002, Introduction to
    Numerical Analysis, sections 7.3 and 5.4].

    Parameters
    ----------
    after_cycle
        From modes, shape (4, k), and states to what they are a cycle later.
    rest
        Modes and states at rest, from which the iteration begins.
    slowness
        Relaxation time of each mode, in cycles.
    is_periodic
        Where not, rest is returned.
    """

    def with_derivative(stress, levels):
        def along(stress_direction, level_directions):
            (stress_end, levels_end), (stress_slope, level_slopes) = jax.jvp(
                after_cycle, (stress, levels), (stress_direction, level_directions)
            )
            return stress_end, levels_end, stress_slope, level_slopes

        count = 4 + len(levels)
        unit = jnp.eye(count)
        directions = unit[:, :4, None] * jnp.ones((1, *stress.shape))
        of_levels = tuple(unit[:, 4 + i] for i in range(len(levels)))
        ends, levels_ends, slopes, level_slopes = jax.vmap(along)(directions, of_levels)
        jacobian = jnp.moveaxis(slopes[:4], 2, 0)  # mode, direction, component
        own = tuple(slope[4 + i] for i, slope in enumerate(level_slopes))
        return ends[0], tuple(level[0] for level in levels_ends), jacobian, own

    def improved(now: _Iterate) -> _Iterate:
        after, levels_after, jacobian, own = with_derivative(now.stress, now.levels)
        difference = after - now.stress
        misfit = _size(difference) / (1.0 + _size(now.stress))
        begins = now.number <= _FROM_REST
        # never where it is not a number
        better = (misfit <= now.best_misfit) | (misfit < _EXACT) | (begins & jnp.isfinite(misfit))
        matrix = jnp.eye(4) - jnp.swapaxes(jacobian, 1, 2)
        step = jnp.linalg.solve(matrix, difference.T[:, :, None])[:, :, 0].T
        step = jnp.where(now.number < _FROM_REST, difference, step)
        step = jnp.where(better, step, now.best_step)
        best = jnp.where(better, now.stress, now.best)
        share = jnp.where(better, 1.0, _SHORTER * now.share)
        stress = best + share * step
        levels = tuple(
            before + (end - before) / (1.0 - slope)
            for before, end, slope in zip(now.levels, levels_after, own, strict=True)
        )
        told = 1.0 + _ROUNDING / _TOLERANCE * slowness
        changes = [
            jnp.max(_size(stress - now.stress) / (1.0 + _size(now.stress)) / told),
            *(jnp.abs(a - b) for a, b in zip(levels, now.levels, strict=True)),
        ]
        largest = jnp.max(jnp.stack(changes))
        return _Iterate(
            stress=stress,
            levels=levels,
            best=best,
            best_misfit=jnp.where(better, misfit, now.best_misfit),
            best_step=step,
            share=share,
            number=now.number + 1.0,
            change=jnp.where(is_periodic, jnp.where(jnp.all(better), largest, jnp.inf), 0.0),
        )

    stress, levels = rest
    start = _Iterate(
        stress=stress,
        levels=levels,
        best=stress,
        best_misfit=jnp.full(stress.shape[1], jnp.inf),
        best_step=jnp.zeros_like(stress),
        share=jnp.ones(stress.shape[1]),
        number=jnp.zeros(()),
        change=jnp.asarray(jnp.inf),
    )
    end = jax.lax.while_loop(
        lambda now: (now.number < _MOST) & ~((now.number > _FROM_REST) & (now.change < _TOLERANCE)),
        improved,
        start,
    )
    found = jnp.where(end.change < _TOLERANCE, end.stress, jnp.nan)
    levels = tuple(jnp.where(is_periodic, a, b) for a, b in zip(end.levels, levels, strict=True))
    return jnp.where(is_periodic, found, stress), levels


def _size(stress: Float[Array, "4 k"]) -> Float[Array, " k"]:
    return jnp.max(jnp.abs(stress), axis=0)
