"""What these data cannot tell apart is each other's alias; errors made up, and a stress by hand."""

import numpy as np
import pytest

from discover.loop import DeclaredModel, run_loop
from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.search.scoring.refitting import Choice, aliases_of
from discover.dataset import Dataset, Run
from discover.inference.least_squares import Fit
from discover.protocols import start_up

NO_FIT = Fit(np.zeros(1), (), np.zeros((1, 1)), np.zeros((0, 1, 1)))
BEST = np.array([[0.030, 0.028, 0.033, 0.031, 0.027, 0.032]] * 2)
SPREAD = np.array([0.006, -0.003, 0.007, -0.004, 0.005, -0.004])


def choice(name, evidence, parts):
    score = CandidateScore(name, "signal", 1.0, 0.0, evidence=evidence)
    return Choice(score, NO_FIT, parts[1], parts)


@pytest.mark.parametrize(
    ("evidence", "excess", "alias"),
    [
        (20.0, 0.020, True),  # evidence alone does not part them
        (5.0, SPREAD, True),  # a little worse in the mean, better in half of the parts
        (5.0, 0.002 + 0.0 * SPREAD, False),  # as little worse, but everywhere
        (5.0, 4.0 * np.abs(SPREAD), False),
        (-1.0, SPREAD, False),  # nothing speaks for it
    ],
)
def test_near_equals_are_aliases_and_what_is_worse_everywhere_is_none(evidence, excess, alias):
    best = choice("thixotropy", 23.0, BEST)
    other = choice("relaxation_mode", evidence, BEST + excess)
    assert (aliases_of(best, [best, other]) == ("relaxation_mode",)) == alias


@pytest.mark.slow
def test_one_start_up_cannot_tell_a_gain_of_the_rate_from_one_of_the_stress():
    # a linear fluid at one rate: the two multiply the same record
    time = np.linspace(0.1, 5.0, 60)
    stress = 1.2 * 100.0 * 0.01 * (1.0 - np.exp(-time))
    noise = 0.01 * np.sqrt(np.mean(stress**2)) * np.random.default_rng(0).normal(size=60)
    run = Run("one", time, start_up(0.01), np.full(60, 0.01), stress + noise)
    names = ["rate_gain", "stress_gain", "stress_drift"]
    result = run_loop(Dataset("x", (run,)), DeclaredModel.maxwell(100.0, 1.0), effects=names)
    (stage,) = result.stages
    assert {stage.effect, *stage.aliases} == {"rate_gain", "stress_gain"}
