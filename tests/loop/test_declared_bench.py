"""A bench that is declared: effects with or without a value, and a scatter of the loadings."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from noisy_runs import start_ups

import discover as dc
from discover.dataset import Dataset, Run
from discover.effects import known_effects
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.loop import run_loop
from discover.protocols import imposed_stress, oscillatory_shear
from discover.protocols import start_up as protocol
from discover.report.loop import how_sure

MOBILITY, GAIN = 0.3, -0.1
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion"]
pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")


def mobility(loop):
    (stage,) = loop.stages
    assert stage.effect == "giesekus_mobility"
    return stage.parameters["alpha"].ci95


@pytest.fixture(scope="module")
def weak():
    """Start-ups of a Giesekus fluid whose stress is read ten per cent too small, 1 % noise."""
    times = np.geomspace(0.05, 8.0, 40)
    return start_ups(Giesekus(MOBILITY), (0.2, 0.6, 2.0, 4.0), times, seed=2, factor=1.0 + GAIN)


def beside(data, effects):
    declared = DeclaredModel.maxwell(1.0, 1.0, effects=known_effects(effects))
    candidates = ["giesekus_mobility", "ptt_linear", "stress_gain"]
    return run_loop(data, declared, effects=candidates, max_effects=2, explanations=1)


def test_a_known_effect_is_not_found_again_and_is_in_the_error_before(weak):
    known = beside(weak, {"stress_gain": {"gain_error": GAIN}})
    low, high = mobility(known)
    assert low <= MOBILITY <= high
    (effect,) = known.declared_effects
    assert effect.parameters["gain_error"].ci95 is None
    assert effect.parameters["gain_error"].value == GAIN
    slow = weak.runs[0]
    without = 0.2 * -np.expm1(-slow.time)  # a Maxwell fluid of G = 1 Pa and λ = 1 s in start-up
    assert np.linalg.norm(without - slow.stress) / np.linalg.norm(slow.stress) > 0.08
    # in slow flow that fluid and the gain are all there is
    assert known.records[0].errors[0] < 0.04


def test_one_to_be_fitted_is_not_found_again_and_is_reported_with_its_interval(weak):
    fitted = beside(weak, {"stress_gain": "fit"})
    low, high = mobility(fitted)
    assert low <= MOBILITY <= high
    (effect,) = fitted.declared_effects
    low, high = effect.parameters["gain_error"].ci95
    assert low <= GAIN <= high
    assert high - low < 0.07  # 1 % noise on 160 samples, and a gain that is sound to 1 %
    said = fitted.to_json()["declared"]
    assert said["effects"][0]["effect"] == "stress_gain"
    assert said["law"]["terms"] == []


def test_what_shapes_a_command_is_refused_where_the_rate_was_measured(weak):
    measured = Dataset("m", tuple(replace(run, rate_is_measured=True) for run in weak))
    with pytest.raises(InputError, match="measured at the tool"):
        beside(measured, {"rate_rise_time": {"tau": 0.02}})


GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
    "held.csv": (start_up(3.0), protocol(3.0), GROWTH),
}
FACTORS = {"slow.csv": 1.03, "fast.csv": 0.97, "wave.csv": 1.01, "held.csv": 1.025}


@pytest.fixture(scope="module")
def exact():
    law = Giesekus(MOBILITY, 100.0)
    return {name: law.respond(flow, times).sigma12 for name, (flow, _, times) in FLOWS.items()}


def data_of(answers, factors):
    lot, runs = np.random.default_rng(4), []
    for name, (flow, own, times) in FLOWS.items():
        size = 0.01 * np.sqrt(np.mean(answers[name] ** 2))
        stress = factors.get(name, 1.0) * answers[name] + size * lot.standard_normal(len(times))
        runs.append(Run(name, times, own, np.asarray(flow.rate(times), float), stress))
    return Dataset("runs", tuple(runs))


def closed(data, modulus=100.0, **options):
    fluid = dc.Fluid(dc.make_law("ucm"), [modulus], [1.0])
    options = {"effects": EFFECTS, "max_effects": 2, "held_out": ["held.csv"], **options}
    return dc.close_loop(data, fluid, **options)


@pytest.fixture(scope="module")
def loaded(exact):
    return closed(data_of(exact, FACTORS), loading=0.03, explanations=1)


def test_mobility_is_found_in_runs_of_different_loadings_whose_scatter_is_said(loaded):
    assert loaded.verdict == "effects_added"
    low, high = mobility(loaded)
    assert low < MOBILITY < high
    # beside loadings, gain and clock of a sound bench, each 1 %
    assert high - low < 0.05
    assert "loading factor, fitted jointly (3 % scatter)" in how_sure(loaded)


def test_factors_lie_in_their_intervals_and_a_run_held_out_is_predicted_without_its_own(loaded):
    found = loaded.remaining["loading"]
    assert {name: one["held_out"] for name, one in found.items()} == {
        name: False for name in FACTORS if name != "held.csv"
    }
    for name, one in found.items():
        low, high = one["ci95"]
        assert low < FACTORS[name] < high < low + 0.06
    assert 0.02 < loaded.error_after.held_out < 0.035
    assert loaded.error_after.fit < 0.015
    assert loaded.held_in_band > 0.9


@pytest.mark.slow
def test_page_has_the_factors_of_loadings(loaded, tmp_path):
    page = loaded.to_html(tmp_path / "page.html").read_text()
    assert 'id="loadings"' in page
    assert "loading /" not in page


@pytest.mark.slow
def test_runs_of_one_loading_have_the_same_answer_and_far_apart_are_unexplained_without(exact):
    data = data_of(exact, {})
    plain, free = (closed(data, max_effects=1, loading=one) for one in (None, 0.03))
    assert plain.verdict == free.verdict == "effects_added"
    assert "loading" not in plain.remaining
    low, high = mobility(free)
    assert low < MOBILITY < high
    for one in free.remaining["loading"].values():
        assert one["ci95"][0] < 1.0 < one["ci95"][1]
    # runs of a sound bench differ by half a per cent: 9 % are out of the question
    far = {run: 1.0 + 3.0 * (factor - 1.0) for run, factor in FACTORS.items()}
    loop = closed(data_of(exact, far), effects=EFFECTS[:1], max_effects=1)
    assert loop.verdict == "unexplained"
    assert "loading" not in loop.remaining


@pytest.mark.slow
def test_modulus_is_told_no_better_than_loadings_differ(exact):
    options = {"max_effects": 1, "free": ["modulus_Pa"], "loading": 0.03, "held_out": []}
    loop = closed(data_of(exact, FACTORS), 90.0, **options)
    low, high = loop.declared_parameters["modulus_Pa"].ci95
    assert low < 100.0 < high
    assert 4.0 < high - low < 10.0  # 3 % over the root of four loadings, both ways: 5.9 Pa


@pytest.mark.parametrize("loading", [0.0, -0.03, 0.2, True])
def test_what_no_loadings_differ_by_is_refused(exact, loading):
    with pytest.raises(InputError, match="loading"):
        closed(data_of(exact, {}), loading=loading)


def test_a_stress_that_was_imposed_has_no_loading(exact):
    times = np.linspace(0.1, 5.0, 40)
    creep, strain = imposed_stress(times, np.full(40, 20.0)), 0.2 * (1.0 + times)
    run = Run("creep.csv", times, creep, np.full(40, 0.2), np.full(40, 20.0), strain=strain)
    with pytest.raises(InputError, match="imposed"):
        closed(Dataset("runs", (*data_of(exact, {}), run)), loading=0.03)
