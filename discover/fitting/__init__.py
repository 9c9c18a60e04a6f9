"""One named law fitted to runs: its constants, their intervals, and how well it describes them."""

from discover.fitting.named_law import fit
from discover.fitting.named_law_fit import Constant, NamedLawFit

__all__ = ["Constant", "NamedLawFit", "fit"]
