"""The answer: a law that one can use, how good it is, where, and what to measure next."""

from discover.answer.answer import Answer, HasAnswer
from discover.answer.constant import Constant
from discover.answer.fields import QUANTITIES, TOLERANCE
from discover.answer.parts import ExpectedError, Mode, Range, Suspect
from discover.inference.posterior import Discrepancy

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
