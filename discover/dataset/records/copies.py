"""One record under two names: it is one measurement, and proves nothing of itself."""

from collections.abc import Sequence

import numpy as np

from discover.dataset.run import Run
from discover.errors import InputError
from discover.statistics.projection import rms
from discover.statistics.residual import fast_part

_FEWEST = 8  # samples at the same times; of fewer, equal digits may be chance

_ROUNDED = 0.1
"""Of what changes from sample to sample: two records of one test differ by √2 of it, one record
written with other digits by far less."""


def is_copy(one: Run, other: Run) -> bool:
    """Return whether two runs are one record, but for its name, its digits and samples left out.

    `one`, `other`: runs, whatever is told of their rates.
    """
    if one.quantity != other.quantity or one.flow != other.flow:
        return False
    fewer, more = sorted((one, other), key=len)
    if len(fewer) < _FEWEST:
        return len(one) == len(other) and _equal(one, other)
    at = np.clip(np.searchsorted(more.time, fewer.time), 0, len(more) - 1)
    at = np.where(
        np.abs(more.time[at - 1] - fewer.time) < np.abs(more.time[at] - fewer.time), at - 1, at
    )
    close = np.abs(more.time[at] - fewer.time) <= 1e-6 * max(float(fewer.time[-1]), 1e-300)
    if np.mean(close) < 0.9 or np.count_nonzero(close) < _FEWEST:
        return False
    known, found = fewer.recorded[close], more.recorded[at[close]]
    if not np.any(known):
        return False
    off = rms(known - found)
    return off <= _ROUNDED * fast_part(known)


def require_no_copies(fitted: Sequence[Run], held_out: Sequence[Run]) -> None:
    """Refuse to judge by a record that is fitted under another name.

    Among fitted runs a copy makes intervals a little too narrow, of which a check of the folder
    warns.

    Raises InputError that names both.
    """
    for run in held_out:
        copied = next((other.name for other in fitted if is_copy(run, other)), None)
        if copied is not None:
            raise InputError(
                f"The held-out run {run.name!r} holds the same samples as the fitted run "
                f"{copied!r}, so it proves nothing. Hold out another, or none."
            )


def _equal(one: Run, other: Run) -> bool:
    return np.array_equal(one.time, other.time) and np.array_equal(one.recorded, other.recorded)
