"""`compare` and `close-loop` give the same answer to the same residuals."""

import numpy as np
import pytest

from discover.closed_loop import DeclaredModel, RunRecord
from discover.closed_loop.judging.judgement import judge
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.judging.silence import records_are_silent
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.comparison.judging.explanation import explain
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, make_batch
from discover.inference.least_squares import Fit
from discover.protocols import start_up
from discover.protocols.control import steady_rates
from discover.statistics.residual import Expectation

TIMES = np.linspace(0.1, 10.0, 120)
RATES = (0.3, 1.0, 3.0)


def runs_and_residuals(kind):
    """Return runs in start-up, and what a model leaves of them."""
    generator = np.random.default_rng(4)
    runs, residuals = [], []
    for rate in RATES:
        exact = 100.0 * rate * -np.expm1(-TIMES)
        left = 0.02 * 100.0 * rate * generator.standard_normal(len(TIMES))
        if kind == "pattern":
            left = left + 0.03 * 100.0 * rate * np.sin(4.0 * TIMES)
        if kind == "loud start":
            left = 0.1 * left + 0.01 * 100.0 * rate * np.sin(4.0 * TIMES)
            left[:8] += 20.0 * rate
        if kind == "outliers":
            left[10:110:20] += 60.0 * rate
        if kind == "dead":
            exact = 42.0 + left
        record = exact - left if kind != "dead" else exact
        runs.append(Run(str(rate), TIMES, start_up(rate), np.full(len(TIMES), rate), record))
        residuals.append(left)
    return runs, residuals


def said_by_comparison(runs, residuals, expectation):
    flows = [Flow(r.name, "training", r.protocol, r.time, r.rate, {}, r.stress) for r in runs]
    predictions = {
        flow.key: {"sigma12": flow.measured + left}
        for flow, left in zip(flows, residuals, strict=True)
    }
    history = (np.zeros(1), np.zeros(1))
    outcome = LearnerOutcome("tensor_sindy", (), 0.0, history, predictions=predictions)
    return explain({"tensor_sindy": outcome}, flows, expectation).lack_of_fit["tensor_sindy"]


def said_by_loop(runs, residuals, expectation):
    model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [make_effect("stress_offset")])
    batch = make_batch(runs)
    tolerated = ToleratedMisfit(expectation, NumericalResolution(model, batch, runs))
    weighted = np.array(residuals) * np.asarray(batch.weight)
    fit = Fit(model.zero(), (), weighted, np.zeros((0, *weighted.shape)))
    records = [
        RunRecord(
            run.name, False, run.time, run.time, run.time, run.rate, run.stress,
            (run.stress + left)[None], np.array([np.sqrt(np.sum(row**2))]),
        )
        for run, left, row in zip(runs, residuals, weighted, strict=True)
    ]  # fmt: skip
    silence = "records" if records_are_silent(runs) else None
    return judge(tolerated, fit, (), records, None, silence)


SAID = {"no_effect_needed": "explained", "unexplained": "unexplained", "no_signal": "no_signal"}


@pytest.mark.parametrize(
    ("kind", "expectation", "verdict"),
    [
        ("noise", Expectation(), "explained"),
        ("noise", Expectation(noise=0.02), "explained"),
        ("noise", Expectation(noise=0.002), "unexplained"),
        ("pattern", Expectation(), "unexplained"),
        ("pattern", Expectation(linear_error=0.005), "unexplained"),
        ("pattern", Expectation(linear_error=0.03), "explained"),
        ("loud start", Expectation(), "unexplained"),
        ("outliers", Expectation(), "explained"),
        ("dead", Expectation(), "no_signal"),
    ],
)
def test_the_same_residuals_have_the_same_verdict_in_both(kind, expectation, verdict):
    runs, residuals = runs_and_residuals(kind)
    compared = said_by_comparison(runs, residuals, expectation)
    looped = said_by_loop(runs, residuals, expectation)
    assert compared.verdict == SAID[looped.verdict] == verdict
    assert looped.left.misfit == pytest.approx(compared.misfit)
    assert looped.left.probability == pytest.approx(compared.probability)
    assert looped.left.outliers == compared.outliers


@pytest.mark.parametrize("seed", [9, 87, 153])
def test_a_misfit_of_a_flow_curve_is_none_of_a_sweep_that_errs_by_nothing(seed):
    # in these draws what changes from point to point seems as large as the misfit beside it
    rates = np.geomspace(0.1, 10.0, 30)
    noise = np.random.default_rng(seed).standard_normal(30)

    def said(left, linear_error):
        run = Run("curve", rates, steady_rates(rates), rates, 100.0 * rates**0.3 - left)
        return said_by_loop([run], [left], Expectation(linear_error=linear_error)).verdict

    assert said(noise + 0.9, 0.0) == "unexplained"
    assert said(noise + 0.9, 0.02) == "no_effect_needed"
    assert said(noise, 0.0) == "no_effect_needed"
