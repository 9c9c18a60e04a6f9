"""Terms, libraries and sums of terms: names, orders, evaluation."""

import ast
import json
from dataclasses import fields
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import sympy

import tensor_library as tl
from discover.equations import Equation, equation_from_json, equation_to_json
from discover.learners import RecoveredTerm
from tensor_library import LawTerm, LawTerms, build_library
from tensor_library.sympy_notation import SympyNotation

LIBRARY = tl.build_library(degree=2, closed_forms=("exp", "saturating"))
# as the contract spells terms
CONTRACT = ("sigma", "sigma.sigma", "sigma.gammadot+gammadot.sigma", "tr(sigma)*sigma",
            "tr(sigma.gammadot)*I", "(exp(epsilon*tr(sigma))-1)*sigma")  # fmt: skip


def test_a_library_has_tensors_times_monomials_in_order_and_every_name_reads_back():
    assert len(tl.build_library()) == 8
    # seven invariants differ from zero in shear: 1 + 7 monomials up to degree one
    assert len(tl.build_library(degree=1)) == 8 * (1 + 7)
    assert len(LIBRARY) == 8 * (1 + 7 + 28) + 2
    assert len(tl.build_library(degree=1, invariants=tl.INVARIANT_NAMES)) == 8 * 9
    assert [tl.parse_term(name) for name in LIBRARY.names] == list(LIBRARY.terms)
    assert set(CONTRACT) <= set(LIBRARY.names)
    names = ["sigma", "sigma.sigma", "tr(sigma)*sigma.sigma", "(exp(epsilon*tr(sigma))-1)*sigma"]
    sizes = [tl.parse_term(name).complexity for name in names]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[1] < sizes[2]


@pytest.mark.parametrize(
    "name", ["", "sigma*tr(sigma)", "__import__('os')", "tr(sigma)*", "tr(x)*sigma", "Sigma"]
)
def test_other_text_is_refused_and_never_evaluated(name):
    with pytest.raises(ValueError, match="Cannot read the term"):
        tl.parse_term(name)


def test_sympy_s_own_printers_know_our_trace():
    """A notebook shows expressions with them."""
    expression = tl.parse_term("tr(sigma)^2*gammadot").spell(SympyNotation())
    assert r"\operatorname{tr}\left(\sigma\right)^{2}" in sympy.latex(expression)
    assert "tr (σ)" in sympy.pretty(expression, use_unicode=True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"degree": -1}, "degree"),
        ({"degree": 9}, "degree"),
        ({"tensors": ["tau"]}, "Unknown tensor 'tau'"),
        ({"invariants": ["det(sigma)"]}, "Unknown invariant"),
        ({"closed_forms": ["sin"]}, "Unknown closed form"),
    ],
)
def test_a_wrong_description_is_refused_with_what_was_wanted(arguments, message):
    with pytest.raises(ValueError, match=message):
        tl.build_library(**arguments)


def test_a_library_takes_terms_once_and_is_evaluated_term_by_term():
    names = tl.build_library(extra=["tr(sigma)*sigma", "sigma"]).names
    assert list(names) == [*tl.build_library().names, "tr(sigma)*sigma"]
    stress = jnp.array([1.2, -0.3, 0.2, 0.6])
    rate = tl.rate_of_deformation(jnp.array(1.7))
    inner = jnp.array([0.4, 0.3])
    together = LIBRARY.evaluate(stress, rate, inner)
    named = {"epsilon": inner[0], "kappa": inner[1]}
    alone = jnp.stack([term.evaluate(stress, rate, named) for term in LIBRARY.terms])
    np.testing.assert_allclose(together, alone, rtol=1e-12)


ROOT = Path(__file__).parents[2]
EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
SATURATING = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
OF_DEGREE_ZERO = build_library(degree=0, closed_forms=("exp", "saturating"))
FOUND = RecoveredTerm(
    EXPONENTIAL, 0.97, {"epsilon": 0.31}, (0.9, 1.04), coefficient_penalised=0.9, latex="h",
    inner_ci95={"epsilon": (0.3, 0.32)},
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


def test_a_recovered_term_is_written_whole_and_an_equation_keeps_what_a_law_has():
    keys = list(FOUND.to_json())
    assert keys[:5] == ["term", "coefficient", "coefficient_penalised", "ci95", "inner"]
    assert set(keys) == {one.name for one in fields(FOUND)}
    assert list(DECLARED.to_json()) == ["term", "coefficient", "inner"]
    equation = Equation((DECLARED, FOUND.in_law))
    written = equation_to_json(equation)
    assert [list(one) for one in written["terms"]] == [["term", "coefficient", "inner", "ci95"]] * 2
    assert equation_from_json(json.loads(json.dumps(written))) == equation


def test_terms_are_canonical_and_a_sum_has_each_once_and_one_value_of_a_parameter():
    assert LawTerm("tr(sigma) * tr(sigma)*sigma", 0.1).term == "tr(sigma)^2*sigma"
    assert LawTerm(EXPONENTIAL, 1.0).inner == {"epsilon": 0.25}
    for term in (LawTerm, RecoveredTerm):
        with pytest.raises(ValueError, match="no inner parameter 'kappa'; it has epsilon"):
            term(EXPONENTIAL, 1.0, {"kappa": 0.1})
        with pytest.raises(ValueError, match="Cannot read the term"):
            term("sigma.stress", 1.0)
    law = LawTerms.of([LawTerm(SATURATING, 0.2, {"kappa": 0.1}), FOUND])
    assert list(law.inner) == list(OF_DEGREE_ZERO.inner_names)
    coefficients, inner = law.over(OF_DEGREE_ZERO)
    assert inner.tolist() == [0.31, 0.1]
    assert {OF_DEGREE_ZERO.names[i]: coefficients[i] for i in np.flatnonzero(coefficients)} == {
        SATURATING: 0.2,
        EXPONENTIAL: 0.97,
    }
    assert LawTerms.of(law.terms) == law
    with pytest.raises(ValueError, match="stands there twice"):
        LawTerms.of([DECLARED, DECLARED])
    linear = EXPONENTIAL.replace("*sigma", "*gammadot")
    with pytest.raises(ValueError, match="epsilon has two values"):
        LawTerms.of([FOUND, LawTerm(linear, 1.0, {"epsilon": 0.1})])
