"""Step times of a run at a given stress: creep, recovery, oscillation of the stress."""

import numpy as np
from jaxtyping import Float
from scipy.optimize import isotonic_regression

from discover.errors import InputError
from discover.protocols.protocol import FlowProtocol

MAX_GRID_POINTS = 200_000
"""Of one run: more come of a wrong unit."""

# Steps of a jump, growth of those after it, steps between any two of these and of the samples,
# their strain in that of a run at a given rate. So creep of 9 modes over five decades in 60 samples
# errs by 2e-5 of the strain, that of a law with a solvent by as much
_JUMP_STEPS, _GROWTH, _STEPS_BETWEEN, _LONGER = 24, 0.3, 2, 2.0

# A stress jumps where it takes less than this share of the time from there to the next knot
_SUDDEN = 0.01

# A stress is constant while it changes by less than this share of the largest from sample to sample
_CONSTANT = 0.01


def stress_grid(
    protocol: FlowProtocol, times: Float[np.ndarray, " n"], strain_step: float = 0.25
) -> Float[np.ndarray, " s"]:
    """Return step times for a run at a given stress.

    Every sample and every kink of the imposed stress is a step, and there is one between any two
    samples. A jump, which takes a short time, is gone through in even steps, and what follows it
    in steps that grow with the time since. No step takes more than twice `strain_step` of the
    strain recorded.

    `protocol`: with the imposed stress as its table, and the strain recorded where there is a
    record. `times`: of the samples, shape (n,). `strain_step`: half of the largest strain of one
    step: the rate is solved for in its middle too.
    """
    begins, end = float(protocol.begins), float(times[-1])
    knots = np.asarray(protocol.table_times)
    levels = np.asarray(protocol.table_rates)
    # a record of thousands at one level has a knot at each sample, and no kink there
    slope = np.diff(levels) / np.diff(knots)
    bends = np.concatenate([[True], np.diff(slope) != 0.0, [True]]) if len(knots) > 1 else True
    knots_inside = knots[(knots >= begins) & (knots <= end) & bends]
    parts = [np.array([begins]), times, knots_inside]
    width = np.diff(knots)
    jumps = np.flatnonzero((width[:-1] < _SUDDEN * width[1:]) & (np.diff(levels)[:-1] != 0.0))
    for start, stop in zip(knots[jumps], knots[jumps + 1], strict=True):
        parts.append(np.linspace(start, stop, _JUMP_STEPS + 1))
        later = times[times > stop]
        if later.size:
            count = int(np.ceil(np.log((end - start) / (stop - start)) / np.log1p(_GROWTH)))
            parts.append(start + np.geomspace(stop - start, end - start, max(count, 2)))
    anchors = np.unique(np.concatenate(parts))
    anchors = anchors[(anchors >= begins) & (anchors <= end)]
    strain = np.zeros(1)
    moved = np.zeros(len(anchors) - 1)
    if protocol.table_strains is not None:
        strain = np.asarray(protocol.table_strains)
        moved = np.abs(np.diff(np.interp(anchors, knots, _without_noise(levels, strain))))
    # a smooth stress has knots between its samples, which are steps enough
    between = np.isin(anchors, np.setdiff1d(knots_inside, times)) & (anchors > 0.0)
    least = np.where(between[1:] | between[:-1], 1, _STEPS_BETWEEN)
    pieces = np.maximum(least, np.ceil(moved / (_LONGER * strain_step))).astype(int)
    if np.sum(pieces) > MAX_GRID_POINTS:
        raise InputError(
            f"A run at a given stress with {len(times)} samples and strains up to "
            f"{np.max(np.abs(strain)):g} would need {np.sum(pieces)} steps (at most "
            f"{MAX_GRID_POINTS}). Check the unit of the strain, or thin the run."
        )
    filled = [
        a + (b - a) * np.arange(n) / n
        for a, b, n in zip(anchors[:-1], anchors[1:], pieces, strict=True)
    ]
    return np.concatenate([*filled, anchors[-1:]])


def _without_noise(levels, strain) -> Float[np.ndarray, " n"]:
    """Return the strain as it goes one way where the stress is constant.

    Noise would be taken for flow: 1 % of a strain of 200 for ten steps from sample to sample.
    """
    changes = np.abs(np.diff(levels)) > _CONSTANT * np.max(np.abs(levels), initial=0.0)
    pieces = np.split(strain, np.flatnonzero(changes) + 1)
    return np.concatenate([_one_way(piece) if len(piece) > 2 else piece for piece in pieces])


def _one_way(strain) -> Float[np.ndarray, " n"]:
    ways = [isotonic_regression(strain, increasing=up).x for up in (True, False)]
    return min(ways, key=lambda way: float(np.sum((way - strain) ** 2)))
