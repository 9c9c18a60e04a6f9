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
    """What an estimator was fitted to; it stays with a saved one, which holds no data.

    Attributes
    ----------
    data
        Name of the data set; empty for a list of runs.
    runs
        Names of the runs.
    samples
        Number of samples in all.
    fingerprint
        Hash of times, rates and shear stresses.
    version
        Of this software.
    """

    data: str
    runs: tuple[str, ...]
    samples: int
    fingerprint: str
    version: str = __version__


def provenance_of(data: Any, runs: Sequence[Run]) -> Provenance:
    """Return the provenance of a fit to some runs.

    Parameters
    ----------
    data
        What the user gave: a data set, whose name is kept, or anything else.
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
