"""Other terms, and more, in the place of a bench that is a little off: data by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.smaller_laws import (
    hold_against_smaller_laws,
    holding_smaller_laws,
)
from discover.comparison.outcomes.flows import Flow, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from independent import Giesekus, PhanThienTanner, start_up
from independent.instruments import Instrument

from discover.laws.registry import make_law
from discover.learners.results.recovered_term import RecoveredTerm
from discover.protocols import start_up as protocol
from discover.statistics.lack_of_fit import what_is_left
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

MODULUS = 100.0
GROWTH, WAVE = np.linspace(0.1, 8.0, 60), np.linspace(0.1, 12.0, 60)
FLOWS = {
    "slow": (start_up(0.5), protocol(0.5), GROWTH),
    "fast": (start_up(2.0), protocol(2.0), GROWTH),
}
GIESEKUS = Giesekus(0.3, MODULUS, 1.0)
LINEAR = ("gammadot", "sigma.sigma")
OTHERS = ("gammadot", "tr(sigma)*I", "tr(sigma)*sigma")


def fitted(material, names, start, path=(), **faults):
    """Return flows, the law of these terms fitted to 1 % of noise, and that it explains them."""
    lot, flows = np.random.default_rng(0), []
    for name, (flow, own, times) in FLOWS.items():
        run = Instrument(**faults).record(material, flow, times)
        size = 0.01 * np.sqrt(np.mean(run.stress**2))
        record = run.stress + size * lot.standard_normal(len(times))
        known = {"sigma12": record}
        flows.append(Flow(name, "training", own, run.time, run.rate, known, record))
    model = DeclaredModel(
        make_law("ucm", {}), "ucm", {}, np.array([MODULUS]), np.array([1.0]), (), None
    )
    values = np.array(start)
    weights = [1.0 / np.sqrt(np.mean(flow.measured**2)) for flow in flows]
    for _ in range(4):
        law = MovedLaw(model, LawTerms(dict(zip(names, map(float, values), strict=True))), ())
        told = [law.derivatives(flow) for flow in flows]
        rows = zip(flows, told, weights, strict=True)
        off = np.concatenate([w * (f.measured - t[0][:, 0]) for f, t, w in rows])
        slopes = np.concatenate([w * t[1][..., 0] for t, w in zip(told, weights, strict=True)], 1)
        inverse = np.linalg.inv(slopes @ slopes.T)
        values = values + inverse @ slopes @ off
    half = 1.96 * np.std(off) * np.sqrt(np.diag(inverse))
    terms = tuple(
        RecoveredTerm(name, float(v), ci95=(float(v - h), float(v + h)))
        for name, v, h in zip(names, values, half, strict=True)
    )
    law = MovedLaw.of(terms, model)
    fluid = law.fluid(law.start)
    predictions = {flow.key: predict(fluid, flow) for flow in flows}
    details = {"path": [{"support": [n], "coefficients": [c], "misfit": 0.02} for n, c in path]}
    outcome = LearnerOutcome(
        "tensor_sindy", terms, 1.0, (np.zeros(0), np.zeros(0)), details, predictions=predictions
    )
    residuals = [predictions[f.key]["sigma12"] - f.measured for f in flows]
    left = replace(what_is_left(residuals, [f.measured for f in flows]), verdict="explained")
    return flows, law, outcome, Explanation({"tensor_sindy": left})


def test_other_terms_do_not_explain_what_one_term_does_on_a_clock_that_is_fast():
    # a clock that is 2 % fast is rates 2 % less and times 2 % more than told
    flows, law, outcome, found = fitted(
        GIESEKUS, OTHERS, [0.01, 0.28, 0.33], [("sigma.sigma", 0.298)], clock_slip=0.02
    )
    held = hold_against_smaller_laws(found, {"tensor_sindy": outcome}, flows, law)
    assert held.verdict == "unexplained"
    left = held.lack_of_fit["tensor_sindy"]
    assert "sigma.sigma" in left.reason
    assert "rates are" in left.reason
    assert "gap" in left.advice


def test_a_term_that_rates_off_by_as_much_would_do_may_be_zero():
    flows, law, outcome, _ = fitted(GIESEKUS, LINEAR, [-0.03, 0.31], rate_gain=0.03)
    low, high = outcome.terms[1].ci95
    assert not low < 0.3 < high  # of the right term, which takes the rates for right
    outcomes, _, said = holding_smaller_laws({"tensor_sindy": outcome}, {}, law, flows)
    gain, square = outcomes["tensor_sindy"].terms
    assert gain.ci95[0] < 0.0 <= gain.ci95[1]
    assert square.ci95[0] < 0.3 < square.ci95[1]
    assert "gammadot may be no term of the fluid" in said[0]


def stay(flows, law, outcome, found):
    held = hold_against_smaller_laws(found, {"tensor_sindy": outcome}, flows, law)
    assert held.verdict == "explained"
    outcomes, _, said = holding_smaller_laws({"tensor_sindy": outcome}, {}, law, flows)
    assert said == ()
    assert outcomes["tensor_sindy"].terms == outcome.terms


def test_a_modulus_that_is_larger_than_any_bench_is_off_stays_a_term():
    # a third more than was told: the modulus is that of 1 + 0.3, and the mobility of it 0.3/1.3
    fluid = Giesekus(0.3, 1.3 * MODULUS, 1.0)
    stay(*fitted(fluid, LINEAR, [0.3, 0.23], [("sigma.sigma", 0.3)]))


@pytest.mark.slow
def test_two_terms_that_are_there_stay():
    fluid = PhanThienTanner(0.3, "linear", 0.1, modulus=MODULUS, relaxation_time=1.0)
    names = ("tr(sigma)*sigma", "sigma.gammadot+gammadot.sigma")
    stay(*fitted(fluid, names, [0.3, 0.05], [("sigma.sigma", 0.2)]))
