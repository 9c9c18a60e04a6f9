"""Runs without the samples that stand alone in them: a knock, a spark, a lost bit."""

import numpy as np

from discover.dataset.run import Run
from discover.statistics.noise.outliers import isolated


def without_spikes(run: Run) -> tuple[Run, list[float]]:
    """Return a run without the samples that stand alone in it, and their times in s.

    By the record alone (`isolated`): no law is asked, so whatever is fitted then has no part in it.
    """
    off = isolated(run.recorded)
    if not np.any(off):
        return run, []
    return run.window(~off), [float(t) for t in run.time[off]]
