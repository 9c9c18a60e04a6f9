"""The dense library opens what only sparsity decides; the curves are written by hand."""

from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from discover.comparison.judging.bands.dense_library import (
    open_where_dense_is_wide,
    with_gain_in_dense,
    without_refuted_bands,
)
from discover.comparison.judging.constants.declared_constants import OtherConstant
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.learners.results.weighted_laws import WeightedLaws
from independent import Thixotropic, UpperConvectedMaxwell
from independent import start_up as start_up_of_scipy
from independent.instruments import Instrument

from discover.laws import Fluid
from discover.laws.textbook.giesekus import Giesekus
from discover.learners import LearnerResult
from discover.learners.results import weighted_laws
from discover.protocols import start_up
from discover.statistics.residual import Expectation

TIMES = np.linspace(0.0, 4.0, 9)
FLOW = Flow("startup", "test", start_up(2.0), TIMES, np.full(9, 2.0), {})
RISE = 1.0 - np.exp(-TIMES)
CURVES = {"sigma12": RISE, "N1": RISE, "N2": -0.1 * RISE}
SAID = [Statement("N1", IN_LIBRARY, "Then its band is narrow."), Statement("N2", "no", "Open.")]


def outcome(learner, half_width=None):
    """A learner with these curves, and bands of this half-width relative to N1."""
    band = None
    if half_width is not None:
        band = {q: (c - half_width * RISE, c + half_width * RISE) for q, c in CURVES.items()}
    empty = (np.zeros(0), np.zeros(0))
    predictions = {FLOW.key: CURVES}
    return LearnerOutcome(learner, (), 1.0, empty, predictions=predictions, bands={FLOW.key: band})


def test_a_narrow_dense_band_leaves_a_statement_and_says_its_width():
    outcomes = {"tensor_dense": outcome("tensor_dense", 0.2)}
    first, second = open_where_dense_is_wide(SAID, outcomes, [FLOW])
    assert first.determined == IN_LIBRARY
    assert "± 20 % of its size" in first.text
    # an open quantity has the band all the same, with what it takes for granted
    assert second.undetermined
    assert "± 20 % of N1 at the widest" in second.text
    assert (
        "takes it for granted that the fluid behaves like one of the laws that fit" in second.text
    )


def test_dense_bands_hold_the_fluid_behind_a_transducer_of_the_gain_that_the_sparse_law_shows():
    gain = 1.1
    outcomes = {"tensor_dense": outcome("tensor_dense", 0.02)}
    shown = OtherConstant("gammadot", 1.0 - gain, 100.0, gain, None)
    wide = with_gain_in_dense(outcomes, [shown])["tensor_dense"].bands[FLOW.key]
    for quantity in ("N1", "N2"):
        low, high = wide[quantity]
        truth = CURVES[quantity] / gain  # what was fitted is gain times the fluid's
        assert np.all((low <= truth) & (truth <= high))
        assert np.all((low <= CURVES[quantity]) & (CURVES[quantity] <= high))
    own = outcomes["tensor_dense"].bands[FLOW.key]
    np.testing.assert_array_equal(wide["sigma12"], own["sigma12"])
    # another time moves no stress, and without a dense library there is nothing to widen
    time = OtherConstant("sigma", 0.2, 1.0, 1.0 / 1.2, None)
    assert with_gain_in_dense(outcomes, [time]) == outcomes
    sparse = {"tensor_sindy": outcome("tensor_sindy")}
    assert with_gain_in_dense(sparse, [shown]) == sparse


def test_an_open_statement_stays_where_the_dense_library_has_no_band():
    outcomes = {"tensor_dense": outcome("tensor_dense", None)}
    assert open_where_dense_is_wide(SAID[1:], outcomes, [FLOW]) == SAID[1:]


