"""What is exact: relations of terms, and twins that are alike in shear; found and proved."""

from fractions import Fraction
from itertools import islice

import jax.numpy as jnp
import numpy as np
import pytest

from discover.identify import side_by_side
from discover.identify.exact_series import (
    ExactNotation,
    same_shear_stress,
    solve_for_coefficient,
    stress_series,
)
from discover.identify.relations import feels_33, spell_briefly, term_relations
from discover.identify.twins import find_twins, hidden_stresses
from discover.laws import (
    ExponentialPhanThienTanner,
    Fluid,
    Giesekus,
    JohnsonSegalman,
    LinearPhanThienTanner,
    UpperConvectedMaxwell,
)
from discover.protocols import measured_rate
from discover.simulate import simulate
from tensor_library import LawTerms, TermLibrary, build_library, parse_term
from tensor_library.law_terms import spell

SLIP = "sigma.gammadot+gammadot.sigma"
CUBIC = (
    "tr(gammadot.gammadot)*(sigma.gammadot+gammadot.sigma)",
    "tr(sigma.gammadot.gammadot)*gammadot",
    "tr(sigma.gammadot)*gammadot.gammadot",
)


PTT = "(exp(epsilon*tr(sigma))-1)*sigma"
# one library for the whole file: one compilation of each program
LIBRARY = build_library().extended(
    map(parse_term, ("tr(sigma)*sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I",
                     "tr(gammadot.gammadot)*I", PTT))
)  # fmt: skip


@pytest.fixture(scope="module")
def slip_twins():
    return find_twins(LIBRARY, LawTerms({SLIP: 0.2}))


def library_of(*names):
    return TermLibrary(tuple(parse_term(name) for name in names))


def test_exact_terms_are_those_of_the_library_and_eight_tensors_are_independent_in_shear():
    library = build_library(degree=2)
    state, rate = (3, -2, 5, 7), 4
    exact = [term.spell(ExactNotation(state, rate)) for term in library.terms]
    floating = library.evaluate(jnp.array(state, float), jnp.array([0.0, 0.0, 0.0, rate]))
    # whole numbers below 2^53: both are exact
    assert np.array_equal(np.array(exact, float), np.asarray(floating))
    assert term_relations(build_library()) == ()


