"""Runs without the samples that stand alone in them: a knock, a spark, a lost bit."""

import numpy as np
from jaxtyping import Bool

from discover.dataset.run import Run
from discover.statistics.noise.outliers import isolated

_CORNER = 0.01  # share of the largest rate, or stress, that was imposed
_ABOVE_BENDS = 10.0  # times the median bend: a sine, or a rate that was measured, has none so sharp


def beside_a_step(run: Run) -> Bool[np.ndarray, " n"]:
    """Return which samples are next to a step or a corner of what was imposed: rate or stress.

    What is answered there may stand alone without a knock, as where the next interval of a
    thixotropy test begins, or the way down of a loop.
    """
    imposed = run.stress if run.protocol.control == "stress" else run.rate
    beside = np.zeros(len(imposed), dtype=bool)
    if len(imposed) < 3:
        return beside
    bends = np.abs(np.diff(imposed, 2))
    sharp = bends > _CORNER * np.max(np.abs(imposed)) + _ABOVE_BENDS * np.median(bends)
    for shift in range(3):
        beside[shift : shift + len(sharp)] |= sharp
    return beside


def without_spikes(run: Run) -> tuple[Run, list[float]]:
    """Return a run without the samples that stand alone in it, and their times in s.

    By the record alone (`isolated`): no law is asked, so whatever is fitted then has no part in it.
    """
    off = isolated(run.recorded) & ~beside_a_step(run)
    if not np.any(off):
        return run, []
    return run.window(~off), [float(t) for t in run.time[off]]
