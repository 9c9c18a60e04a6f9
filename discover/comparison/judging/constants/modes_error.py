"""What the modes' own misfit of the sweep leaves open of a law that was found beside them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from discover.words import percent_of

_SHOWS = 0.1
"""An error of the modes below this share of what the law leaves hardly moves its constants."""


def left_open_by_modes(
    path: Sequence[Mapping[str, Any]],
    n_terms: int,
    misfit: float,
    linear_error: float,
    network: bool = False,
) -> str:
    """Return what is to be said of a law beside modes of a noisy sweep; empty for nothing.

    Intervals, bands and the choice of the terms allow for errors of the moduli as noise of the
    sweep makes them. A misfit of the modes that is no noise a term may stand for all the same.

    Parameters
    ----------
    path
        The best law of each size: ``size`` and relative ``misfit``.
    linear_error
        By which the modes miss the sweep, relative.
    network
        Whether there is a network beside it, whose members all have the modes that fit best.
    """
    if not n_terms or linear_error <= _SHOWS * misfit:
        return ""
    said = (
        f"The modes miss the sweep by {percent_of(linear_error)}, which intervals and bands of the "
        "sparse law allow for"
    )
    said += " and those of the network do not" if network else ""
    for row in sorted(path, key=lambda row: row["size"]):
        if not 0 < row["size"] < n_terms:
            continue
        apart = float(np.sqrt(max(row["misfit"] ** 2 - misfit**2, 0.0)))
        if apart <= linear_error:
            terms = "one term" if row["size"] == 1 else f"{row['size']} terms"
            return (
                f"{said}; the best law of {terms} fits worse by {percent_of(apart)} of the data, "
                "which their error may make up: these data cannot tell the two apart."
            )
    return f"{said}."
