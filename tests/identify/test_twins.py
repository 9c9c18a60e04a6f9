"""Twins checked in random histories, and what would separate them."""

from fractions import Fraction

import numpy as np
import pytest

from discover.identify import side_by_side
from discover.identify.exact_series import same_shear_stress
from discover.identify.twins import find_twins, hidden_stresses
from discover.laws import (
    ExponentialPhanThienTanner,
    Giesekus,
    JohnsonSegalman,
    LinearPhanThienTanner,
    UpperConvectedMaxwell,
)
from tensor_library import LawTerms, build_library, parse_term

SLIP = "sigma.gammadot+gammadot.sigma"
PTT = "(exp(epsilon*tr(sigma))-1)*sigma"
# one library for the whole file: one compilation of each program
LIBRARY = build_library().extended(
    parse_term(name)
    for name in (
        "tr(sigma)*sigma",
        "tr(sigma)*gammadot",
        "tr(sigma.gammadot)*I",
        "tr(gammadot.gammadot)*I",
        PTT,
    )
)


@pytest.fixture(scope="module")
def slip_twins():
    return find_twins(LIBRARY, LawTerms({SLIP: 0.2}))


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


def test_a_pair_on_33_is_a_twin_of_a_law_that_does_not_feel_33(slip_twins):
    pair = next(t for t in slip_twins if "tr(gammadot.gammadot)*I" in t.law.coefficients)
    assert pair.proof == "relation"
    assert pair.keeps_N1
    assert pair.difference.N2 > 0.01


def test_a_fitted_coefficient_has_its_twin_too():
    found = find_twins(LIBRARY, LawTerms({SLIP: 0.199512}))
    twin = next(t for t in found if set(t.law.coefficients) == {"tr(sigma)*gammadot"})
    slip = 2 * 0.199512
    assert twin.law.coefficients["tr(sigma)*gammadot"] == pytest.approx(
        slip * (1 - slip / 2), abs=1e-5
    )  # the fraction nearest to the coefficient with a denominator up to 1e5
    assert twin.difference.sigma12 < side_by_side.SAME


def test_one_term_of_two_can_be_exchanged():
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


def test_a_law_that_runs_away_is_infinitely_far():
    laws = [LawTerms({}), LawTerms({"tr(sigma)*sigma": -5.0})]
    (apart,) = side_by_side.differences(side_by_side.stresses_in_histories(LIBRARY, laws))
    assert apart.sigma12 == np.inf


def test_what_separates_a_law_from_itself_is_nothing():
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
