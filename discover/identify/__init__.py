"""Which parts of a law shear data determine, what else would fit, and whether a law is sound."""

from discover.identify.physics import check_physics
from discover.identify.side_by_side import Difference
from discover.identify.structure import Structure, analyse_structure
from discover.identify.twins import HiddenStresses, Twin, find_twins

__all__ = [
    "Difference", "HiddenStresses", "Structure", "Twin",
    "analyse_structure", "check_physics", "find_twins",
]  # fmt: skip
