"""Constitutive laws behind one interface."""

from discover.first_use import answer_calls  # first: it sets double precision
from discover.laws.base import AbstractConstitutiveLaw, NamedLaw
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, laws_table, make_law
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.laws.textbook.classical import (
    ExponentialPhanThienTanner,
    FenePeterlin,
    Giesekus,
    JohnsonSegalman,
    LinearPhanThienTanner,
    UpperConvectedMaxwell,
)

__all__ = [
    "LAWS", "AbstractConstitutiveLaw", "ExponentialPhanThienTanner", "FenePeterlin", "Fluid",
    "Giesekus", "JohnsonSegalman", "LibraryExpansion", "LinearPhanThienTanner", "NamedLaw",
    "TensorBasisNetwork", "UpperConvectedMaxwell", "laws_table", "make_law",
]  # fmt: skip

answer_calls(__name__, laws_table)
