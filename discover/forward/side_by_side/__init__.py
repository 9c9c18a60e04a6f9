"""Predictions of many vectors of parameters at once, in machine code made from laws and effects."""

from discover.forward.side_by_side.code import code_of
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.predictors import Asked, MadeOnce
from discover.forward.side_by_side.steady import SteadyCode, SteadySideBySide
from discover.forward.side_by_side.stress import StressCode, StressSideBySide
from discover.forward.side_by_side.transients import PeriodicSideBySide, SideBySide

__all__ = [
    "Asked",
    "Kernel",
    "MadeOnce",
    "PeriodicSideBySide",
    "SideBySide",
    "SteadyCode",
    "SteadySideBySide",
    "StressCode",
    "StressSideBySide",
    "code_of",
]
