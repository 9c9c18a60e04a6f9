"""A linear term of a law found is a declared constant in other words: checked against scipy."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus, UpperConvectedMaxwell, oscillation, start_up
from independent.instruments import Instrument

from discover.comparison.judging.declared_constants import (
    beside,
    other_constants,
    with_other_constants,
    with_other_gain,
)
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.identify.rivals.bands import PredictionBand
from discover.laws import make_law
from discover.laws.expansion import law_of_terms
from discover.learners import RecoveredTerm
from discover.study.declared_model import DeclaredModel

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
    law = law_of_terms([t.term for t in TERMS], [t.coefficient for t in TERMS], {}, True)
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


def test_where_relaxation_is_left_to_the_learner_its_term_is_no_wrong_time():
    elastic = law_of_terms([], [], {}, linear_relaxation=False)
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
