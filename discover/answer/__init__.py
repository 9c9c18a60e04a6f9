"""The answer: a law that one can use, how good it is, where, and what to measure next."""

from discover.answer.answer import (
    QUANTITIES,
    TOLERANCE,
    Answer,
    Constant,
    Discrepancy,
    ExpectedError,
    HasAnswer,
    Mode,
    Range,
    Suspect,
)

__all__ = [
    "QUANTITIES",
    "TOLERANCE",
    "Answer",
    "Constant",
    "Discrepancy",
    "ExpectedError",
    "HasAnswer",
    "Mode",
    "Range",
    "Suspect",
]
