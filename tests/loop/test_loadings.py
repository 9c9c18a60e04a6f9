"""A loop whose runs are loadings of their own: records by scipy, with a factor on each."""

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import imposed_stress, oscillatory_shear
from discover.protocols import start_up as protocol
from discover.report.loop import how_sure

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
    "held.csv": (start_up(3.0), protocol(3.0), GROWTH),
}
FACTORS = {"slow.csv": 1.03, "fast.csv": 0.97, "wave.csv": 1.01, "held.csv": 1.025}
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion"]
pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")


def records(law):
    return {name: law.respond(flow, times) for name, (flow, _, times) in FLOWS.items()}


@pytest.fixture(scope="module")
def exact():
    return records(Giesekus(0.3, 100.0))


def data_of(answers, factors, normal=False):
    lot, runs = np.random.default_rng(4), []

    def noisy(values, factor):
        size = 0.01 * np.sqrt(np.mean(values**2))
        return factor * values + size * lot.standard_normal(len(values))

    for name, (flow, own, times) in FLOWS.items():
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        factor = factors.get(name, 1.0)
        stress = noisy(answers[name].sigma12, factor)
        n1 = noisy(answers[name].N1, factor) if normal else None
        runs.append(Run(name, times, own, rates, stress, first_normal_stress_difference=n1))
    return Dataset("runs", tuple(runs))


def closed(data, **options):
    fluid = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    options = {"effects": EFFECTS, "max_effects": 2, "held_out": ["held.csv"], **options}
    return dc.close_loop(data, fluid, **options)


@pytest.fixture(scope="module")
def loaded(exact):
    return closed(data_of(exact, FACTORS), loading=0.03, explanations=1)


def mobility(loop):
    (stage,) = loop.stages
    assert stage.effect == "giesekus_mobility"
    return stage.parameters["alpha"].ci95


def test_mobility_is_found_in_runs_of_different_loadings(loaded):
    assert loaded.verdict == "effects_added"
    low, high = mobility(loaded)
    assert low < 0.3 < high
    # beside loadings, gain and clock of a sound bench, each 1 %
    assert high - low < 0.05


def test_factors_lie_in_their_intervals(loaded):
    found = loaded.remaining["loading"]
    assert {name: one["held_out"] for name, one in found.items()} == {
        name: False for name in FACTORS if name != "held.csv"
    }
    for name, one in found.items():
        low, high = one["ci95"]
        assert low < FACTORS[name] < high < low + 0.06


def test_error_of_a_run_held_out_is_that_of_a_prediction_without_its_factor(loaded):
    assert 0.02 < loaded.error_after.held_out < 0.035
    assert loaded.error_after.fit < 0.015
    assert loaded.held_in_band > 0.9


def test_it_is_said_to_hold_if_loadings_differ_so(loaded):
    assert "loading factor, fitted jointly (3 % scatter)" in how_sure(loaded)


@pytest.mark.slow
def test_page_has_the_factors_of_loadings(loaded, tmp_path):
    page = loaded.to_html(tmp_path / "page.html").read_text()
    assert 'id="loadings"' in page
    assert "loading /" not in page


@pytest.mark.slow
def test_runs_of_one_loading_have_the_same_answer_with_wider_intervals(exact):
    data = data_of(exact, {})
    plain, free = (closed(data, max_effects=1, loading=one) for one in (None, 0.03))
    assert plain.verdict == free.verdict == "effects_added"
    assert "loading" not in plain.remaining
    low, high = mobility(free)
    assert low < 0.3 < high
    for one in free.remaining["loading"].values():
        assert one["ci95"][0] < 1.0 < one["ci95"][1]


@pytest.mark.slow
def test_without_loadings_runs_far_apart_are_unexplained(exact):
    # runs of a sound bench differ by half a per cent: 9 % are out of the question
    far = {run: 1.0 + 3.0 * (factor - 1.0) for run, factor in FACTORS.items()}
    loop = closed(data_of(exact, far), effects=EFFECTS[:1], max_effects=1)
    assert loop.verdict == "unexplained"
    assert "loading" not in loop.remaining


@pytest.mark.slow
def test_modulus_is_told_no_better_than_loadings_differ(exact):
    base = dc.Fluid(dc.make_law("ucm"), [90.0], [1.0])
    data = data_of(exact, FACTORS)
    loop = dc.close_loop(
        data, base, effects=EFFECTS, max_effects=1, free=["modulus_Pa"], loading=0.03
    )
    low, high = loop.declared_parameters["modulus_Pa"].ci95
    assert low < 100.0 < high
    assert 4.0 < high - low < 10.0  # 3 % over the root of four loadings, both ways: 5.9 Pa


@pytest.mark.parametrize("loading", [0.0, -0.03, 0.2, True])
def test_what_no_loadings_differ_by_is_refused(exact, loading):
    with pytest.raises(dc.InputError, match="loading"):
        closed(data_of(exact, {}), loading=loading)


def test_a_stress_that_was_imposed_has_no_loading(exact):
    times = np.linspace(0.1, 5.0, 40)
    creep = imposed_stress(times, np.full(40, 20.0))
    strain = 0.2 * (1.0 + times)
    run = Run("creep.csv", times, creep, np.full(40, 0.2), np.full(40, 20.0), strain=strain)
    data = Dataset("runs", (*data_of(exact, {}), run))
    with pytest.raises(dc.InputError, match="imposed"):
        closed(data, loading=0.03)
