"""Predictions of many vectors of parameters at once, in machine code made from laws and effects."""

from discover.forward.side_by_side.code import code_of
from discover.forward.side_by_side.kernel import Kernel
from discover.forward.side_by_side.periodic import PeriodicSideBySide
from discover.forward.side_by_side.periodic_code import PeriodicCode
from discover.forward.side_by_side.steady import SteadySideBySide
from discover.forward.side_by_side.steady_code import SteadyCode
from discover.forward.side_by_side.stress import StressSideBySide
from discover.forward.side_by_side.stress_code import StressCode
from discover.forward.side_by_side.transients import SideBySide, intervals

__all__ = [
    "Kernel",
    "PeriodicCode",
    "PeriodicSideBySide",
    "SideBySide",
    "SteadyCode",
    "SteadySideBySide",
    "StressCode",
    "StressSideBySide",
    "code_of",
    "intervals",
]
