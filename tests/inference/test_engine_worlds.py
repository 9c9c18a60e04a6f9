"""What the engine says of fluids that scipy simulated: names, sizes, bands; of noise nothing."""

from dataclasses import replace

import numpy as np
import pytest
from explained import explain
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import correlated
from independent.worlds import MODULUS, TIME, draw_world

import discover as dc
from discover.forward import DeclaredModel
from discover.inference import Problem
from discover.inference.design import design
from discover.inference.free_functions import free_functions
from discover.inference.posterior import _log_odds_of_smooth_misfit
from discover.loop.runs import split_runs
from discover.loop.task import candidates_of

GIESEKUS, MAXWELL, POM_POM = (1, 2), (1, 14), (2, 3)
"""Seed and index of worlds of the development seeds, all with a sound instrument."""

CLIPPED, SETTLING = (4, 50), (4, 48)
"""Exponential PTT on a transducer that saturates; linear PTT beside a zero that settles."""

FEW = ("giesekus_mobility", "ptt_exponential", "stress_gain", "stress_offset", "transducer_lag")
"""What there is to be wrong with: a law, a size, a zero and a delay."""


def problem_of(folder, runs, effects):
    data = dc.load_dataset(write_folder(folder, runs))
    held = [name for name in data.names if name.startswith("held_")]
    fitted, held_out, _ = split_runs(data, None, held, None, 400)
    declared = DeclaredModel.maxwell([MODULUS], [TIME])
    return Problem(declared, candidates_of(effects), fitted, held_out)


def ask(folder, seed, index, effects=None):
    """Return the posterior of a world among some effects or all, and its problem and truth."""
    world = draw_world(seed, index)
    runs = world.make(np.random.default_rng([seed, index, 1]))
    problem = problem_of(folder / f"{seed}-{index}", runs, effects)
    return explain(problem), problem, world


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("worlds")
    return {one: ask(folder, *one, FEW) for one in (GIESEKUS, MAXWELL, POM_POM)}


@pytest.mark.slow
def test_among_all_candidates_the_verdicts_are_those_among_a_few(tmp_path):
    found = [ask(tmp_path, *one)[0] for one in (GIESEKUS, MAXWELL, POM_POM)]
    verdicts = [posterior.verdict for posterior in found]
    assert verdicts == ["effects_added", "no_effect_needed", "unexplained"]
    assert found[0].explanations[0].members[0] == ("giesekus_mobility",)
    (curve,) = free_functions(ask(tmp_path, *CLIPPED)[0])
    assert (curve.form.slot, curve.form.beside) == ("recorded_stress", ("ptt_exponential",))


def inside(posterior, problem):
    """Return the share of samples that no fit saw in the bands of their runs."""
    rows, bands = problem.predicted, posterior.bands(problem.predicted)
    low, high = (np.concatenate([getattr(b, end)[:, 0] for b in bands]) for end in ("low", "high"))
    return np.mean((low <= rows.recorded) & (rows.recorded <= high)), np.mean(high - low)


def test_a_named_law_is_named_alone_a_declared_one_needs_none_and_no_other_is_explained(asked):
    posterior, problem, world = asked[GIESEKUS]
    assert posterior.verdict == "effects_added"
    assert posterior.explanations[0].members[0] == ("giesekus_mobility",)
    low, high = posterior.interval(problem.model.positions("giesekus_mobility")[0])
    assert low <= world.constants["giesekus_mobility"]["alpha"] <= high
    assert high - low < 0.05  # 480 samples with 1 % of noise
    posterior, *_ = asked[MAXWELL]
    assert posterior.verdict == "no_effect_needed"
    assert posterior.unexplained < 0.1
    posterior, *_ = asked[POM_POM]
    assert posterior.verdict == "unexplained"
    size = posterior.discrepancy()
    assert 0.001 < size.ci95[0] <= size.size <= size.ci95[1] < 1.0
    assert set(size.by_run) == {"a.csv", "b.csv", "c.csv", "d.csv"}


@pytest.mark.parametrize("world", [GIESEKUS, MAXWELL])
def test_what_a_hypothesis_explains_leaves_nothing(asked, world):
    posterior, *_ = asked[world]
    assert posterior.discrepancy().size == 0.0


