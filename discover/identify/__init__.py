"""Which parts of a law shear data determine, what else would fit, and whether a law is sound."""

from discover.identify.side_by_side.histories import Difference
from discover.identify.soundness.physics import check_physics
from discover.identify.structure.hidden_stresses import HiddenStresses
from discover.identify.structure.structure import LawStructure, Structure, analyse_structure
from discover.identify.structure.twins import Twin, find_twins

__all__ = [
    "Difference",
    "HiddenStresses",
    "LawStructure",
    "Structure",
    "Twin",
    "analyse_structure",
    "check_physics",
    "find_twins",
]
