"""A law that builds up stress at rest explains no run from rest: data from scipy alone."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.explanation import explain
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from hostile_materials import Heated
from independent import UpperConvectedMaxwell
from independent import start_up as flow_of
from independent.flow import steps
from independent.instruments import Instrument
from independent.material import StressLaw, rate_tensor, stretched
from independent.noise import correlated, white

from discover.learners import RecoveredTerm
from discover.protocols.protocol import start_up, step_rates
from discover.statistics.residual import Expectation

EMPTY = (np.zeros(0), np.zeros(0))


TENSORS = {
    "I": lambda s, g: np.eye(3),
    "gammadot": lambda s, g: g,
    "sigma.sigma": lambda s, g: s @ s,
    "sigma.gammadot.gammadot+gammadot.gammadot.sigma": lambda s, g: s @ g @ g + g @ g @ s,
    "tr(gammadot.gammadot)*I": lambda s, g: np.trace(g @ g) * np.eye(3),
    "tr(sigma.gammadot)*gammadot": lambda s, g: np.trace(s @ g) * g,
}


class OfTerms(StressLaw):
    """A law of the library with a mode of 100 Pa and 1 s, by scipy: no program is compiled."""

    modulus = 100.0

    def __init__(self, coefficients):
        self.coefficients = coefficients

    def stress_change(self, stress, rate):
        s, g = stress / self.modulus, rate_tensor(rate)
        extra = sum(c * TENSORS[name](s, g) for name, c in self.coefficients.items())
        return self.modulus * (g - s - extra) + stretched(stress, rate)


def outcome(flows, courses, coefficients):
    """Return what a law of these terms predicts of flows, whose courses the simulator takes."""
    found = {}
    for flow, course in zip(flows, courses, strict=True):
        own = OfTerms(coefficients).respond(course, flow.times)
        found[flow.key] = {"sigma12": own.sigma12, "N1": own.N1, "N2": own.N2}
    return LearnerOutcome("tensor_sindy", (), 1.0, EMPTY, predictions=found)


def noisy(records, noise, *correlation):
    generator = np.random.default_rng(0)
    return [noise(record, 0.01, *correlation, generator) for record in records]


# five terms that a search chose for a Maxwell fluid in steps behind a bearing's friction
RESTLESS = {
    "I": 0.26240704183850394,
    "gammadot": -0.42589412514790925,
    "sigma.gammadot.gammadot+gammadot.gammadot.sigma": 1.5514043861830438,
    "tr(gammadot.gammadot)*I": 0.6242168717959209,
    "tr(sigma.gammadot)*gammadot": -1.5507287562727032,
}


@pytest.mark.parametrize(
    ("law", "instrument", "verdict"),
    [
        (RESTLESS, Instrument(friction=6.166), "unexplained"),
        # the negative control: a gain is a law of another modulus, which rests
        ({"gammadot": -0.1}, Instrument(gain=0.1), "explained"),
    ],
)
def test_a_law_that_builds_up_stress_at_rest_explains_no_run_from_rest(law, instrument, verdict):
    times, at = np.linspace(0.02, 8.0, 120), [0.0, 4.0]
    fluid = UpperConvectedMaxwell(100.0, 1.0)
    rates = ((1.0, 3.0), (3.0, 0.5))
    records = [instrument.record(fluid, steps(at, pair), times).stress for pair in rates]
    flows = [
        Flow(f"{pair}", "training", step_rates(at, pair), times, times, {"sigma12": record}, record)
        for pair, record in zip(rates, noisy(records, correlated, 0.6), strict=True)
    ]
    terms = tuple(RecoveredTerm(name, value) for name, value in law.items())
    one = outcome(flows, [steps(at, pair) for pair in rates], law)
    # by its fit alone it would explain the records, the friction as well as the gain
    assert explain({"tensor_sindy": one}, flows, Expectation()).verdict == "explained"
    one = replace(one, terms=terms)
    assert explain({"tensor_sindy": one}, flows, Expectation()).verdict == verdict


@pytest.mark.parametrize(
    ("interval", "verdict"),
    [((-0.0108, -0.0038), "unexplained"), ((-0.0150, 0.0004), "explained")],
)
def test_however_little_a_law_builds_up_at_rest_it_explains_nothing(interval, verdict):
    # of a Giesekus fluid that its work warms: what a search chose, though it rests
    times = np.linspace(0.1, 8.0, 80)
    law = {"I": -0.00728, "sigma.sigma": 0.31828}
    fluid = Heated(0.3, 1e-4)
    records = [fluid.respond(flow_of(rate), times).sigma12 for rate in (0.5, 2.0)]
    flows = [
        Flow(f"{rate}", "training", start_up(rate), times, times, {"sigma12": record}, record)
        for rate, record in zip((0.5, 2.0), noisy(records, white), strict=True)
    ]
    one = outcome(flows, [flow_of(rate) for rate in (0.5, 2.0)], law)
    terms = (
        RecoveredTerm("I", law["I"], ci95=interval),
        RecoveredTerm("sigma.sigma", law["sigma.sigma"]),
    )
    assert explain({"tensor_sindy": replace(one, terms=terms)}, flows, Expectation()).verdict == (
        verdict
    )
