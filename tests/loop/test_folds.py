"""Loops that leave one run out judge what the loop on all runs says."""

import numpy as np
import pytest

import discover as dc
from discover.closed_loop.each_run import judged_by
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanation, Explanations
from discover.closed_loop.results.loop_result import LoopResult
from discover.closed_loop.results.stages import Fold

TIMES = np.linspace(0.05, 5.0, 40)


@pytest.fixture(scope="module")
def explained() -> LoopResult:
    """A Maxwell fluid in start-up, in closed form, as which it was declared."""
    runs = [
        dc.Run(
            f"at_{rate:g}",
            TIMES,
            dc.start_up(rate),
            np.full(len(TIMES), rate),
            100.0 * rate * (1.0 - np.exp(-TIMES)) * np.random.default_rng(seed).normal(1, 0.01, 40),
        )
        for seed, rate in enumerate((0.5, 1.0, 2.0))
    ]
    base = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)
    data = dc.Dataset("maxwell", tuple(runs))
    options = {"effects": ["giesekus_mobility"], "max_effects": 1, "explanations": 1}
    return dc.close_loop(data, base, **options)


def folds(*verdicts):
    return [Fold(f"run {i}", verdict, (), 0.1, 0.01) for i, verdict in enumerate(verdicts)]


@pytest.mark.slow
def test_what_most_loops_without_a_run_do_not_explain_is_unexplained(explained):
    assert explained.verdict == "no_effect_needed"
    judged = judged_by(
        explained, folds("unexplained", "unexplained", "unexplained", "no_effect_needed")
    )
    assert judged.verdict == "unexplained"
    assert (
        "of 4 searches that each left one run out 3 end in unexplained"
        in judged.remaining["description"]
    )
    assert not judged.remaining["carries_over"]
    # Laplace's rule: (3 + 1)/(4 + 2)
    assert judged.explanations.unexplained_probability == pytest.approx(2 / 3)
    listed = sum(one.probability for one in judged.explanations.likeliest_first)
    assert listed == pytest.approx(1 / 3)


def test_one_loop_that_cannot_predict_the_run_left_out_refutes_nothing(explained):
    some = folds("unexplained", "no_effect_needed", "no_effect_needed")
    assert judged_by(explained, some) is explained


def test_doubt_takes_from_every_explanation_alike_and_never_adds():
    one = Explanation(("wall_slip",), 0.6, ErrorPair(0.01, None), {})
    other = Explanation((), 0.2, ErrorPair(0.01, None), {})
    found = Explanations((one, other), 0.2, {"wall_slip": 0.6}, {"kinematic": 0.6})
    doubted = found.doubted(0.6)
    assert [e.probability for e in doubted.likeliest_first] == pytest.approx([0.3, 0.1])
    assert doubted.inclusion["wall_slip"] == pytest.approx(0.3)
    assert found.doubted(0.1) is found
