"""Functions of JAX as machine code that takes eight sets of numbers side by side."""

from discover.programs.lanes.arithmetic import LANES, Arithmetic
from discover.programs.lanes.machine_code import Writing, callable_of, kept
from discover.programs.lanes.translation import Translation

__all__ = [
    "LANES",
    "Arithmetic",
    "Translation",
    "Writing",
    "callable_of",
    "kept",
]
