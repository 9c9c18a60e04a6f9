"""Predictions of many vectors of parameters at once, in machine code made from laws and effects."""

from discover.forward.side_by_side.kernel import kernel_of
from discover.forward.side_by_side.transients import SideBySide

__all__ = ["SideBySide", "kernel_of"]