def test_relations_of_degree_one_are_the_cayley_hamilton_one_and_two_on_33():
    found = term_relations(build_library(degree=1, closed_forms=("exp",)))
    assert {frozenset(r.coefficients): r.touches for r in found} == {
        frozenset(CUBIC): "nothing",
        frozenset({"gammadot.gammadot", "tr(gammadot.gammadot)*I"}): "33",
        frozenset(
            {"sigma.gammadot.gammadot+gammadot.gammadot.sigma", "tr(gammadot.gammadot)*sigma"}
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


def test_what_feels_33_holds_a_trace_of_stress_and_a_pair_on_it_is_a_twin(slip_twins):
    assert feels_33(library_of("tr(sigma)*sigma"))
    assert feels_33(library_of("(exp(epsilon*tr(sigma))-1)*sigma"))
    assert not feels_33(library_of("sigma.sigma", SLIP, "tr(sigma.gammadot)*I"))
    pair = next(t for t in slip_twins if "tr(gammadot.gammadot)*I" in t.law.coefficients)
    assert pair.proof == "relation"
    assert pair.keeps_N1
    assert pair.difference.N2 > 0.01


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


def test_both_slips_are_twins_an_irrational_one_is_not_proved_and_another_law_is_none():
    # negative controls
    assert not same_shear_stress({SLIP: Fraction(1, 5)}, {"tr(sigma)*gammadot": Fraction(1, 3)})
    assert not same_shear_stress({}, {"sigma.sigma": Fraction(1, 5)})
    assert solve_for_coefficient({"sigma.sigma": Fraction(1, 5)}, "tr(sigma)*sigma") == []
    # ξ(1 − ξ/2) = 8/25 has the roots ξ = 2/5 and 8/5
    found = solve_for_coefficient({"tr(sigma)*gammadot": Fraction(8, 25)}, SLIP)
    assert found == [(0.2, True), (0.8, True)]
    # ξ(1 − ξ/2) = 3/10 has ξ = 1 − √(2/5)
    found = solve_for_coefficient({"tr(sigma)*gammadot": Fraction(3, 10)}, SLIP)
    value, proved = found[0]
    assert value == pytest.approx(0.5 - np.sqrt(0.1), rel=1e-12)
    assert not proved


def test_a_sum_of_few_terms_is_spelled_out_and_of_many_the_largest_two_and_a_number():
    few = {"sigma.sigma": 0.5, "gammadot": -1.0}
    assert spell_briefly(few) == spell(few) == "0.5 sigma.sigma − gammadot"
    names = ("I", "sigma", "gammadot", "sigma.sigma", "gammadot.gammadot", "tr(sigma)*sigma")
    many = {name: (-1.0) ** i * 0.1 * i for i, name in enumerate(names)}
    said = spell_briefly(many)
    assert said == "−0.5 tr(sigma)*sigma + 0.4 gammadot.gammadot with 4 smaller terms"


@pytest.mark.slow
def test_both_twins_of_johnson_segalman_are_found_and_proved(slip_twins):
    single = {next(iter(t.law.coefficients)): t for t in slip_twins if t.proof == "series"}
    assert set(single) == {"tr(sigma)*gammadot", "tr(sigma.gammadot)*I"}
    for name, twin in single.items():
        assert twin.law.coefficients[name] == pytest.approx(0.32, abs=1e-12)
        assert twin.keeps_N1
        assert twin.difference.sigma12 < 1e-12  # a linear change commutes with Runge–Kutta steps
        assert pytest.approx(0.2, rel=1e-6) == twin.difference.N2  # N2 = −(ξ/2) N1 against none
        assert any(s.quantity == "N2" for s in twin.separated_by)
        assert any("extension" in s.flow for s in twin.separated_by)


def test_a_fitted_coefficient_has_its_twin_and_one_term_of_two_can_be_exchanged():
    found = find_twins(LIBRARY, LawTerms({SLIP: 0.199512}))
    twin = next(t for t in found if set(t.law.coefficients) == {"tr(sigma)*gammadot"})
    slip = 2 * 0.199512
    assert twin.law.coefficients["tr(sigma)*gammadot"] == pytest.approx(
        slip * (1 - slip / 2), abs=1e-5
    )  # the fraction nearest to the coefficient with a denominator up to 1e5
    assert twin.difference.sigma12 < side_by_side.SAME
    law = LawTerms({SLIP: 0.2, "gammadot.gammadot": 0.05})
    found = find_twins(LIBRARY, law)
    supports = [set(t.law.coefficients) for t in found]
    # the trace of the rate squared shifts σ33 only where σ33 is not felt
    assert {SLIP, "tr(gammadot.gammadot)*I"} in supports


@pytest.mark.parametrize("law", [{"tr(sigma)*sigma": 0.4}, {PTT: 1.0}])
def test_laws_that_feel_the_trace_have_no_small_twin(law):
    # negative control: σ33 acts back through tr σ, and no other term makes up for it
    assert find_twins(LIBRARY, LawTerms(law, {"epsilon": 0.25})) == []


def test_giesekus_is_no_twin_of_maxwell_at_any_mobility_worth_the_name():
    others = [LawTerms({"sigma.sigma": a}) for a in (0.001, 0.2)]
    apart = side_by_side.differences(
        side_by_side.stresses_in_histories(LIBRARY, [LawTerms({}), *others])
    )
    assert all(d.sigma12 > side_by_side.SAME for d in apart)
    assert apart[0].sigma12 < 0.1 * apart[1].sigma12
    assert not same_shear_stress({}, {"sigma.sigma": Fraction(1, 5)})


def test_a_law_that_runs_away_is_infinitely_far_and_one_from_itself_not_at_all():
    laws = [LawTerms({}), LawTerms({"tr(sigma)*sigma": -5.0})]
    (apart,) = side_by_side.differences(side_by_side.stresses_in_histories(LIBRARY, laws))
    assert apart.sigma12 == np.inf
    law = LawTerms({"sigma.sigma": 0.2})
    stresses = side_by_side.stresses_in_histories(LIBRARY, [law, law])
    assert side_by_side.separations(LIBRARY, [law, law], stresses) == [()]


@pytest.mark.parametrize(
    ("law", "unfelt", "silent"),
    [
        (UpperConvectedMaxwell(), [[1, 0, 0], [0, 0, 1]], {"N1", "N2"}),
        # σ12' holds −(ξ/2) σ11 + (1 − ξ/2) σ22 at ξ = 0.4, and both relax alike
        (JohnsonSegalman(0.4), [[0, 0, 1], [0.8, 0.2, 0]], {"N2"}),
        (Giesekus(0.2), [[0, 0, 1]], {"N2"}),
        # tr σ is felt, and σ22: what is left is a change of σ11 against σ33
        (LinearPhanThienTanner(0.4), [[1, 0, -1]], set()),
        (ExponentialPhanThienTanner(0.4), [[1, 0, -1]], set()),
    ],
    ids=["ucm", "slip", "giesekus", "ptt", "exponential ptt"],
)
def test_which_normal_stresses_never_reach_the_shear_stress(law, unfelt, silent):
    found = hidden_stresses(law)
    expected = np.array(unfelt, float)
    assert found.unfelt.shape == expected.shape
    # the same space: projecting the expected directions changes nothing
    np.testing.assert_allclose(
        expected @ found.unfelt.T @ found.unfelt, expected, atol=1e-7
    )  # an SVD's null space of rounding size
    assert {q for q in ("N1", "N2") if found.leaves_no_trace(q)} == silent
