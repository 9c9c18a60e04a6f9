"""Where no run is held out, runs left out in turn refute constants that only all together have."""

import numpy as np
import pytest
from independent import KBKZ, Giesekus, start_up

import discover as dc
from discover.closed_loop.judging.left_out_in_turn import LeftOut, leave_out_in_turn
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.inference.problem import FitProblem
from discover.statistics.residual import STRUCTURE

SCALE = {"modulus": 100.0, "relaxation_time": 1.0}
RATES = (0.5, 1.0, 2.0)
TIMES = np.linspace(0.1, 8.0, 60)
NOISE = 0.01
OF_GIESEKUS = ("giesekus_mobility", "wall_slip")
BY_CHANCE = ("thixotropy", "stress_drift")


def problem_of(fluid, names, rates=RATES):
    """Return problem, fit and runs of two effects fitted to start-ups of a fluid, by scipy."""
    runs = []
    for seed, rate in enumerate(rates):
        stress = fluid.respond(start_up(rate), TIMES).sigma12
        noise = np.random.default_rng([7, seed]).normal(0.0, NOISE, len(TIMES))
        noisy = stress + np.sqrt(np.mean(stress**2)) * noise
        # a rate that is asked for again is another run
        name = f"{seed}_at_{rate:g}"
        runs.append(dc.Run(name, TIMES, dc.start_up(rate), np.full(len(TIMES), rate), noisy))
    declared = DeclaredModel.named("ucm", {}, np.array([100.0]), np.array([1.0]))
    effects = [make_effect(name) for name in names]
    model = AugmentedModel(declared, effects, data_scales(runs))
    problem = FitProblem(model, make_batch(runs))
    free = [at for name in names for at in model.positions(name)]
    starts = []
    for share in (0.1, 1.0):
        start = model.zero()
        start[free] = np.clip(share * model.first_trial[free], model.low[free], model.high[free])
        starts.append(start)
    return problem, problem.best_fit(starts, free), runs


@pytest.fixture(scope="module")
def right():
    return problem_of(Giesekus(0.3, **SCALE), OF_GIESEKUS)


@pytest.fixture(scope="module")
def wrong():
    return problem_of(KBKZ(0.25, **SCALE), BY_CHANCE)


def test_what_is_right_of_all_runs_is_right_of_each_left_out(right):
    problem, fit, runs = right
    left_out = leave_out_in_turn(problem, fit, runs)
    assert [one.name for one in left_out] == [run.name for run in runs]
    assert max(one.error for one in left_out) < STRUCTURE * NOISE
    # the constants of two start-ups are those of the third
    assert min(one.agreement for one in left_out) > 0.001


def test_what_follows_the_runs_by_chance_misses_each_left_out(wrong):
    problem, fit, runs = wrong
    left_out = leave_out_in_turn(problem, fit, runs)
    together = float(np.mean(fit.run_errors))
    assert together < STRUCTURE * NOISE  # which would pass for noise
    assert sum(one.is_missed(STRUCTURE * together) for one in left_out) > len(runs) / 2


def test_what_uncertain_constants_excuse_is_not_missed():
    assert LeftOut("run", 0.1, 1e-6).is_missed(0.05)
    assert not LeftOut("run", 0.1, 0.5).is_missed(0.05)
    assert not LeftOut("run", 0.01, 1e-6).is_missed(0.05)


def test_a_test_that_was_repeated_is_left_out_as_one():
    problem, fit, runs = problem_of(Giesekus(0.3, **SCALE), OF_GIESEKUS, (0.5, 2.0, 2.0))
    assert [one.name for one in leave_out_in_turn(problem, fit, runs)] == [
        runs[0].name,
        runs[1].name,
    ]
