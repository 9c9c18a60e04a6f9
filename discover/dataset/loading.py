"""How much the loading of a sample may differ, as a factor on what is recorded of it."""

from dataclasses import dataclass

LARGEST = 0.1
"""Relative error of one run above which two do not differ by their loading: fillings and trimmings
of one sample differ by some per cent, and what differs by more, as a run told in minutes does, may
not excuse what a law leaves of all others."""


@dataclass(frozen=True)
class Loading:
    """By how much one loading of a sample may differ from another.

    Filling, trimming and temperature differ by some per cent, as a factor on every stress that is
    recorded of one loading.

    `deviation`: standard deviation of the factor.
    `noise`: relative noise of the record, where it is known.
    """

    deviation: float
    noise: float | None = None
