"""A linear term of a law found is a declared constant in other words: checked against scipy."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from discover.comparison.judging.constants.beside_other_constants import with_other_coefficients
from discover.comparison.judging.constants.declared_constants import (
    beside,
    other_constants,
    with_other_constants,
    with_other_gain,
)
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from independent import Giesekus, UpperConvectedMaxwell, oscillation, start_up
from independent.instruments import Instrument

from discover.laws import make_law
from discover.laws.expansion import law_of_terms
from discover.learners import RecoveredTerm
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

MODULUS, TIME, MOBILITY = 110.0, 1.0, 0.3
DECLARED_MODULUS, DECLARED_TIME = 100.0, 0.7
TIMES = np.linspace(0.05, 5.0, 40)


def found(*terms):
    return [RecoveredTerm(name, value, ci95=(value - 0.01, value + 0.01)) for name, value in terms]


def declared(moduli=(DECLARED_MODULUS,), times=(DECLARED_TIME,)):
    return DeclaredModel(make_law("ucm"), "ucm", {}, np.array(moduli), np.array(times), (), None)


# a Giesekus fluid in the units of the declaration
TERMS = found(
    ("sigma", DECLARED_TIME / TIME - 1.0),
    ("gammadot", 1.0 - MODULUS / DECLARED_MODULUS),
    ("sigma.sigma", MOBILITY * DECLARED_TIME / TIME * DECLARED_MODULUS / MODULUS),
)


def test_with_a_wrong_declaration_the_linear_terms_are_the_right_constants():
    law = law_of_terms(LawTerms.of(TERMS), True)
    truth = Giesekus(MOBILITY, MODULUS, TIME)
    generator = np.random.default_rng(0)
    for _ in range(3):
        half, gradient = generator.standard_normal((2, 3, 3))
        stress = half + half.T
        change = law.stress_rate(jnp.asarray(stress), jnp.asarray(DECLARED_TIME * gradient))
        np.testing.assert_allclose(  # rounding
            DECLARED_MODULUS / DECLARED_TIME * np.asarray(change),
            truth.stress_change(DECLARED_MODULUS * stress, gradient),
            rtol=1e-9,
        )
    others = {one.name: one for one in other_constants(TERMS, declared())}
    assert DECLARED_TIME * others["relaxation_time_s"].factor == pytest.approx(TIME)
    assert DECLARED_MODULUS * others["modulus_Pa"].factor == pytest.approx(MODULUS)
    for one in others.values():
        assert one.ci95[0] < one.factor < one.ci95[1]
    assert beside(TERMS, list(others.values())) == {"sigma.sigma": pytest.approx(MOBILITY)}


def test_statements_name_the_other_constant_and_say_that_data_cannot_tell():
    statements = with_other_constants([], TERMS, other_constants(TERMS, declared()), declared())
    assert [s.quantity for s in statements] == ["relaxation_time_s", "modulus_Pa"]
    assert all(s.undetermined and "these data cannot tell" in s.brief for s in statements)
    assert "a relaxation time of 1 s (95 % interval 0.9859 to 1.014)" in statements[0].brief
    assert "0.3 sigma.sigma" in statements[0].text
    assert "transducer that shows 1.1 times the stress" in statements[1].brief


@pytest.mark.parametrize("flow", [start_up(3.0), oscillation(2.0, 1.0)])
def test_a_shorter_time_is_told_as_the_wall_slip_that_leaves_the_same_stress(flow):
    slip = 2e-3
    c = slip * DECLARED_MODULUS * DECLARED_TIME
    behind = UpperConvectedMaxwell(DECLARED_MODULUS, DECLARED_TIME)
    shorter = UpperConvectedMaxwell(DECLARED_MODULUS, DECLARED_TIME / (1.0 + c))
    records = [
        instrument.record(fluid, flow, TIMES)
        for instrument, fluid in ((Instrument(slip=slip), behind), (Instrument(), shorter))
    ]
    # both integrated to 1e-8; N1 would tell the two apart
    np.testing.assert_allclose(records[0].stress, records[1].stress, rtol=1e-5, atol=1e-5)
    assert np.max(np.abs(records[0].N1 - records[1].N1)) > 1.0
    (one,) = other_constants(found(("sigma", c)), declared())
    assert f"wall slip of {slip:.4g} 1/(Pa s)" in one.text
    # a longer time is that of no wall, and of several modes each would have its own
    assert "slip" not in other_constants(found(("sigma", -c)), declared())[0].text
    several = declared((50.0, 20.0), (0.7, 7.0))
    assert "slip" not in other_constants(found(("sigma", c)), several)[0].text


def test_of_several_modes_it_is_a_factor_on_all():
    (one,) = other_constants(TERMS[:1], declared((50.0, 20.0), (0.7, 7.0)))
    assert "relaxation times that are all 1.429 times the declared ones" in one.text


@pytest.mark.parametrize(
    "terms",
    [
        found(("sigma.sigma", 0.3), ("tr(sigma)*sigma", -0.2)),
        found(("sigma", 0.005)),  # less than an experiment sees
        found(("sigma", -1.2)),  # no time is left
        [RecoveredTerm("gammadot", -0.43)],  # without an interval: other terms may replace it
    ],
)
def test_other_terms_are_no_other_constant(terms):
    assert other_constants(terms, declared()) == []


def test_a_small_linear_term_that_the_data_saw_is_another_constant_too():
    """A law with 0.006 γ̇ is one of a modulus 0.6 % smaller, which nobody knows so well."""
    seen = RecoveredTerm("gammadot", 0.006, ci95=(0.003, 0.009))
    (other,) = other_constants([seen], declared())
    assert other.name == "modulus_Pa"
    assert other.factor == pytest.approx(0.994)
    arithmetic = RecoveredTerm("gammadot", 1e-5, ci95=(0.9e-5, 1.1e-5))
    assert other_constants([arithmetic], declared()) == []


def test_where_relaxation_is_left_to_the_learner_its_term_is_no_wrong_time():
    elastic = law_of_terms(LawTerms(), linear_relaxation=False)
    model = replace(declared(), law=elastic)
    assert other_constants(found(("sigma", 1.0)), model) == []
    (one,) = other_constants(found(("sigma", 0.7)), model)
    assert one.factor == pytest.approx(1.0 / 0.7)


def test_the_band_holds_the_fluid_behind_a_transducer_of_that_gain():
    gain = 1.1
    truth = Giesekus(MOBILITY, 100.0, TIME).respond(start_up(3.0), TIMES)
    shown = gain * np.column_stack([truth.sigma12, truth.N1, truth.N2])
    edge = 0.005 * np.abs(shown)
    limits = shown - edge, shown + edge
    band = PredictionBand(TIMES, shown, *limits, *limits, runaways=0.0)
    others = other_constants(found(("gammadot", 1.0 - gain)), declared())
    wide = with_other_gain({"run": band}, others)["run"]
    for column, normal_stress in ((1, truth.N1), (2, truth.N2)):
        assert not np.any(np.abs(normal_stress - shown[:, column]) <= edge[:, column])
        assert np.all(wide.rivals_low[:, column] <= normal_stress)
        assert np.all(normal_stress <= wide.rivals_high[:, column])
    np.testing.assert_array_equal(wide.rivals_high[:, 0], band.rivals_high[:, 0])
    told = with_other_constants([Statement("N1", IN_LIBRARY, "Known.")], TERMS, others, declared())
    assert "N1 / 1.1" in told[0].text
    open_ = with_other_constants([Statement("N2", "no", "Open.")], TERMS, others, declared())
    assert open_[0].text == "Open."
    # a wrong time moves no stress
    of_time = other_constants(TERMS[:1], declared())
    assert with_other_gain({"run": band}, of_time) == {"run": band}


def sparse(terms, covariance=None):
    nothing = np.zeros(0)
    details = {"covariance": covariance}
    return {
        "tensor_sindy": LearnerOutcome("tensor_sindy", tuple(terms), 0.0, (nothing,) * 2, details)
    }


def test_an_interval_beside_a_wrong_declaration_holds_the_coefficient_of_the_fluid():
    others = other_constants(TERMS, declared())
    wide = with_other_coefficients(sparse(TERMS), others)["tensor_sindy"].terms
    by_name = {term.term: term for term in wide}
    square = by_name["sigma.sigma"]
    given = square.ci95_given_declared
    assert not given[0] <= MOBILITY <= given[1]
    assert square.ci95[0] <= MOBILITY <= square.ci95[1]
    # either alone may be the wrong one
    for factor in (others[0].factor, others[1].factor):
        assert square.ci95[0] <= square.coefficient * factor <= square.ci95[1]
    # what amounts to another constant is what it is
    assert by_name["sigma"] == TERMS[0]


def test_an_interval_beside_a_wrong_time_is_as_wide_as_both_errors_make_it():
    terms = found(("sigma", 0.1), ("sigma.sigma", 0.33))
    # α = k/(1 + c), of 100,000 draws by NumPy: errors that go together, and errors that go apart
    for correlation in (0.9, -0.9):
        covariance = 0.005**2 * np.array([[1.0, correlation], [correlation, 1.0]])
        others = other_constants(terms, declared())
        (_, square) = with_other_coefficients(sparse(terms, covariance), others)[
            "tensor_sindy"
        ].terms
        drawn = np.random.default_rng(0).multivariate_normal(
            [0.1, 0.33], covariance * (0.01 / 1.96 / 0.005) ** 2, 100_000
        )
        ends = np.quantile(drawn[:, 1] / (1.0 + drawn[:, 0]), [0.025, 0.975])
        assert square.ci95[0] == pytest.approx(ends[0], abs=2e-4)  # of the draws, and second order
        assert square.ci95[1] == terms[1].ci95[1]


def test_an_interval_beside_no_other_constant_stays():
    terms = found(("sigma.sigma", 0.3), ("sigma", 0.005))
    outcomes = sparse(terms)
    assert with_other_coefficients(outcomes, other_constants(terms, declared())) == outcomes


def test_a_wrong_modulus_moves_the_inner_constant_of_a_closed_form():
    # exp(ε tr σ/G): with a modulus f times as large, ε is f times as large
    form = RecoveredTerm(
        "(exp(epsilon*tr(sigma))-1)*sigma", 1.0, ci95=(0.99, 1.01), inner={"epsilon": 0.4},
        inner_ci95={"epsilon": (0.39, 0.41)}, inner_at_one={"epsilon": (0.4, 0.39, 0.41)},
    )  # fmt: skip
    terms = [form, *found(("gammadot", -0.1))]
    (one, _) = with_other_coefficients(sparse(terms), other_constants(terms, declared()))[
        "tensor_sindy"
    ].terms
    assert one.inner_ci95["epsilon"][0] == pytest.approx(0.39)
    assert one.inner_ci95["epsilon"][1] > 1.1 * 0.41
    assert one.inner_at_one["epsilon"][2] == one.inner_ci95["epsilon"][1]
    # its coefficient is of the first order in the stress
    assert one.ci95 == pytest.approx((0.99, 1.01))