@pytest.mark.parametrize("world", [GIESEKUS, MAXWELL, POM_POM])
def test_bands_hold_runs_that_no_fit_saw(asked, world):
    posterior, problem, _ = asked[world]
    share, width = inside(posterior, problem)
    # 95 % of 240 samples, three standard errors below, for those of one run are off together
    assert share > 0.9
    typical = np.sqrt(np.mean(problem.predicted.recorded**2))
    assert width < (4.0 if world == POM_POM else 0.2) * typical


def test_one_explanation_alone_asks_for_no_test_to_tell_it_from_another(asked):
    posterior, *_ = asked[MAXWELL]
    tests = design(posterior)
    assert len(tests.explanations) < 2 or tests.open_nats < 0.7  # two that are equally likely


def test_a_transducer_that_saturates_is_told_as_a_function_of_the_stress(tmp_path):
    posterior, _, world = ask(tmp_path, *CLIPPED, FEW)
    found = [one for one in free_functions(posterior) if one.is_shown]
    assert [one.form.slot for one in found] == ["recorded_stress"]
    (curve,) = found
    assert posterior.with_curves([curve]).verdict == "unexplained"
    assert "ptt_exponential" in curve.form.beside
    assert curve.form.nearest == "clipped"
    # beyond its limit a clipped record lacks what the stress exceeds it by, and below it nothing
    limit = max(np.max(np.abs(run.stress)) for run in world.make(None).values())
    lacking = -np.maximum(curve.form.grid - limit, 0.0)
    assert np.max(np.abs(curve.form.value - lacking)) < 0.1 * limit
    # the law beside it is that of the fluid: its constant lies in an interval of a tenth or less
    (law, _), *_ = curve.fits
    (at,) = posterior.problem.model.positions("ptt_exponential")
    low, high = law.interval(at)
    truth = world.constants["ptt_exponential"]["epsilon"]
    assert law.names == ("ptt_exponential",)
    assert low < truth < high < 1.1 * low


def test_runs_behind_a_transducer_that_saturates_are_predicted_to_a_tenth(tmp_path):
    posterior, problem, _ = ask(tmp_path, *CLIPPED, FEW)
    _, blind = inside(posterior, problem)
    share, width = inside(posterior.with_curves(free_functions(posterior)), problem)
    typical = np.sqrt(np.mean(problem.predicted.recorded**2))
    # as above; laws alone have whole bands of half the record or more
    assert share > 0.9
    assert width < 0.2 * typical < 0.4 * blind


@pytest.mark.slow
def test_a_transducer_that_bends_by_three_per_cent_is_weighed_by_the_runs_held_out_too(tmp_path):
    world = draw_world(*GIESEKUS)
    runs = world.make(np.random.default_rng(1))
    typical = max(np.sqrt(np.mean(run.stress**2)) for run in runs.values())
    bent = {
        name: replace(run, stress=run.stress * (1.0 + 0.03 * (run.stress / typical) ** 2))
        for name, run in runs.items()
    }
    posterior = explain(problem_of(tmp_path / "bent", bent, None))
    best = max(free_functions(posterior), key=lambda one: one.log_odds_in_all)
    assert (best.form.slot, best.form.beside) == ("recorded_stress", ("giesekus_mobility",))
    assert best.log_odds_in_all > best.log_odds  # held-out runs reach further
    assert posterior.with_curves([best]).verdict == "unexplained"


def of_instrument(folder, instrument, effects):
    """Return the posterior of a Giesekus fluid among some effects or all, on an instrument."""
    runs = replace(draw_world(*GIESEKUS), instrument=instrument).make(np.random.default_rng(1))
    return explain(problem_of(folder / "flawed", runs, effects))


@pytest.mark.parametrize("effects", [FEW, pytest.param(None, marks=pytest.mark.slow)])
def test_slip_that_goes_with_the_square_of_the_stress_is_told_as_a_curve(tmp_path, effects):
    slip = 0.3 / (MODULUS * TIME) / MODULUS
    posterior = of_instrument(tmp_path, Instrument(slip=slip, slip_power=2.0), effects)
    curve = free_functions(posterior)[0]
    assert (curve.form.slot, curve.form.beside) == ("slip", ("giesekus_mobility",))
    assert curve.is_shown
    assert curve.form.nearest == "quadratic"
    # straight lines between three stresses are off by a tenth of the curve at most
    assert np.allclose(
        curve.form.value, slip * curve.form.grid**2, atol=0.1 * slip * curve.form.grid[-1] ** 2
    )


