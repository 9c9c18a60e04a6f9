"""Errors of the runs that were fitted, and of those that were not."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ErrorPair:
    """Relative errors, mean over runs: on the fitted runs and on those held out, if any."""

    fit: float
    held_out: float | None
