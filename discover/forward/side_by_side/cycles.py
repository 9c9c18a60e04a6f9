"""The state in which runs begin whose oscillation had gone on for ever, for lanes.

Solved for as in `steady_states.periodic_start`, by differences: a cycle is followed from the
approximation, and from each component of all modes and each state moved a little.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float

from discover.forward.steady_states import (
    FROM_REST,
    HOPELESS,
    MOST,
    TOLERANCE,
    Approximation,
    next_approximation,
    relative_change,
)

# By how much a number is moved, of one and its size. All modes are moved by as much, that of the
# largest: what couples them would else show in those that are moved less
_MOVED = 1e-7

# Of the change before, up to which slopes found earlier serve on, and the change that ends
_FAST, _ENDS = 0.1, 1e-10

Levels = Float[np.ndarray, "runs levels lanes"]
Modes = Float[np.ndarray, "runs k s lanes"]
After = Callable[[Levels, Modes, Bool[np.ndarray, " runs"]], tuple[Levels, Modes]]


def periodic_starts(
    after: After,
    levels: Levels,
    modes: Modes,
    slowness: Float[np.ndarray, "runs k lanes"],
    effects: Sequence[slice],
    begins: Bool[np.ndarray, " runs"],
) -> tuple[Levels, Modes]:
    """Return states of the fluid and modes that a cycle brings back; modes not a number where none.

    `after`: what a cycle makes of them, of some of the runs. `levels`, `modes`: at rest.
    `slowness`: relaxation times, in cycles. `effects`: where the states of each effect stand, if
    some lane has any. `begins`: which runs are looked at.
    """
    runs, k, s, lanes = modes.shape

    def in_rows(of_modes: np.ndarray) -> np.ndarray:
        return np.moveaxis(of_modes, -2, 0).reshape(s, -1)

    for _ in range(FROM_REST):
        levels, modes = after(levels, modes, begins)
    row, free = in_rows(modes), np.ones(runs * k * lanes)
    now = Approximation(row, row, np.inf * free, 0.0 * row, free, float(FROM_REST))
    alive = np.repeat(begins[:, None], lanes, axis=1)
    shift, change = np.zeros(alive.shape), np.full(alive.shape, np.inf)
    stale, slopes = alive.copy(), np.zeros_like(levels)
    jacobian = np.zeros((runs, k, lanes, s, s))
    while np.any(alive):
        modes = np.moveaxis(now.stress.reshape(s, runs, k, lanes), 0, -2)
        some = np.any(alive, axis=1)
        end_levels, end = after(levels, modes, some)
        # slopes serve as long as they lead on fast   [the chord method]
        if np.any(told := np.any(stale & alive, axis=1)):
            width = _MOVED * (1.0 + np.max(np.abs(modes), axis=(1, 2)))
            for i in range(s):
                moved = modes.copy()
                moved[:, :, i] += width[:, None]
                tangent = (after(levels, moved, told)[1] - end) / width[:, None, None]
                tangent, which = np.moveaxis(tangent, 2, -1), (stale & alive)[:, None, :, None]
                jacobian[..., i, :] = np.where(which, tangent, jacobian[..., i, :])
            for own in effects:
                moved, by = levels.copy(), _MOVED * (1.0 + np.abs(levels[:, own]))
                moved[:, own] += by
                slope = (after(moved, modes, told)[0] - end_levels)[:, own] / by
                slopes[:, own] = np.where((stale & alive)[:, None], slope, slopes[:, own])
        put_off = np.broadcast_to(shift[:, None], (runs, k, lanes)).ravel()
        asked = np.where(some[:, None, None, None, None], jacobian, 0.0).reshape(-1, s, s)
        following, better = next_approximation(now, in_rows(end), asked, put_off)
        moved = relative_change(now, following, slowness.ravel(), _ENDS)
        moved = np.max(np.where(better, moved, np.inf).reshape(runs, k, lanes), axis=1)
        hopeful = np.min(following.share.reshape(runs, k, lanes), axis=1) > HOPELESS
        hopeful &= following.number < MOST
        going = np.broadcast_to(alive[:, None], (runs, k, lanes)).ravel()
        kept = [np.where(going, b, a) for a, b in zip(now[:5], following[:5], strict=True)]
        now = Approximation._make([*kept, following.number])
        # one that stays where it is, as of an effect that is absent, may be anywhere
        stays = end_levels == levels
        step = (end_levels - levels) / np.where(stays, 1.0, 1.0 - slopes)
        step = np.where(stays | ~alive[:, None], 0.0, step)
        levels = levels + step
        largest = np.max(np.abs(step), axis=1, initial=0.0)
        largest = np.where(np.isfinite(largest), largest, np.inf)
        shift = np.where(alive, largest, shift)
        moved = np.maximum(moved, largest)
        stale = ~(moved < _FAST * change)
        change = np.where(alive, moved, change)
        # what is no number goes on until there is no hope
        alive &= ~(change < _ENDS) & (hopeful | (following.number <= FROM_REST))
    modes = np.moveaxis(now.stress.reshape(s, runs, k, lanes), 0, -2)
    return levels, np.where((change < TOLERANCE)[:, None, None], modes, np.nan)
