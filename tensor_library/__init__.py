"""Tensor mathematics of constitutive laws: basis, invariants, candidate terms, libraries."""

from tensor_library.algebra import (
    INVARIANT_NAMES,
    TENSOR_NAMES,
    anticommutator,
    identity_like,
    inner,
    integrity_basis,
    rate_of_deformation,
    scalar_invariants,
    square,
    trace,
    upper_convected_production,
)
from tensor_library.closed_forms import CLOSED_FORMS, ClosedForm, register_closed_form
from tensor_library.law_terms import LawTerm, LawTerms
from tensor_library.library import TermLibrary, build_library
from tensor_library.terms import CandidateTerm, parse_term

__all__ = [
    "CLOSED_FORMS", "INVARIANT_NAMES", "TENSOR_NAMES", "CandidateTerm", "ClosedForm", "LawTerm",
    "LawTerms", "TermLibrary", "anticommutator", "build_library", "identity_like", "inner",
    "integrity_basis", "parse_term", "rate_of_deformation", "register_closed_form",
    "scalar_invariants", "square", "trace", "upper_convected_production",
]  # fmt: skip