@pytest.mark.parametrize("half_width", [1.2, None])
def test_a_dense_band_as_wide_as_the_quantity_or_none_opens_it(half_width):
    outcomes = {"tensor_dense": outcome("tensor_dense", half_width)}
    first, _ = open_where_dense_is_wide(SAID, outcomes, [FLOW])
    assert first.undetermined
    assert FLOW.title in first.text


def test_a_sparse_law_outside_the_dense_band_determines_nothing():
    sparse = outcome("tensor_sindy")
    sparse.predictions[FLOW.key] = {**CURVES, "N1": 1.5 * RISE}
    outcomes = {"tensor_sindy": sparse, "tensor_dense": outcome("tensor_dense", 0.2)}
    first, _ = open_where_dense_is_wide(SAID, outcomes, [FLOW])
    assert first.undetermined
    assert "20 % of its size" in first.text  # (1.5 − 1.2)/1.5


def test_without_a_dense_library_every_statement_stays():
    assert open_where_dense_is_wide(SAID, {"tensor_sindy": outcome("tensor_sindy")}, [FLOW]) == SAID


def held_out(record):
    rate = np.full(len(record), 2.0)
    times = np.linspace(0.0, 4.0, len(record))
    return Flow("e.csv", "held_out", start_up(2.0), times, rate, {"sigma12": record})


@pytest.mark.parametrize(("lag", "refuted"), [(0.0, False), (0.5, True)])
def test_a_record_outside_the_dense_band_of_its_stress_leaves_no_band_of_n1(lag, refuted):
    # scipy's Maxwell fluid, read through a transducer with a lag that the laws know nothing of
    times, fluid = np.linspace(0.0, 4.0, 81), UpperConvectedMaxwell(1.0, 1.0)
    exact = fluid.respond(start_up_of_scipy(2.0), times)
    read = Instrument(lag=lag).record(fluid, start_up_of_scipy(2.0), times).stress
    record = read + 0.01 * np.random.default_rng(0).standard_normal(81)
    record[40] += 1.0  # one knock refutes no band
    flow = held_out(record)
    edge = 0.02 * np.max(exact.sigma12)
    band = {
        name: (curve - edge, curve + edge)
        for name, curve in (("sigma12", exact.sigma12), ("N1", exact.N1), ("N2", exact.N2))
    }
    dense = replace(
        outcome("tensor_dense"), bands={flow.key: band}, details={"noise": {"relative": 0.01}}
    )
    found, said = without_refuted_bands({"tensor_dense": dense}, [flow], Expectation())
    assert (found["tensor_dense"].bands[flow.key] is None) == refuted
    assert len(said) == refuted
    assert without_refuted_bands({"tensor_sindy": dense}, [flow], Expectation())[1] == []


@pytest.mark.parametrize(("build_up", "refuted"), [(None, False), (2.0, True)])
def test_laws_that_miss_the_runs_they_were_fitted_to_have_no_band(build_up, refuted):
    # laws that all are nearly Maxwell, of a Maxwell fluid by scipy, or of one with a structure
    times, fluid = np.linspace(0.0, 4.0, 81), UpperConvectedMaxwell(1.0, 1.0)
    known = fluid.respond(start_up_of_scipy(2.0), times)
    truth = fluid if build_up is None else Thixotropic(fluid, 0.3, build_up)
    exact = truth.respond(start_up_of_scipy(2.0), times).sigma12
    size = np.sqrt(np.mean(exact**2))
    record = exact + 0.01 * size * np.random.default_rng(0).standard_normal(81)
    flow = replace(held_out(record), kind="training", measured=record)
    curves = {"sigma12": known.sigma12, "N1": known.N1, "N2": known.N2}
    band = {name: (curve - 0.5, curve + 0.5) for name, curve in curves.items()}
    dense = outcome("tensor_dense")
    dense = replace(dense, predictions={flow.key: curves}, bands={flow.key: band})
    found, said = without_refuted_bands({"tensor_dense": dense}, [flow], Expectation())
    assert (found["tensor_dense"].bands[flow.key] is None) == refuted
    assert len(said) == refuted


