"""Exact arithmetic on library terms: relations in shear, series, twins; sums in a sentence."""

from fractions import Fraction
from itertools import islice

import jax.numpy as jnp
import numpy as np
import pytest

from discover.identify.exact_series import (
    ExactNotation,
    same_shear_stress,
    solve_for_coefficient,
    stress_series,
)
from discover.identify.relations import feels_33, spell_briefly, term_relations
from discover.laws import Fluid, Giesekus
from discover.protocols import measured_rate
from discover.simulate import simulate
from tensor_library import TermLibrary, build_library, parse_term
from tensor_library.law_terms import spell

SLIP = "sigma.gammadot+gammadot.sigma"
CUBIC = (
    "tr(gammadot.gammadot)*(sigma.gammadot+gammadot.sigma)",
    "tr(sigma.gammadot.gammadot)*gammadot",
    "tr(sigma.gammadot)*gammadot.gammadot",
)


def library_of(*names):
    return TermLibrary(tuple(parse_term(name) for name in names))


def test_exact_terms_are_those_of_the_library():
    library = build_library(degree=2)
    state, rate = (3, -2, 5, 7), 4
    exact = [term.spell(ExactNotation(state, rate)) for term in library.terms]
    floating = library.evaluate(jnp.array(state, float), jnp.array([0.0, 0.0, 0.0, rate]))
    # whole numbers below 2^53: both are exact
    assert np.array_equal(np.array(exact, float), np.asarray(floating))


def test_the_eight_tensors_are_independent_in_shear():
    assert term_relations(build_library()) == ()


def test_relations_of_degree_one_are_the_cayley_hamilton_one_and_two_on_33():
    found = term_relations(build_library(degree=1, closed_forms=("exp",)))
    assert {frozenset(r.coefficients): r.touches for r in found} == {
        frozenset(CUBIC): "nothing",
        frozenset({"gammadot.gammadot", "tr(gammadot.gammadot)*I"}): "33",
        frozenset(
            {
                "sigma.gammadot.gammadot+gammadot.gammadot.sigma",
                "tr(gammadot.gammadot)*sigma",
            }
        ): "33",
    }


def test_every_relation_holds_in_floating_point_at_fresh_states():
    library = build_library(degree=2, invariants=["tr(sigma)", "tr(gammadot.gammadot)"])
    generator = np.random.default_rng(7)
    found = term_relations(library)
    assert found
    states = [
        (jnp.asarray(generator.normal(size=4)), jnp.array([0, 0, 0, generator.normal()]))
        for _ in range(3)
    ]
    values = [np.asarray(library.evaluate(*state)) for state in states]
    for relation in found:
        rows = [library.names.index(name) for name in relation.coefficients]
        factors = np.array(list(relation.coefficients.values()), float)
        for terms in values:
            total = factors @ terms[rows]
            scale = np.max(np.abs(factors[:, None] * terms[rows])) + 1.0
            seen = [0, 1, 2, 3] if relation.touches == "nothing" else [0, 1, 3]
            assert np.max(np.abs(total[seen])) < 1e-12 * scale  # rounding


def test_what_feels_33_is_what_holds_a_trace_of_stress():
    assert feels_33(library_of("tr(sigma)*sigma"))
    assert feels_33(library_of("(exp(epsilon*tr(sigma))-1)*sigma"))
    assert not feels_33(library_of("sigma.sigma", SLIP, "tr(sigma.gammadot)*I"))


def test_the_series_of_a_law_is_its_trajectory_at_small_times():
    rate = [Fraction(1), Fraction(-1, 2)]
    series = islice(stress_series({"sigma.sigma": Fraction(1, 5)}, rate), 10)
    times = np.array([0.0, 0.1, 0.2])
    powers = times[:, None] ** np.arange(10)
    expected = powers @ [[float(one.coeff(1)) for one in stress] for stress in series]
    flow = measured_rate([0.0, 0.2], [1.0, 0.9])  # 1 − t/2
    found = simulate(Fluid.dimensionless(Giesekus(0.2)), flow, times)
    # 0.2^10 is 1e-7, times coefficients below one: truncation; and the solver's tolerance
    np.testing.assert_allclose(found.components, expected, atol=2e-8)


@pytest.mark.parametrize("slip", [Fraction(1, 5), Fraction(2, 5), Fraction(7, 5)])
def test_johnson_segalman_and_its_twin_agree_exactly_but_for_n2(slip):
    twin = {"tr(sigma)*gammadot": slip * (1 - slip / 2)}
    assert same_shear_stress({SLIP: slip / 2}, twin)
    rate = [Fraction(2, 3), Fraction(-5, 7), Fraction(1, 4)]
    both = (stress_series(law, rate) for law in ({SLIP: slip / 2}, twin))
    for k, (a, b) in enumerate(islice(zip(*both, strict=True), 9)):
        assert a[0] - a[1] == b[0] - b[1]
        assert (a[1] - a[2] == b[1] - b[2]) == (k < 2)


def test_a_wrong_coefficient_or_another_law_is_no_twin():
    # negative controls
    assert not same_shear_stress({SLIP: Fraction(1, 5)}, {"tr(sigma)*gammadot": Fraction(1, 3)})
    assert not same_shear_stress({}, {"sigma.sigma": Fraction(1, 5)})
    assert solve_for_coefficient({"sigma.sigma": Fraction(1, 5)}, "tr(sigma)*sigma") == []


def test_both_slips_with_the_same_shear_stress_are_solved_for():
    # ξ(1 − ξ/2) = 8/25 has the roots ξ = 2/5 and 8/5
    found = solve_for_coefficient({"tr(sigma)*gammadot": Fraction(8, 25)}, SLIP)
    assert found == [(0.2, True), (0.8, True)]


def test_an_irrational_twin_is_given_but_not_called_proved():
    # ξ(1 − ξ/2) = 3/10 has ξ = 1 − √(2/5)
    found = solve_for_coefficient({"tr(sigma)*gammadot": Fraction(3, 10)}, SLIP)
    value, proved = found[0]
    assert value == pytest.approx(0.5 - np.sqrt(0.1), rel=1e-12)
    assert not proved


def test_a_sum_of_few_terms_is_spelled_out():
    few = {"sigma.sigma": 0.5, "gammadot": -1.0}
    assert spell_briefly(few) == spell(few) == "0.5 sigma.sigma − gammadot"


def test_a_sum_of_many_terms_is_its_largest_two_and_a_number():
    names = ("I", "sigma", "gammadot", "sigma.sigma", "gammadot.gammadot", "tr(sigma)*sigma")
    many = {name: (-1.0) ** i * 0.1 * i for i, name in enumerate(names)}
    said = spell_briefly(many)
    assert said == "−0.5 tr(sigma)*sigma + 0.4 gammadot.gammadot with 4 smaller terms"
