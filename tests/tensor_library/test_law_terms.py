"""One type of a term of a law, and one of a sum of terms."""

import ast
import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from discover.equations import Equation, equation_from_json, equation_to_json
from discover.learners import RecoveredTerm
from tensor_library import LawTerm, LawTerms, build_library

ROOT = Path(__file__).parents[2]
EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
SATURATING = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
LIBRARY = build_library(degree=0, closed_forms=("exp", "saturating"))
FOUND = RecoveredTerm(
    EXPONENTIAL, 0.97, {"epsilon": 0.31}, (0.9, 1.04), coefficient_penalised=0.9, latex="h",
    inner_ci95={"epsilon": (0.3, 0.32)}, inner_at_one={"epsilon": (0.3, 0.29, 0.31)},
)  # fmt: skip
DECLARED = LawTerm("sigma.sigma", 0.2)


def test_no_other_class_holds_inner_parameters_by_name():
    holders = {
        part.name
        for package in ("discover", "tensor_library")
        for path in (ROOT / package).rglob("*.py")
        for part in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(part, ast.ClassDef)
        for one in part.body
        if _annotation(one).startswith(("Mapping[str, float]", "dict[str, float]"))
    }
    # the last is the schema of a file, which becomes a `LawTerm`
    assert holders == {"LawTerm", "LawTerms", "_Term"}


def _annotation(node):
    """Return how a class says what its `inner` is; empty where the node says nothing of it."""
    if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == "inner":
        return ast.unparse(node.annotation)
    is_property = isinstance(node, ast.FunctionDef) and node.name == "inner" and node.returns
    return ast.unparse(node.returns) if is_property else ""


@pytest.mark.parametrize("term", [DECLARED, FOUND, FOUND.in_law], ids=["law", "found", "in law"])
def test_a_term_comes_back_from_json_as_it_was(term):
    again = type(term).from_json(json.loads(json.dumps(term.to_json())))
    assert again == term
    assert all(type(getattr(again, f.name)) is type(getattr(term, f.name)) for f in fields(term))


def test_a_recovered_term_is_written_in_the_order_of_the_contract_and_whole():
    keys = list(FOUND.to_json())
    assert keys[:5] == ["term", "coefficient", "coefficient_penalised", "ci95", "inner"]
    assert set(keys) == {one.name for one in fields(FOUND)}
    assert list(DECLARED.to_json()) == ["term", "coefficient", "inner"]


def test_an_equation_keeps_of_a_recovered_term_what_a_law_has():
    equation = Equation((DECLARED, FOUND.in_law))
    written = equation_to_json(equation)
    assert [list(one) for one in written["terms"]] == [["term", "coefficient", "inner", "ci95"]] * 2
    assert equation_from_json(json.loads(json.dumps(written))) == equation


def test_a_term_is_kept_in_its_canonical_spelling_with_the_defaults_put_in():
    assert LawTerm("tr(sigma) * tr(sigma)*sigma", 0.1).term == "tr(sigma)^2*sigma"
    assert LawTerm(EXPONENTIAL, 1.0).inner == {"epsilon": 0.25}
    for term in (LawTerm, RecoveredTerm):
        with pytest.raises(ValueError, match="no inner parameter 'kappa'; it has epsilon"):
            term(EXPONENTIAL, 1.0, {"kappa": 0.1})
        with pytest.raises(ValueError, match="Cannot read the term"):
            term("sigma.stress", 1.0)


def test_a_sum_orders_inner_parameters_as_a_library_does():
    law = LawTerms.of([LawTerm(SATURATING, 0.2, {"kappa": 0.1}), FOUND])
    assert list(law.inner) == list(LIBRARY.inner_names)
    assert law.values.tolist() == [0.2, 0.97, 0.31, 0.1]
    coefficients, inner = law.over(LIBRARY)
    assert inner.tolist() == [0.31, 0.1]
    assert {LIBRARY.names[i]: coefficients[i] for i in np.flatnonzero(coefficients)} == {
        SATURATING: 0.2,
        EXPONENTIAL: 0.97,
    }
    assert law.at(law.values) == law
    assert LawTerms.of(law.terms) == law
    assert LawTerms.from_json(json.loads(json.dumps(law.to_json()))) == law


def test_a_sum_has_each_term_once_and_one_value_of_an_inner_parameter():
    with pytest.raises(ValueError, match="stands there twice"):
        LawTerms.of([DECLARED, DECLARED])
    linear = EXPONENTIAL.replace("*sigma", "*gammadot")
    with pytest.raises(ValueError, match="epsilon has two values"):
        LawTerms.of([FOUND, LawTerm(linear, 1.0, {"epsilon": 0.1})])