@pytest.fixture(scope="module")
def eleven_laws():
    """Giesekus laws of several mobilities; the first runs away and has a tenth of the weight."""
    mobilities = jnp.asarray([-30.0, *np.linspace(0.1, 0.9, 10)])
    laws = eqx.filter_vmap(Giesekus)(mobilities)
    return LearnerResult(
        "tensor_dense",
        Giesekus(0.3),
        (),
        weighted=WeightedLaws(laws, np.array([0.1, *[0.09] * 10])),
    )


def test_predictions_are_the_middle_of_the_laws_that_fit_and_the_band_their_range(eleven_laws):
    found = LearnerOutcome.of(eleven_laws, Fluid.dimensionless(Giesekus(0.3)), [FLOW])
    low, high = found.bands[FLOW.key]["N1"]
    ends = [LearnerOutcome.of(
        LearnerResult("", Giesekus(m), ()), Fluid.dimensionless(Giesekus(m)), [FLOW]
    ).predictions[FLOW.key]["N1"] for m in (0.1, 0.5, 0.9)]  # fmt: skip
    # the integrator's steps are good to 1e-4 here; a mobility takes N1 down
    assert low[-1] == pytest.approx(ends[2][-1], rel=1e-3)
    assert high[-1] == pytest.approx(ends[0][-1], rel=1e-3)
    middle = found.predictions[FLOW.key]["N1"]
    assert low[-1] < middle[-1] < high[-1]
    assert middle[-1] == pytest.approx(ends[1][-1], rel=0.1)


def test_a_flow_in_which_most_laws_run_away_has_no_band(eleven_laws):
    weights = np.array([0.6, *[0.04] * 10])
    weighted = WeightedLaws(eleven_laws.weighted.laws, weights)
    result = LearnerResult("tensor_dense", Giesekus(0.3), (), weighted=weighted)
    found = LearnerOutcome.of(result, Fluid.dimensionless(Giesekus(0.3)), [FLOW])
    assert found.bands[FLOW.key] is None


def test_of_laws_of_several_kinds_n1_of_one_more_is_in_the_band(eleven_laws):
    # a mobility beyond those of the laws at hand
    beyond = Fluid.dimensionless(Giesekus(0.98))
    truth = LearnerOutcome.of(LearnerResult("", Giesekus(0.98), ()), beyond, [FLOW])
    n1 = truth.predictions[FLOW.key]["N1"]

    def band_of(kinds):
        weighted = replace(eleven_laws.weighted, kinds=kinds)
        result = replace(eleven_laws, weighted=weighted)
        return LearnerOutcome.of(result, Fluid.dimensionless(Giesekus(0.3)), [FLOW]).bands[FLOW.key]

    known, further = band_of(None), band_of(np.arange(11))
    assert n1[-1] < known["N1"][0][-1]
    assert np.all((further["N1"][0] <= n1) & (n1 <= further["N1"][1]))
    for quantity in ("sigma12", "N2"):
        np.testing.assert_array_equal(further[quantity], known[quantity])
    # a single kind says nothing of one more
    assert band_of(np.zeros(11, dtype=int)) is None


def test_a_law_that_is_about_to_run_away_does_not_widen_the_band_of_one_more(monkeypatch):
    own = weighted_laws._predict

    def far(*arguments):
        predicted = np.array(own(*arguments))
        predicted[0] *= 1e9
        return predicted

    monkeypatch.setattr(weighted_laws, "_predict", far)
    mobilities = jnp.linspace(0.1, 0.9, 41)
    weights = np.array([0.001, *[0.999 / 40] * 40])
    laws = WeightedLaws(eqx.filter_vmap(Giesekus)(mobilities), weights, kinds=np.arange(41))
    result = LearnerResult("tensor_dense", Giesekus(0.3), (), weighted=laws)
    found = LearnerOutcome.of(result, Fluid.dimensionless(Giesekus(0.3)), [FLOW])
    assert found.half_widths(FLOW)["N1"] < 2.0
