"""Bands allow for the standard error of a rate that was read with noise: by scipy."""

from dataclasses import replace

import numpy as np
from discover.comparison.judging.bands.rates_in_bands import holding_rate_errors
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.outcomes.flows import Flow, predict
from discover.identify.rivals.bands import PredictionBand
from independent import Giesekus
from independent import start_up as independent_start_up

from discover.dataset import Run
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners import RecoveredTerm
from discover.protocols import sampled_rate
from discover.study.declared_model import DeclaredModel

TIMES, RATE, ERROR = np.linspace(0.1, 8.0, 80), 0.5, 0.03 / np.sqrt(80)
MODES = np.array([100.0]), np.array([1.0])
KNOWN = DeclaredModel(UpperConvectedMaxwell(), "ucm", {}, *MODES, (), None)
LAW = MovedLaw.of([RecoveredTerm("sigma.sigma", 0.3)], KNOWN)
RATES = np.full(80, RATE)
RUN = Run("slow", TIMES, sampled_rate(TIMES, RATES), RATES, np.ones(80), rate_error=ERROR)


def held(run):
    flow = Flow(run.name, "training", run.protocol, TIMES, RATES, {"sigma12": run.stress})
    told = predict(LAW.fluid(LAW.start), flow)
    chosen = np.stack([told["sigma12"], told["N1"], told["N2"]], axis=-1)
    exact = PredictionBand(TIMES, *[chosen] * 5, runaways=0.0)
    return exact, holding_rate_errors({flow.key: exact}, LAW, [flow], [run])[flow.key]


def true(rate):
    return Giesekus(0.3, 100.0).respond(independent_start_up(rate), TIMES)


def test_a_band_holds_the_stress_at_a_rate_that_is_off_by_two_standard_errors():
    exact, band = held(RUN)
    above, below = true(RATE * (1.0 + 2.0 * ERROR)), true(RATE * (1.0 - 2.0 * ERROR))
    for column, quantity in enumerate(("sigma12", "N1", "N2")):
        spread = 0.5 * np.abs(getattr(above, quantity) - getattr(below, quantity))
        half = 0.5 * (band.high - band.low)[:, column]
        # 1.96 of them, to first order, and both integrations
        np.testing.assert_allclose(
            half, 0.98 * spread, rtol=0.02, atol=1e-5 * np.max(spread) + 1e-6
        )
    np.testing.assert_array_equal(band.chosen, exact.chosen)


def test_control_a_rate_that_was_commanded_leaves_the_band_as_it_is():
    exact, band = held(replace(RUN, rate_error=0.0))
    np.testing.assert_array_equal(band.low, exact.low)
    np.testing.assert_array_equal(band.high, exact.high)
