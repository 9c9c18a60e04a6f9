"""A comparison whose runs are loadings of their own: records by scipy, with a factor on each."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.other_causes.loadings import OwnLoadings
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.comparison.own_loadings import with_own_loadings
from discover.identify.rivals.bands import PredictionBand
from discover.report.comparison.certainty import how_sure
from discover.statistics.reading.loadings import LoadingFound
from independent import Giesekus, start_up

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import imposed_stress
from discover.protocols import start_up as protocol
from discover.statistics import LackOfFit
from discover.study.data import StudyData
from discover.study.in_memory import data_in_memory

GROWTH = np.linspace(0.1, 8.0, 60)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "middle.csv": (start_up(1.0), protocol(1.0), GROWTH),
    "held.csv": (start_up(3.0), protocol(3.0), GROWTH),
}
FACTORS = {"slow.csv": 1.03, "fast.csv": 0.97, "middle.csv": 1.01, "held.csv": 1.025}
FAR = {"slow.csv": 1.15, "fast.csv": 0.88, "middle.csv": 1.12, "held.csv": 0.9}
MOBILITY = 0.3
FEW_TERMS = {"library": {"degree": 0}, "max_terms": 2}


@pytest.fixture(scope="module")
def exact():
    law = Giesekus(MOBILITY, 100.0)
    return {name: law.respond(flow, times).sigma12 for name, (flow, _, times) in FLOWS.items()}


def data_of(exact, factors):
    lot, runs = np.random.default_rng(4), []
    for name, (flow, own, times) in FLOWS.items():
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        error = 0.01 * np.sqrt(np.mean(exact[name] ** 2)) * lot.standard_normal(len(times))
        runs.append(Run(name, times, own, rates, factors.get(name, 1.0) * exact[name] + error))
    return Dataset("runs", tuple(runs))


def compared(data, **options):
    fluid = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    options = {"learners": ["tensor_sindy"], "quick": True, **FEW_TERMS, **options}
    return dc.compare(data, fluid, held_out=["held.csv"], **options)


@pytest.fixture(scope="module")
def loaded(exact, left_to_the_verdict):
    with pytest.MonkeyPatch.context() as patch:
        left_to_the_verdict(patch)
        return compared(data_of(exact, FACTORS), loading=0.03)


@pytest.mark.slow
def test_mobility_is_found_in_runs_of_different_loadings(loaded):
    assert loaded.verdict == "explained"
    (term,) = loaded.outcomes["tensor_sindy"].terms
    assert term.term == "sigma.sigma"
    low, high = term.ci95
    assert low < MOBILITY < high


@pytest.mark.slow
def test_factors_are_told_with_intervals(loaded):
    told = loaded.loadings.found["tensor_sindy"]
    assert {one.run: one.held_out for one in told} == {name: name == "held.csv" for name in FLOWS}
    for one in told:
        low, high = one.ci95
        assert high - low < 0.03
        # of four in one draw, in three standard deviations; benchmarks/readings.py counts intervals
        assert abs(one.factor - FACTORS[one.run]) < 1.53 * 0.5 * (high - low)


@pytest.mark.slow
def test_error_of_a_run_held_out_is_without_its_factor_and_its_band_allows_for_it(loaded):
    (flow,) = loaded.flows_of("held_out")
    error = loaded.errors("tensor_sindy", flow)["sigma12"]
    # 2.5 % of factor and 1 % of noise, and 1 % that is open of the law
    assert error == pytest.approx(np.hypot(0.025, 0.01), abs=0.012)
    band = loaded.next_measurement.bands[flow.key]
    half = 0.5 * (band.high[:, 0] - band.low[:, 0]) / band.chosen[:, 0]
    assert np.all(half > 0.98 * 1.96 * 0.03)
    record = flow.reference["sigma12"]
    assert np.mean((band.low[:, 0] < record) & (record < band.high[:, 0])) > 0.95


@pytest.mark.slow
def test_fitted_records_are_shown_without_their_factors(loaded, exact):
    for flow in loaded.flows_of("training"):
        off = np.linalg.norm(flow.measured - exact[flow.name]) / np.linalg.norm(exact[flow.name])
        assert off < 0.013  # the noise, and what is open of the factor


@pytest.mark.slow
def test_page_says_on_what_the_finding_rests_and_has_the_factors(loaded, tmp_path):
    assert "each run is a loading of its own, 3 %" in how_sure(loaded)
    page = loaded.to_html(tmp_path / "page.html").read_text("utf-8")
    assert 'id="loadings"' in page
    told = loaded.to_json()["loading"]
    assert told["deviation"] == 0.03
    assert set(told["factors"]["tensor_sindy"]) == set(FLOWS)


@pytest.mark.slow
def test_without_loadings_such_runs_are_not_explained(exact):
    plain = compared(data_of(exact, FACTORS))
    assert plain.verdict == "unexplained"
    assert plain.loadings is None


def in_closed_form(factors, noise=0.01):
    """Records of Maxwell in start-up, each with its factor, and what a law with the modulus has."""
    lot, flows, predictions = np.random.default_rng(8), [], {}
    for name, (_, own, times) in FLOWS.items():
        exact = float(own.rate(0.0)) * -np.expm1(-times)
        record = factors[name] * exact + noise * np.sqrt(np.mean(exact**2)) * lot.normal(size=60)
        kind = "held_out" if name == "held.csv" else "training"
        measured = record if kind == "training" else None
        flows.append(Flow(name, kind, own, times, 0.0 * times, {"sigma12": record}, measured))
        predictions[flows[-1].key] = {"sigma12": exact, "N1": exact, "N2": exact}
    # of a coefficient on all of it, known to a thousandth
    known: Any = SimpleNamespace(
        names=(),
        derivatives=lambda flow: (
            None,
            predictions[flow.key]["sigma12"][None, :, None] * np.eye(3)[0],
        ),
    )
    none = np.zeros(0), np.zeros(0)
    outcome = LearnerOutcome(
        "tensor_sindy", (), 1.0, none, {"covariance": [[1e-6]]}, predictions=predictions
    )
    outcomes = {"tensor_sindy": outcome}
    return OwnLoadings.of(outcomes, flows, 0.03, known), outcomes, flows


@pytest.mark.usefixtures("as_users_run_it")  # what stands for a law is none
def test_factors_by_a_law_are_told_with_intervals_that_hold_them():
    loadings, outcomes, flows = in_closed_form(FACTORS)
    told = loadings.found["tensor_sindy"]
    assert {one.run: one.held_out for one in told} == {name: name == "held.csv" for name in FLOWS}
    for one in told:
        low, high = one.ci95
        # noise of 1 % in 60 samples, and the thousandth of the law, both ways
        assert high - low == pytest.approx(2 * 1.96 * np.hypot(0.01 / np.sqrt(60), 1e-3), rel=0.4)
        assert abs(one.factor - FACTORS[one.run]) < high - low
    # taken out, records of fitted and of unseen runs are those of the law
    runs = [Run(f.name, f.times, f.protocol, 0.0 * f.times, f.reference["sigma12"]) for f in flows]
    data = Dataset("all", tuple(runs))
    for run in loadings.taken_out(StudyData(data, data, data.select([]))).dataset:
        exact = outcomes["tensor_sindy"].predictions[flows[data.names.index(run.name)].key]
        assert np.mean(run.stress / exact["sigma12"]) == pytest.approx(1.0, abs=0.005)


@pytest.mark.usefixtures("as_users_run_it")
def test_a_run_held_out_keeps_its_factor_and_its_band_allows_for_it():
    loadings, outcomes, flows = in_closed_form(FACTORS)
    made = {}
    for flow in flows:
        exact = np.stack([*outcomes["tensor_sindy"].predictions[flow.key].values()], axis=1)
        made[flow.key] = PredictionBand(flow.times, *[exact] * 5, runaways=0.0)
    held = loadings.bands_of_records(made, flows)
    for flow in flows:
        band = held[flow.key]
        half = 0.5 * (band.high - band.low) / band.chosen
        # σ12 of the run held out by what loadings differ by, and nothing else
        wider = 1.96 * 0.03 * np.array([flow.kind == "held_out", 0.0, 0.0])
        assert half == pytest.approx(np.tile(wider, (60, 1)), rel=1e-3)
    as_recorded = loadings.as_recorded(outcomes, flows)["tensor_sindy"].predictions
    (unseen,) = [flow for flow in flows if flow.kind == "held_out"]
    record, law = unseen.reference["sigma12"], as_recorded[unseen.key]["sigma12"]
    # 2.5 % of factor and 1 % of noise: it is predicted without what it alone tells
    error = np.linalg.norm(record - law) / np.linalg.norm(record)
    assert error == pytest.approx(np.hypot(0.025, 0.01), abs=0.004)


def _explained(found):
    left = LackOfFit("explained", 0.01, 0.01, 0.0, 0.5)
    loadings = OwnLoadings(0.03, {"tensor_sindy": found}, "tensor_sindy")
    return loadings.held_against(Explanation({"tensor_sindy": left}))


def test_factors_larger_than_loadings_differ_by_refute_the_law():
    far = LoadingFound("a.csv", False, 1.12, None, 4.5)
    other = LoadingFound("b.csv", False, 1.0, None, 0.0)
    refuted = _explained([far, other])
    assert refuted.verdict == "unexplained"
    assert "a.csv is read as 1.12 times the law" in refuted.lack_of_fit["tensor_sindy"].reason
    near = replace(far, deviations=2.0)
    assert _explained([near, other]).verdict == "explained"


@pytest.mark.slow
def test_records_that_differ_by_far_more_are_not_explained(exact):
    assert compared(data_of(exact, FAR), loading=0.03).verdict == "unexplained"


@pytest.mark.parametrize("loading", [0.0, 0.2])
def test_loadings_that_cannot_be_are_refused(exact, loading):
    with pytest.raises(dc.InputError, match="loading"):
        compared(data_of(exact, {}), loading=loading)


def test_a_factor_on_an_imposed_stress_is_refused():
    times = np.linspace(0.1, 4.0, 20)
    stress = np.full(20, 50.0)
    flow = imposed_stress(times, stress)
    creep = Run("creep.csv", times, flow, np.full(20, 0.5), stress, strain=0.5 * times)
    data = data_in_memory(Dataset("runs", (creep,)), ())
    with pytest.raises(dc.InputError, match="imposed"):
        with_own_loadings(data, 0.03)
