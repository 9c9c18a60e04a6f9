"""Runs made one after another on one sample, which remembers."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run


def total_strain(run: Run) -> float:
    """Return the strain of a run, added up without regard to its sign."""
    size = np.abs(run.rate)
    # before its first sample a run flows at the rate of that sample
    early = float(size[0] * run.time[0])
    return early + float(np.trapezoid(size, run.time))


def in_sequence(runs: Sequence[Run], order: Float[np.ndarray, " runs"]) -> tuple[Run, ...]:
    """Return the runs with the strain that their sample had seen in earlier ones.

    Only strains are added up: what a held-out run did to the sample is known without its stress.

    `order`: start times, or any numbers in the order of the runs; runs of equal number are
    parallel.
    """
    totals = np.array([total_strain(run) for run in runs])
    return tuple(
        replace(run, strain_before=float(np.sum(totals[order < at])))
        for run, at in zip(runs, order, strict=True)
    )
