"""What explains the runs and has a name is in the bands of libraries; all records are scipy's."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.fitting.named_effects import (
    NamedExplanation,
    _admitted,
    _sets,
    fit_named_effects,
)
from discover.comparison.judging.bands.dense_library import (
    DENSE,
    NAMED_BESIDE,
    without_refuted_bands,
)
from discover.comparison.judging.bands.named_bands import (
    holding_named_effects,
    with_named_effects,
    with_named_told,
)
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from independent import FenePeterlin, Giesekus, Thixotropic, UpperConvectedMaxwell
from independent import start_up as start_up_of_scipy
from independent.instruments import Instrument

from discover.dataset import Run
from discover.dataset.linear_viscoelasticity import RelaxationSpectrum
from discover.effects import make_effect
from discover.laws import make_law
from discover.protocols import start_up
from discover.statistics import LackOfFit
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel

NOISE = 0.01
KNOWN = DeclaredModel(make_law("ucm"), "ucm", {}, np.ones(1), np.ones(1), (), None)
CANDIDATES = [
    make_effect(name)
    for name in (
        "giesekus_mobility",
        "finite_extensibility",
        "transducer_lag",
        "rate_rise_time",
    )
]
FITTED, UNSEEN = (1.0, 3.0), 5.0


def recorded(material, rate, instrument=None, seed=None):
    """A start-up of 81 samples behind an instrument, with white noise where there is a seed."""
    flow, times = start_up_of_scipy(rate), np.linspace(0.05, 4.0, 81)
    run = (instrument or Instrument()).record(material, flow, times)
    stress = run.stress
    if seed is not None:
        size = NOISE * np.sqrt(np.mean(stress**2))
        stress = stress + size * np.random.default_rng([seed, int(10 * rate)]).standard_normal(81)
    exact = {"sigma12": run.stress, "N1": run.N1, "N2": run.N2}
    return Run(f"{rate:g}.csv", times, start_up(rate), np.full(81, rate), stress), exact


def explained(material, instrument=None, known=KNOWN, candidates=CANDIDATES):
    """What explains two start-ups, and the truth of a third with the flow in which it is held."""
    runs = [recorded(material, rate, instrument, seed=1)[0] for rate in FITTED]
    unseen, exact = recorded(material, UNSEEN, instrument, seed=1)
    flow = as_flow(unseen)
    flows = [flow, replace(flow, kind="test", name="a test")]
    found = fit_named_effects(known, runs, [unseen], flows, Expectation(), candidates)
    return found, flow, exact


def as_flow(run, kind="held_out"):
    measured = run.stress if kind == "training" else None
    seen = {"sigma12": run.stress}
    return Flow(run.name, kind, run.protocol, run.time, run.rate, seen, measured)


def dense(flow, curves, half_width=0.1, **more):
    """The dense library with these curves in one flow, and a band about each."""
    size = np.max(curves["N1"])
    band = {q: (c - half_width * size, c + half_width * size) for q, c in curves.items()}
    empty = np.zeros(0), np.zeros(0)
    return LearnerOutcome(
        DENSE, (), 1.0, empty, predictions={flow.key: curves}, bands={flow.key: band}, **more
    )


def holds(limits, exact):
    return {q: np.mean((limits[q][0] <= exact[q]) & (exact[q] <= limits[q][1])) for q in exact}


@pytest.mark.parametrize(
    ("material", "instrument", "names"),
    [
        pytest.param(FenePeterlin(30.0), None, {("finite_extensibility",)}, marks=pytest.mark.slow),
        pytest.param(
            Giesekus(0.3),
            Instrument(lag=0.1),
            {("giesekus_mobility", "transducer_lag")},
            marks=pytest.mark.slow,
        ),
        # a lag and a rate that rises late give a Maxwell fluid one σ12, and two N1
        pytest.param(
            UpperConvectedMaxwell(),
            Instrument(rise_time=0.1),
            {("transducer_lag",), ("rate_rise_time",)},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_the_band_of_what_has_a_name_holds_stresses_of_a_run_that_no_fit_saw(
    material, instrument, names
):
    found, flow, exact = explained(material, instrument)
    assert {one.effects for one in found} == names
    # laws of the library that fit, with a false N1
    wrong = dense(flow, exact | {"N1": 1.5 * exact["N1"]}, 0.01)
    assert holds(wrong.bands[flow.key], exact)["N1"] < 0.5
    limits = with_named_effects({DENSE: wrong}, [flow], found)[DENSE].bands[flow.key]
    assert min(holds(limits, exact).values()) > 0.9


def test_errors_of_the_moduli_move_n1_behind_a_gain_that_takes_them_up_in_the_record():
    error = 0.05
    spectrum = RelaxationSpectrum(np.ones(1), np.ones(1), 0.0, 0.0, {}, np.array([[error**2]]))
    known, gain = replace(KNOWN, spectrum=spectrum), make_effect("stress_gain")
    found, flow, exact = explained(UpperConvectedMaxwell(), Instrument(gain=0.1), known, [gain])
    assert found[0].effects == ("stress_gain",)
    of_flow = found[0].predicted[flow.key]
    # N1 of a Maxwell fluid is in proportion to its modulus
    assert of_flow["N1"][1] == pytest.approx(error * exact["N1"], rel=0.02, abs=0.01)
    assert np.max(of_flow["sigma12"][1]) < 0.01 * np.max(exact["sigma12"])
    # a flow without a run of the data set is predicted alike
    for quantity, (mean, _) in found[0].predicted["a test"].items():
        np.testing.assert_allclose(mean, of_flow[quantity][0], atol=1e-9)


def test_what_shapes_the_command_is_no_candidate_where_the_rate_was_measured():
    run, _ = recorded(UpperConvectedMaxwell(), 1.0)
    names = {effect.name for effect in _admitted([run])}
    assert names - {e.name for e in _admitted([replace(run, rate_is_measured=True)])} == {
        name for name in names if getattr(make_effect(name), "shapes_command", False)
    }
    assert "rate_rise_time" in names


def test_sets_hold_two_effects_at_the_most_and_one_of_the_instrument():
    instrument = {"transducer_lag", "rate_rise_time"}
    sets = _sets(CANDIDATES)
    assert len(sets) == len(set(sets)) == 1 + 4 + 1 + 2 * 2
    assert all(len(names) <= 2 and len(instrument & {*names}) <= 1 for names in sets)


def test_a_structure_that_has_no_name_among_the_candidates_is_explained_by_nothing():
    found, *_ = explained(Thixotropic(UpperConvectedMaxwell(), 0.4, 3.0, 0.5, 2.0))
    assert found == ()


def test_the_dense_band_of_a_law_of_the_library_stays_and_holds_what_has_a_name_too():
    found, flow, exact = explained(Giesekus(0.3))
    assert found[0].effects == ("giesekus_mobility",)
    own = dense(flow, exact, 0.2)
    outcomes = with_named_effects({DENSE: own}, [flow], found)
    assert outcomes[DENSE].details[NAMED_BESIDE] == [flow.key]
    for quantity, (low, high) in outcomes[DENSE].bands[flow.key].items():
        assert np.all(low <= own.bands[flow.key][quantity][0])
        assert np.all(high >= own.bands[flow.key][quantity][1])
    assert outcomes[DENSE].predictions == own.predictions


def explanation(flow, curves, deviation=0.01, misfit=NOISE):
    """One that explains the runs, written by hand."""
    left = LackOfFit("explained", misfit, misfit, 0.0, 1.0)
    spread = {q: (c, np.full(len(c), deviation)) for q, c in curves.items()}
    return NamedExplanation(("wall_slip",), left, 0.0, {flow.key: spread})


def test_what_has_a_name_and_misses_the_held_out_record_is_in_no_band():
    unseen, exact = recorded(UpperConvectedMaxwell(), UNSEEN, seed=1)
    flow = as_flow(unseen)
    wrong = explanation(flow, {q: 1.2 * curve for q, curve in exact.items()})
    own = dense(flow, exact)
    outcomes = with_named_effects({DENSE: own}, [flow], [wrong])
    np.testing.assert_equal(outcomes[DENSE].bands, own.bands)


def test_what_has_a_name_makes_no_band_where_the_laws_of_the_library_have_none():
    unseen, exact = recorded(UpperConvectedMaxwell(), UNSEEN, seed=1)
    flow = as_flow(unseen)
    none = replace(dense(flow, exact), bands={flow.key: None})
    outcomes = with_named_effects({DENSE: none}, [flow], [explanation(flow, exact)])
    assert outcomes[DENSE].bands == {flow.key: None}
    assert outcomes[DENSE].details[NAMED_BESIDE] == []


def sparse(flow, curves, half_width=0.01):
    """A band of the sparse law about these curves, in one flow."""
    chosen = np.stack([*curves.values()], axis=1)
    low, high = (chosen + sign * half_width * np.max(chosen, axis=0) for sign in (-1.0, 1.0))
    return {flow.key: PredictionBand(flow.times, chosen, low, high, low, high, 0.0)}


def test_the_sparse_law_s_band_holds_n1_of_what_has_a_name_and_fits_alike():
    found, flow, exact = explained(Giesekus(0.3), Instrument(lag=0.1))
    # terms that follow the lag have another N1
    own = sparse(flow, exact | {"N1": 1.2 * exact["N1"]})
    wider = holding_named_effects(own, [flow], found, NOISE)[flow.key]
    low, high = wider.rivals_low[:, 1], wider.rivals_high[:, 1]
    assert np.mean((low <= exact["N1"]) & (exact["N1"] <= high)) > 0.9
    # the band of the law's own constants, and what it predicts, stay
    np.testing.assert_equal(wider.low, own[flow.key].low)
    np.testing.assert_equal(wider.chosen, own[flow.key].chosen)
    # and where the same law has the name, the band hardly grows
    right = sparse(flow, exact, 0.05)
    same = holding_named_effects(right, [flow], found, NOISE)[flow.key]
    np.testing.assert_allclose(same.widths()["N1"], right[flow.key].widths()["N1"], rtol=0.05)


def test_what_has_a_name_and_misses_the_held_out_record_is_in_no_sparse_band():
    unseen, exact = recorded(UpperConvectedMaxwell(), UNSEEN, seed=1)
    flow = as_flow(unseen)
    wrong = explanation(flow, {q: 1.2 * curve for q, curve in exact.items()})
    own = sparse(flow, exact)
    np.testing.assert_equal(holding_named_effects(own, [flow], [wrong], NOISE), own)


def test_only_what_is_determined_says_what_its_band_holds_beside():
    unseen, exact = recorded(UpperConvectedMaxwell(), UNSEEN)
    told = with_named_told(
        [Statement("N1", IN_LIBRARY, "Narrow."), Statement("N2", "no", "Open.")],
        [explanation(as_flow(unseen), exact)],
    )
    assert "wall_slip" in told[0].text
    assert told[1].text == "Open."


@pytest.mark.parametrize(("pattern", "refuted"), [(0.0, False), (1.0, True)])
def test_a_pattern_smaller_than_the_noise_refutes_laws_of_a_whole_library(pattern, refuted):
    unseen, exact = recorded(UpperConvectedMaxwell(), 1.0, seed=1)
    flow = as_flow(unseen, "training")
    size = np.sqrt(np.mean(exact["sigma12"] ** 2))
    wave = pattern * NOISE * size * np.sin(2.0 * unseen.time)
    curves = exact | {"sigma12": exact["sigma12"] + wave}
    found, said = without_refuted_bands({DENSE: dense(flow, curves)}, [flow], Expectation())
    assert (found[DENSE].bands[flow.key] is None) == refuted
    assert len(said) == refuted
