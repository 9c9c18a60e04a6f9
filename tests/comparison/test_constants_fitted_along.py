"""Constants fitted along with a learner: without them the law bends, with them it is found."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.instrument import FittedAlong, corrected
from discover.comparison.outcomes.constant import in_words
from planted_instrument import MOBILITY, oscillations

from discover.effects import known_effects
from discover.errors import InputError
from discover.learners.tensor_sindy import TensorSINDy
from discover.study.data import StudyData
from discover.study.in_memory import declared_fluid
from tensor_library.library import build_library

LIBRARY = build_library()
KNOWN_GAIN = {"stress_gain": {"gain_error": -0.1}}


def divided(data):
    return StudyData(data, data, data.select([]))


def sparse(model, data, library):
    learner = TensorSINDy(
        library=library,
        modulus=model.modulus,
        relaxation_time=model.relaxation_time,
        max_terms=2,
        n_stability=0,
        n_folds=0,
    ).fit(list(data.fit))
    return learner.result_, learner.fluid_


def learned(data, effects=None, free=()):
    declared = declared_fluid(None, data)
    declared = replace(declared, effects=known_effects(effects or {}), free=free)
    return FittedAlong(declared, divided(data), LIBRARY).learn(sparse)


@pytest.fixture(scope="module")
def weak():
    """A transducer that reads ten per cent too little."""
    return oscillations(gain=0.9)


@pytest.mark.slow
def test_without_the_gain_the_law_bends(weak):
    result, _ = sparse(declared_fluid(None, weak), divided(weak), LIBRARY)
    low, high = next(t.ci95 for t in result.terms if t.term == "sigma.sigma")
    assert len(result.terms) > 1
    assert not low <= MOBILITY <= high


@pytest.fixture(scope="module")
def with_gain(weak):
    return learned(weak, {"stress_gain": "fit"})


@pytest.mark.slow
def test_with_the_gain_fitted_along_the_law_is_found_and_the_gain_too(with_gain):
    (term,) = with_gain.result.terms
    assert term.term == "sigma.sigma"
    assert term.ci95[0] <= MOBILITY <= term.ci95[1]
    gain = with_gain.constants["stress_gain.gain_error"]
    assert gain.ci95[0] <= -0.1 <= gain.ci95[1]
    # an interval that held everything would prove nothing: 1 % noise on 324 samples tells it well
    assert gain.ci95[1] - gain.ci95[0] < 0.02
    assert with_gain.settled


@pytest.mark.slow
def test_the_interval_of_a_coefficient_allows_for_the_constant(weak, with_gain):
    held = replace(declared_fluid(None, weak), effects=known_effects(KNOWN_GAIN))
    data, _ = corrected(divided(weak), held.effects)
    given, _ = sparse(held, data, LIBRARY)
    (wide,), (narrow,) = ([np.ptp(t.ci95) for t in r.terms] for r in (with_gain.result, given))
    # mobility and gain both lower the stress, so that to know one halves the doubt of the other
    assert wide > 1.3 * narrow


@pytest.mark.slow
def test_a_gain_is_not_found_where_there_is_none():
    found = learned(oscillations(gain=1.0), {"stress_gain": "fit"})
    gain = found.constants["stress_gain.gain_error"]
    assert gain.ci95[0] <= 0.0 <= gain.ci95[1]
    assert [term.term for term in found.result.terms] == ["sigma.sigma"]


@pytest.mark.slow
def test_a_factor_on_the_modulus_does_as_well_as_a_gain(weak):
    found = learned(weak, free=("modulus_Pa",))
    modulus = found.constants["modulus_Pa"]
    assert modulus.unit == "Pa"
    assert modulus.ci95[0] <= 0.9 <= modulus.ci95[1]


@pytest.mark.slow
def test_two_constants_that_do_the_same_are_refused(weak):
    with pytest.raises(InputError, match="cannot tell modulus_Pa from the other constants"):
        learned(weak, {"stress_gain": "fit"}, free=("modulus_Pa",))


def test_a_constant_of_one_mode_is_a_modulus_and_of_several_a_factor():
    assert in_words("modulus_Pa", one_mode=True) == "modulus"
    assert in_words("modulus_Pa", one_mode=False) == "factor on all moduli"
    assert in_words("relaxation_time_s", one_mode=True) == "relaxation time"
    # an effect's constant is named by its effect, however many modes there are
    assert in_words("stress_gain.gain_error", one_mode=False) == "stress gain (gain error)"
