import jax.numpy as jnp
import numpy as np
import pytest
import sympy

import tensor_library as tl

LIBRARY = tl.build_library(degree=2, closed_forms=("exp", "saturating"))


def test_sizes_are_tensors_times_monomials_plus_closed_forms():
    assert len(tl.build_library()) == 8
    # seven invariants differ from zero in shear: 1 + 7 monomials up to degree one
    assert len(tl.build_library(degree=1)) == 8 * (1 + 7)
    assert len(LIBRARY) == 8 * (1 + 7 + 28) + 2
    assert len(tl.build_library(degree=1, invariants=tl.INVARIANT_NAMES)) == 8 * 9


def test_every_name_reads_back_to_its_term():
    assert [tl.parse_term(name) for name in LIBRARY.names] == list(LIBRARY.terms)


@pytest.mark.parametrize(
    "name",
    [
        "sigma",
        "sigma.sigma",
        "sigma.gammadot+gammadot.sigma",
        "tr(sigma)*sigma",
        "tr(sigma.gammadot)*I",
        "(exp(epsilon*tr(sigma))-1)*sigma",
    ],
)
def test_the_contract_s_spellings_are_canonical(name):
    assert tl.parse_term(name).name == name


@pytest.mark.parametrize(
    "name", ["", "sigma*tr(sigma)", "__import__('os')", "tr(sigma)*", "tr(x)*sigma", "Sigma"]
)
def test_other_text_is_refused_and_never_evaluated(name):
    with pytest.raises(ValueError, match="Cannot read the term"):
        tl.parse_term(name)


def test_library_evaluation_equals_term_by_term():
    stress = jnp.array([1.2, -0.3, 0.2, 0.6])
    rate = tl.rate_of_deformation(jnp.array(1.7))
    inner = jnp.array([0.4, 0.3])
    together = LIBRARY.evaluate(stress, rate, inner)
    named = {"epsilon": inner[0], "kappa": inner[1]}
    alone = jnp.stack([term.evaluate(stress, rate, named) for term in LIBRARY.terms])
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_sympy_s_own_printers_know_our_trace():
    """A notebook shows expressions with them."""
    expression = tl.parse_term("tr(sigma)^2*gammadot").sympy()
    assert r"\operatorname{tr}\left(\sigma\right)^{2}" in sympy.latex(expression)
    assert "tr (σ)" in sympy.pretty(expression, use_unicode=True)


def test_complexity_orders_simple_before_involved():
    names = ["sigma", "sigma.sigma", "tr(sigma)*sigma.sigma", "(exp(epsilon*tr(sigma))-1)*sigma"]
    sizes = [tl.parse_term(name).complexity for name in names]
    assert sizes == sorted(sizes)
    assert sizes[0] < sizes[1] < sizes[2]


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


def test_a_library_takes_further_terms_once():
    names = tl.build_library(extra=["tr(sigma)*sigma", "sigma"]).names
    assert list(names) == [*tl.build_library().names, "tr(sigma)*sigma"]
