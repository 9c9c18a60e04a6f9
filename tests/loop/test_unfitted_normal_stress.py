"""N1 that runs recorded beside a fitted σ12: predicted by the answer, and compared."""

from dataclasses import replace

import numpy as np
import pytest

from discover.dataset import Dataset, Run
from discover.loop import DeclaredModel, run_loop
from discover.loop.runs import unfitted_runs
from discover.protocols import start_up

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
TIMES = np.linspace(0.05, 6.0, 120)
# an upper-convected Maxwell fluid in start-up   [Bird, Armstrong & Hassager 1987, vol. 1, ch. 7]
GROWN = 1.0 - np.exp(-TIMES)
NORMAL = 1.0 - np.exp(-TIMES) * (1.0 + TIMES)


def run(name, rate, factor=1.0):
    lot = np.random.default_rng(int(100 * rate))
    both = MODULUS * rate * GROWN, factor * 2.0 * MODULUS * rate**2 * NORMAL
    noisy = [one + NOISE * np.std(one) * lot.standard_normal(len(one)) for one in both]
    return Run(name, TIMES, start_up(rate), np.full(len(TIMES), rate), *noisy)


def loop(*runs):
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    return run_loop(
        Dataset("made", runs), declared, effects=["ptt_linear", "stress_gain"], max_effects=1
    )


def test_recorded_n1_that_no_fit_saw_has_an_error_of_its_own():
    result = loop(run("slow", 0.3), run("middle", 0.6), run("fast", 1.2))
    assert [one.name for one in result.unfitted] == ["slow (N1)", "middle (N1)", "fast (N1)"]
    told = result.answer.expected("N1")
    # the law is right: of 1 % of noise at most half is left, and of a gain as much
    assert told.inside < 0.01
    # half as large, the record is missed by as much as it is
    wrong = loop(*(run(name, rate, 0.5) for name, rate in (("slow", 0.3), ("fast", 1.2))))
    assert wrong.answer.expected("N1").inside == pytest.approx(1.0, rel=0.05)
    assert wrong.verdict == result.verdict  # no judgement of σ12 knows of it
    assert wrong.answer.next_test.startswith("Correct N1 for axial compliance, then fit it")


def test_samples_of_n1_that_no_fluid_can_have_are_not_compared():
    right = run("right", 0.6)
    negative = replace(
        run("wrong", 1.2),
        first_normal_stress_difference=-run("", 1.2).first_normal_stress_difference,
    )
    assert [one.name for one in loop(right, negative).unfitted] == ["right (N1)"]


def test_a_part_of_a_run_without_a_sound_sample_of_n1_is_not_compared():
    whole = run("late", 1.2)
    early = np.where(TIMES < 3.0, -1.0, 1.0) * whole.first_normal_stress_difference
    whole = replace(whole, first_normal_stress_difference=early)
    data = Dataset("made", (run("right", 0.6), whole))
    assert unfitted_runs(data, [whole.window(TIMES < 1.0)]) == []
    (kept,) = unfitted_runs(data, [whole])  # control: of the whole run the later part is
    assert 2.0 < kept.time[0] < 4.0
