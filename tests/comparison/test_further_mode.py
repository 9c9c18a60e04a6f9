"""Noise that is correlated, or a mode that is missing: closed forms of Maxwell modes."""

import numpy as np
import pytest
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.further_mode import clear_further_mode
from discover.comparison.judging.other_causes.misread_runs import readings_of, with_further_modes
from discover.comparison.outcomes.flows import Flow
from discover.statistics.reading.misread import CLEAR, misread
from scipy.optimize import least_squares
from scipy.signal import lfilter

from discover.laws.registry import make_law
from discover.protocols import oscillatory_shear, start_up
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

TIMES = np.linspace(0.1, 8.0, 80)
RATES = (0.3, 1.0, 3.0)
WAVE = 2.0


def stress(rate, modes):
    """σ12 of upper convected Maxwell modes in shear, which is linear: start-up, or rate cos t."""
    if rate != WAVE:
        return sum(g * t * rate * -np.expm1(-TIMES / t) for g, t in modes)
    return sum(
        g * t * rate / (1 + t**2) * (np.cos(TIMES) + t * np.sin(TIMES) - np.exp(-TIMES / t))
        for g, t in modes
    )


def fitted(modes, correlation, size, seed=0, told=None, rates=RATES):
    """Return the law of one mode, fitted or told, and runs with noise of first order."""
    lot, flows = np.random.default_rng(seed), []
    for rate in rates:
        exact = stress(rate, modes)
        steps = np.sqrt(1 - correlation**2) * lot.standard_normal(len(TIMES) + 200)
        noise = lfilter([1.0], [1.0, -correlation], steps)[200:]
        record = exact + size * np.sqrt(np.mean(exact**2)) * noise
        flow = start_up(rate) if rate != WAVE else oscillatory_shear(rate, 1.0)
        own = np.full(len(TIMES), rate)
        flows.append(Flow(f"{rate:g}", "training", flow, TIMES, own, {}, record))

    def left(logs):
        return np.concatenate(
            [
                (stress(f.rate[0], [np.exp(logs)]) - f.measured) / np.sqrt(np.mean(f.measured**2))
                for f in flows
            ]
        )

    best = told or np.exp(least_squares(left, np.log([100.0, 1.0])).x)
    free = () if told else ("modulus_Pa", "relaxation_time_s")
    modulus, time = np.array([best[0]]), np.array([best[1]])
    declared = DeclaredModel(make_law("ucm"), "ucm", {}, modulus, time, free, None)
    return MovedLaw(declared, LawTerms(), free), flows


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_second_mode_is_told_from_correlated_noise(seed):
    found = clear_further_mode(*fitted([(60.0, 3.0), (80.0, 0.4)], 0.0, 0.01, seed), Expectation())
    assert found is not None
    # of two modes it is the one or the other
    assert min(abs(np.log(found.time / one)) for one in (3.0, 0.4)) < np.log(1.5)


@pytest.mark.parametrize("correlation", [0.8, 0.95])
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))]
)
def test_correlated_noise_of_one_mode_is_no_second_one(correlation, seed):
    runs = fitted([(100.0, 1.0)], correlation, 0.03, seed)
    assert clear_further_mode(*runs, Expectation()) is None


def test_a_noise_that_is_given_may_hold_a_mode():
    runs = fitted([(60.0, 3.0), (80.0, 0.4)], 0.0, 0.01)
    assert clear_further_mode(*runs, Expectation(noise=0.05)) is None


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_a_small_mode_that_the_spectrum_lacks_is_told_and_none_where_none_is(seed):
    def asked(modes):
        law, flows = fitted(modes, 0.0, 0.01, seed, (100.0, 1.0), (*RATES, WAVE))
        found = misread(with_further_modes(readings_of(law, flows), law, flows))
        assert found is not None
        return found

    found = asked([(100.0, 1.0), (6.0, 0.1)])
    assert found.kind == "further_mode"
    assert found.probability < CLEAR
    assert 0.6 < found.sizes[0] * found.level / (0.06 * 0.1) < 1.5  # its viscosity
    assert asked([(100.0, 1.0)]).probability > CLEAR
