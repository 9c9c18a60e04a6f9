"""A law that needs a filter of the instrument explains nothing: data by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.other_causes.late_answers import hold_against_late_answers
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import bands_of_predictions
from independent import Giesekus, start_up
from scipy.integrate import cumulative_trapezoid

from discover.protocols import start_up as protocol
from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.residual import Expectation

TIMES = np.linspace(0.1, 8.0, 80)
FINE = np.linspace(0.0, 9.0, 1801)
RATES = {"slow": 0.5, "fast": 2.0, "faster": 3.0, "held": 4.0}
ALPHAS = 0.3 + 1e-3 * np.random.default_rng(0).standard_normal(8)
EMPTY = (np.zeros(0), np.zeros(0))


@pytest.fixture(scope="module")
def drawn():
    """σ12 of fluids with an uncertain α on a fine grid, the one that made the data first."""
    return {
        name: np.array(
            [
                np.append(0.0, Giesekus(a, 100.0).respond(start_up(rate), FINE[1:]).sigma12)
                for a in (0.3, *ALPHAS)
            ]
        )
        for name, rate in RATES.items()
    }


def averaged(stress, width):
    """Means over a width about each time, of what there is of it."""
    total = np.append(0.0, cumulative_trapezoid(stress, FINE))
    low, high = np.maximum(TIMES - width / 2, 0.0), TIMES + width / 2
    return (np.interp(high, FINE, total) - np.interp(low, FINE, total)) / (high - low)


def judged(drawn, width, expectation=None, learners=("tensor_sindy",)):
    """Return what is said of α = 0.3 where records are means, of what noise is said to explain."""
    expectation = expectation or Expectation()
    lot = np.random.default_rng(1)
    flows, predictions, bands, residuals, records = [], {}, {}, [], []
    for name, rate in RATES.items():
        kind = "held_out" if name == "held" else "training"
        stresses = np.array([np.interp(TIMES, FINE, one) for one in drawn[name]])
        told = averaged(drawn[name][0], width) if width else stresses[0]
        record = told + 0.01 * np.sqrt(np.mean(told**2)) * lot.standard_normal(len(told))
        measured = record if kind == "training" else None
        rates = np.full(len(TIMES), rate)
        flow = Flow(name, kind, protocol(rate), TIMES, rates, {"sigma12": record}, measured)
        flows.append(flow)
        predictions[flow.key] = {"sigma12": stresses[0]}
        three = np.repeat(stresses[:, :, None], 3, axis=2)[:, None]
        bands[flow.key] = bands_of_predictions(three, [len(three)], [TIMES])[0]
        if kind == "training":
            residuals.append(stresses[0] - record)
            records.append(record)
    outcomes = {
        name: LearnerOutcome(name, (), 1.0, EMPTY, predictions=predictions) for name in learners
    }
    left = replace(what_is_left(residuals, records, expectation), verdict="explained")
    found = Explanation(dict.fromkeys(learners, left), expectation=expectation)
    return hold_against_late_answers(found, outcomes, flows, bands)


def test_means_over_half_a_second_are_no_explanation(drawn):
    found = judged(drawn, 0.5, learners=("tbnn_ude", "tensor_sindy"))
    # what one law needs a filter for, another has taken for the fluid's
    assert found.by == ()
    left = found.lack_of_fit["tensor_sindy"]
    assert "told means over 0.5" in left.reason
    assert "averaging of the instrument's software" in left.advice


def test_records_of_single_moments_are(drawn):
    assert judged(drawn, 0.0).verdict == "explained"


def test_noise_that_is_given_may_hold_anything(drawn):
    assert judged(drawn, 0.5, Expectation(noise=0.05)).verdict == "explained"
    assert judged(drawn, 0.5, Expectation(noise=0.005)).verdict == "unexplained"


def test_a_sweep_that_errs_as_much_excuses_it(drawn):
    assert judged(drawn, 0.5, Expectation(linear_error=0.05)).verdict == "explained"
    assert judged(drawn, 0.5, Expectation(linear_error=0.002)).verdict == "unexplained"