def test_a_transducer_that_rings_is_told_by_its_response(tmp_path):
    frequency, damping = 9.0, 0.2
    instrument = Instrument(resonance=frequency, damping=damping)
    posterior = of_instrument(tmp_path, instrument, FEW)
    curve = free_functions(posterior)[0]
    assert (curve.form.slot, curve.form.beside) == ("response", ("giesekus_mobility",))
    assert curve.is_shown
    # of a resonator: ω² e^(-ζωs) sin(ω's)/ω', which a prior of decaying weights follows to a fifth
    damped = frequency * np.sqrt(1.0 - damping**2)
    exact = frequency**2 / damped * np.exp(-damping * frequency * curve.form.grid)
    exact *= np.sin(damped * curve.form.grid)
    assert np.sqrt(np.mean((curve.form.value - exact) ** 2)) < 0.2 * np.max(exact)


def test_a_transducer_that_lags_is_named_and_no_curve(tmp_path):
    candidates = ("giesekus_mobility", "transducer_lag")
    posterior = of_instrument(tmp_path, Instrument(lag=0.1), candidates)
    assert posterior.explanations[0].members[0] == candidates
    assert all(one.weight < np.log(0.05) for one in free_functions(posterior))


def test_slip_in_proportion_to_the_stress_is_no_curve(tmp_path):
    instrument = Instrument(slip=0.2 / (MODULUS * TIME))
    posterior = of_instrument(tmp_path, instrument, ("giesekus_mobility", "wall_slip"))
    assert posterior.explanations[0].members[0] == ("giesekus_mobility", "wall_slip")
    # as for any curve that is not there: less than 1 in 20
    assert all(one.weight < np.log(0.05) for one in free_functions(posterior))


@pytest.mark.slow
def test_a_zero_that_settles_is_told_as_a_function_of_time(tmp_path):
    posterior, *_ = ask(tmp_path, *SETTLING)
    (curve,) = [one for one in free_functions(posterior) if one.is_shown]
    assert curve.form.slot == "drift"
    assert "ptt_linear" in curve.form.beside


@pytest.mark.parametrize("world", [GIESEKUS, MAXWELL, POM_POM])
def test_no_curve_is_told_of_a_sound_instrument_named_law_or_not(asked, world):
    posterior, *_ = asked[world]
    found = free_functions(posterior)
    assert not any(one.is_shown for one in found)
    # in 1 of 20 at most it weighs as much as all that has a name
    assert all(one.log_odds_in_all < np.log(0.05) for one in found if world != POM_POM)


@pytest.mark.parametrize("seed", [1, 2])
def test_what_all_runs_leave_alike_is_no_noise_and_what_each_leaves_is(tmp_path, seed):
    # 5 % in one shape in four runs, and as much noise that decays by a factor of e in 20 samples
    shapes, noises = {}, {}
    runs = draw_world(*GIESEKUS).make(np.random.default_rng(1))
    for i, name in enumerate(("a.csv", "b.csv", "c.csv", "held_e.csv")):
        kept = {n: getattr(runs[name], n)[::3] for n in ("time", "rate", "stress")}
        run = replace(runs[name], **kept)
        size, place = 0.05 * np.sqrt(np.mean(run.stress**2)), np.linspace(0.0, 1.0, len(run.time))
        wave = np.sqrt(2.0) * np.cos(np.pi * (2.5 * place + 0.2 * seed))
        shapes[name] = replace(run, stress=run.stress + size * wave)
        slow = correlated(run.stress, 0.05, 0.95, np.random.default_rng([seed, i]))
        noises[name] = replace(run, stress=slow)
    alike = explain(problem_of(tmp_path / "alike", shapes, FEW))
    assert alike.unexplained > 0.99
    own = explain(problem_of(tmp_path / "own", noises, FEW))
    assert own.verdict == "effects_added"
    assert own.explanations[0].members[0] == ("giesekus_mobility",)
    # and so says the test that knows no curve; its log odds are even at 0
    shape, noise = (
        _log_odds_of_smooth_misfit(one.search.fitter, one.fits[0][0]) for one in (alike, own)
    )
    assert shape > 0.0 > noise
