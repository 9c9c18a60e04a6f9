"""What an estimator was fitted to."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discover._version import __version__
from discover.dataset.run import Run


@dataclass(frozen=True)
class Provenance:
    """What an estimator was fitted to; it stays with a saved one, which holds no data."""

    data: str  # name of the data set; empty for a list of runs
    runs: tuple[str, ...]  # names of the runs
    samples: int  # number of samples in all
    fingerprint: str  # hash of times, rates and shear stresses
    version: str = __version__  # of this software


def provenance_of(data: Any, runs: Sequence[Run]) -> Provenance:
    """Return the provenance of a fit to some runs.

    `data`: what the user gave: a data set, whose name is kept, or anything else.
    """
    return Provenance(
        str(getattr(data, "name", "")),
        tuple(run.name for run in runs),
        sum(len(run) for run in runs),
        fingerprint_of(runs),
    )


def fingerprint_of(runs: Sequence[Run]) -> str:
    """Return a hash of the samples of some runs, whatever their order."""
    digest = hashlib.sha256()
    for run in sorted(runs, key=lambda run: run.name):
        digest.update(f"{run.name}|{len(run)}|".encode())
        for values in (run.time, run.rate, run.recorded):
            digest.update(np.ascontiguousarray(values, dtype=float).tobytes())
    return digest.hexdigest()[:16]
