"""One named law fitted to runs: its constants, their intervals, and how well it describes them."""

from discover.fitting.named_law import fit
from discover.fitting.named_law_fit import NamedLawFit

__all__ = ["NamedLawFit", "fit"]
