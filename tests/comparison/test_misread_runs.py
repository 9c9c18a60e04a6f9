"""A law that needs other readings of its runs explains nothing: data by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.misread_runs import (
    hold_against_misreading,
    holding_misreading,
    readings_of,
)
from discover.comparison.judging.other_causes.small_faults import holding_small_faults
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import bands_of_predictions
from independent import Giesekus, oscillation, start_up

from discover.laws.registry import make_law
from discover.learners.results.recovered_term import RecoveredTerm
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as protocol
from discover.statistics.lack_of_fit import what_is_left
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
RUNS = {
    "slow": (start_up(0.5), protocol(0.5), GROWTH),
    "fast": (start_up(2.0), protocol(2.0), GROWTH),
    "wave": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
    "held": (start_up(3.0), protocol(3.0), GROWTH),
}
EMPTY = (np.zeros(0), np.zeros(0))


@pytest.fixture(scope="module")
def drawn():
    """σ12, N1 and N2 of fluids with an uncertain α, the one that made the data first."""
    lot = np.random.default_rng(0)
    found = {}
    for name, (flow, _, times) in RUNS.items():
        fluids = [Giesekus(a, 100.0).respond(flow, times) for a in (0.3, 0.301, 0.299)]
        found[name] = np.array([np.stack([f.sigma12, f.N1, f.N2], axis=-1) for f in fluids])
    del lot
    return found


def told(drawn, change, seed=1):
    """Return flows with 1 % of noise, with the mobility that fits those of training."""
    lot, flows = np.random.default_rng(seed), []
    for name, (flow, own, times) in RUNS.items():
        exact = drawn[name][0, :, 0]
        record = change(exact) + 0.01 * np.sqrt(np.mean(exact**2)) * lot.standard_normal(len(times))
        kind = "held_out" if name == "held" else "training"
        measured = record if kind == "training" else None
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        flows.append(Flow(name, kind, own, times, rates, {"sigma12": record}, measured))
    rows = [(drawn[f.name], f.measured) for f in flows if f.measured is not None]
    slope = np.concatenate([(d[1] - d[2])[:, 0] / 2e-3 / np.std(m) for d, m in rows])
    off = np.concatenate([(m - d[0, :, 0]) / np.std(m) for d, m in rows])
    return flows, float(slope @ off / (slope @ slope))


def predicted(drawn, flows, step):
    """Return an outcome of the mobility that fits, to first order, and its bands."""
    predictions, bands = {}, {}
    for flow in flows:
        at, up, down = drawn[flow.name]
        law = at + step * (up - down) / 2e-3
        predictions[flow.key] = dict(zip(("sigma12", "N1", "N2"), law.T, strict=True))
        draws = np.array([law + z * (up - down) / 2 for z in np.linspace(-2, 2, 41)])
        bands[flow.key] = bands_of_predictions(
            np.concatenate([law[None], draws])[:, None], [len(draws) + 1], [flow.times]
        )[0]
    term = RecoveredTerm("sigma.sigma", 0.3 + step, ci95=(0.298 + step, 0.302 + step))
    outcome = LearnerOutcome("tensor_sindy", (term,), 1.0, EMPTY, predictions=predictions)
    return outcome, bands


def judged(drawn, change, expectation=None, learners=("tensor_sindy",)):
    expectation = expectation or Expectation()
    flows, step = told(drawn, change)
    outcome, bands = predicted(drawn, flows, step)
    training = [flow for flow in flows if flow.kind == "training"]
    residuals = [outcome.predictions[f.key]["sigma12"] - f.measured for f in training]
    left = what_is_left(residuals, [f.measured for f in training], expectation)
    found = Explanation(
        dict.fromkeys(learners, replace(left, verdict="explained")), expectation=expectation
    )
    outcomes = {name: replace(outcome, learner=name) for name in learners}
    return hold_against_misreading(found, outcomes, flows, bands)


def stepped(stress):
    return stress * (1 + 0.01 * (np.abs(stress) > 50.0))


def test_a_range_of_the_transducer_that_reads_more_is_no_explanation(drawn):
    found = judged(drawn, stepped, learners=("tbnn_ude", "tensor_sindy"))
    # what one law needs another reading for, another has taken for the fluid's
    assert found.by == ()
    left = found.lack_of_fit["tensor_sindy"]
    assert "times the stress above" in left.reason
    assert "both ranges" in left.advice
    assert found.to_json()["lack_of_fit"]["tensor_sindy"]["likeness"] == left.advice


def test_records_as_the_law_has_them_are(drawn):
    assert judged(drawn, lambda stress: stress).verdict == "explained"


def test_noise_that_is_given_may_hold_another_reading(drawn):
    assert judged(drawn, stepped, Expectation(noise=0.05)).verdict == "explained"
    assert judged(drawn, stepped, Expectation(noise=0.005)).verdict == "unexplained"


def test_repeats_that_differ_as_much_excuse_it(drawn):
    assert judged(drawn, stepped, Expectation(repeat_error=0.05)).verdict == "explained"
    assert judged(drawn, stepped, Expectation(repeat_error=0.001)).verdict == "unexplained"


@pytest.fixture(scope="module")
def model():
    return DeclaredModel(
        make_law("ucm", {}), "ucm", {}, np.array([100.0]), np.array([1.0]), (), None
    )


@pytest.mark.parametrize("step", [0.0, 0.02])
def test_a_law_without_terms_is_asked_too(model, step):
    # a Maxwell fluid as it was told, and one whose runs were filled differently
    lot, flows, predictions = np.random.default_rng(0), [], {}
    for name, (flow, own, times) in list(RUNS.items())[:2]:
        exact = 100.0 * flow.rate(0.0) * -np.expm1(-times)
        factor = 1.0 + (step if name == "fast" else -step)
        record = factor * exact + 0.01 * np.std(exact) * lot.standard_normal(len(times))
        rates = np.full(len(times), float(flow.rate(0.0)))
        flows.append(Flow(name, "training", own, times, rates, {"sigma12": record}, record))
        predictions[flows[-1].key] = {"sigma12": exact}
    outcome = LearnerOutcome("tensor_sindy", (), 1.0, EMPTY, predictions=predictions)
    left = what_is_left(
        [predictions[f.key]["sigma12"] - f.measured for f in flows], [f.measured for f in flows]
    )
    said = Explanation({"tensor_sindy": replace(left, verdict="explained")})
    law = MovedLaw.of((), model)
    found = hold_against_misreading(said, {"tensor_sindy": outcome}, flows, {}, law)
    assert found.verdict == ("unexplained" if step else "explained")


def held(drawn, model, change, seed):
    """Return the interval of σ·σ before and after, and what is said of it."""
    flows, step = told(drawn, change, seed)
    outcome, bands = predicted(drawn, flows, step)
    law = MovedLaw.of(outcome.terms, model)
    training = [flow for flow in flows if flow.kind == "training"]
    fitted = readings_of(law, training)
    outcomes, _, said = holding_misreading(
        {"tensor_sindy": outcome}, bands, outcome, law, training, fitted, Expectation()
    )
    return outcome.terms[0].ci95, outcomes["tensor_sindy"].terms[0].ci95, said


def test_a_reading_that_is_not_ruled_out_widens_intervals(drawn, model):
    before, after, said = held(drawn, model, stepped, 0)
    assert before[1] < 0.3  # a range that reads more passes for a smaller mobility
    assert after[1] > 0.295
    assert "Intervals and bands hold either" in said[0]


def test_intervals_of_runs_as_the_law_has_them_stay(drawn, model):
    before, after, said = held(drawn, model, lambda stress: stress, 0)
    assert after == before
    assert said == ()


def test_interval_and_bands_allow_for_a_range_that_no_test_sees(drawn, model):
    flows, step = told(drawn, lambda s: s * (1 + 0.005 * (np.abs(s) > 50.0)), 0)
    outcome, bands = predicted(drawn, flows, step)
    law = MovedLaw.of(outcome.terms, model)
    fitted = readings_of(law, [flow for flow in flows if flow.kind == "training"])
    seen = {"tensor_sindy": outcome}, bands, law, flows
    outcomes, wider = holding_small_faults(*seen, fitted)
    low, high = outcomes["tensor_sindy"].terms[0].ci95
    assert outcome.terms[0].ci95[1] < 0.3 < high
    assert low > 0.28
    for flow in flows:
        truth = drawn[flow.name][0]
        before, after = (
            np.mean((band.rivals_low <= truth) & (truth <= band.rivals_high), axis=0)
            for band in (bands[flow.key], wider[flow.key])
        )
        # of σ12, N1 and N2; where a wave crosses zero both have no width
        assert np.all(before < 0.3)
        assert np.all(after > 0.8)
        assert max(wider[flow.key].widths().values()) < 0.08
