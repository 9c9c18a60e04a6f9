"""Runs without the samples that stand alone in them: a knock, a spark, a lost bit."""

import numpy as np
from jaxtyping import Bool

from discover.dataset.run import Run
from discover.statistics.noise.outliers import isolated

_JUMP = 0.1  # share of the largest rate, or stress, that was imposed
_ABOVE_STEPS = 10.0  # times the median change between samples: a sine changes by more than a tenth


def beside_a_step(run: Run) -> Bool[np.ndarray, " n"]:
    """Return which samples are next to a step of what was imposed: rate or stress.

    What is answered there may be a peak of one sample, as where the next interval of a thixotropy
    test begins, and no knock.
    """
    imposed = run.stress if run.protocol.control == "stress" else run.rate
    change = np.abs(np.diff(imposed))
    if not len(change):
        return np.zeros(len(imposed), dtype=bool)
    steps = change > _JUMP * np.max(np.abs(imposed)) + _ABOVE_STEPS * np.median(change)
    return np.append(steps, False) | np.append(False, steps)


def without_spikes(run: Run) -> tuple[Run, list[float]]:
    """Return a run without the samples that stand alone in it, and their times in s.

    By the record alone (`isolated`): no law is asked, so whatever is fitted then has no part in it.
    """
    off = isolated(run.recorded) & ~beside_a_step(run)
    if not np.any(off):
        return run, []
    return run.window(~off), [float(t) for t in run.time[off]]
