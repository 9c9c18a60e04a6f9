"""Which parts of a law shear data determine, what else would fit, and whether a law is sound."""

from discover.identify.exact.exact_series import Agreement, compare_series, stress_series
from discover.identify.exact.relations import TermRelation, term_relations
from discover.identify.rivals.evidence import Evidence, compare_residuals
from discover.identify.rivals.fitted_rivals import FittedRival, RivalTable, find_rivals
from discover.identify.side_by_side.histories import Difference, differences, random_histories
from discover.identify.side_by_side.separation import Separation, separations
from discover.identify.soundness.physics import PhysicsCheck, PhysicsReport, check_physics
from discover.identify.structure.hidden_stresses import HiddenStresses, hidden_stresses
from discover.identify.structure.structure import (
    LawStructure,
    QuantityVerdict,
    Structure,
    analyse_structure,
)
from discover.identify.structure.twins import Twin, find_twins

__all__ = [
    "Agreement",
    "Difference",
    "Evidence",
    "FittedRival",
    "HiddenStresses",
    "LawStructure",
    "PhysicsCheck",
    "PhysicsReport",
    "QuantityVerdict",
    "RivalTable",
    "Separation",
    "Structure",
    "TermRelation",
    "Twin",
    "analyse_structure",
    "check_physics",
    "compare_residuals",
    "compare_series",
    "differences",
    "find_rivals",
    "find_twins",
    "hidden_stresses",
    "random_histories",
    "separations",
    "stress_series",
    "term_relations",
]
