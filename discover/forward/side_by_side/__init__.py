"""Predictions of many vectors of parameters at once, in machine code made from laws and effects."""

from discover.forward.side_by_side.kernel import kernel_of
from discover.forward.side_by_side.transients import SideBySide, intervals

__all__ = ["SideBySide", "intervals", "kernel_of"]
