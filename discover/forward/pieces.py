"""Steps of a grid that are followed in pieces: which they are, and when the rest is not taken.

Where the commanded rate runs straight between two samples, steps in a row become the pieces of one
step, and only its end is recorded. Once a state is steady at a rate that is felt as constant, what
is left of the step changes nothing: that only code that follows the fluid can tell.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from discover.dataset import Run
from discover.protocols.protocol import shear_rates

# Steps in a row that are pieces of fewer: how many at least, into how many of one length they go,
# how far their widths may differ for rounding, and rates from a straight line
_MANY_IN_A_ROW, _SHARES, _ALIKE, _STRAIGHT = 8, 4, 1e-6, 1e-10

FEWEST, STEADY = 8, 1e-9
"""Pieces of a step from which on it may end early, and by how much a state may then still change
until its end: nothing that is seen, as a steady state comes nearer with every piece."""


def in_pieces(
    grid: Float[np.ndarray, " s"], index: Int[np.ndarray, " n"], run: Run
) -> tuple[Float[np.ndarray, " m"], Int[np.ndarray, " n"], Int[np.ndarray, " pieces"]]:
    """Return steps of which several in a row of a grid are pieces, and where samples stand.

    Those are of one length, between two samples, and the commanded rate is a straight line in them.
    The pieces of a step double in number, for it may begin with a jump, up to a share of them all.
    """
    if len(grid) < _MANY_IN_A_ROW:
        return grid, index, np.ones(len(grid) - 1, np.int64)
    width, rate = np.diff(grid), shear_rates(run.protocol, grid)
    in_a_row = np.abs(np.diff(width)) <= _ALIKE * width[1:]
    bend = np.abs(rate[2:] - 2.0 * rate[1:-1] + rate[:-2])
    in_a_row &= bend <= _STRAIGHT * (np.abs(rate[2:]) + np.abs(rate[:-2]))
    in_a_row = np.concatenate([[False], in_a_row, [False]])
    in_a_row[index] = False
    for step in run.rate_steps:  # one that is fitted is no straight line
        in_a_row[(grid >= step.start) & (grid <= step.end)] = False
    ends = np.flatnonzero(~in_a_row)
    kept = ~in_a_row
    for first, end in pairwise(ends):
        if end - first < _MANY_IN_A_ROW:
            kept[first:end] = True
            continue
        place, most = first, (end - first) // _SHARES
        while place < end:
            kept[place] = True
            place += min(max(place - first, 1), most)
    places = np.flatnonzero(kept)
    return grid[places], np.searchsorted(places, index), np.diff(places)
