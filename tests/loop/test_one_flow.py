"""What as many flows as constants tell was tested by no flow, and the loop says so."""

import numpy as np
import pytest
from independent import Giesekus
from independent import start_up as flow_at

import discover as dc
from discover.dataset.records.repeats import count_flows
from discover.protocols.control import steady_rates
from discover.report.loop import loop_verdict

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
TIMES = np.linspace(0.1, 6.0, 40)
BASE = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)


def run(name: str, rate: float, seed: int) -> dc.Run:
    stress = Giesekus(0.3, 100.0).respond(flow_at(rate), TIMES).sigma12
    noise = np.sqrt(np.mean(stress**2)) * np.random.default_rng(seed).normal(0, 0.01, len(TIMES))
    return dc.Run(name, TIMES, dc.start_up(rate), np.full(len(TIMES), rate), stress + noise)


def looped(*runs: dc.Run, **options):
    data = dc.Dataset("giesekus", runs)
    effects = ["giesekus_mobility", "ptt_linear"]
    return dc.close_loop(data, BASE, effects=effects, max_effects=1, **options)


@pytest.mark.parametrize("repeated", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_name_that_one_flow_alone_tells_is_fitted_and_not_tested(repeated):
    runs = [run("once", 2.0, 0), *([run("again", 2.0, 1)] if repeated else [])]
    loop = looped(*runs)
    assert loop.verdict == "effects_added"
    found, sure = loop_verdict(loop)
    assert found.startswith("Fitted, not tested")
    assert "there are as few flows as fitted constants" in sure
    assert "fitted to the noise" not in found
    assert loop.answer.next_test


def test_a_name_that_two_flows_tell_is_believed():
    loop = looped(run("slow", 0.7, 0), run("fast", 2.0, 1))
    assert loop.verdict == "effects_added"
    assert loop.explanations.inclusion["giesekus_mobility"] > 0.5
    assert not loop.remaining["untested"]
    assert "Fitted, not tested" not in loop_verdict(loop)[0]


def test_a_declared_law_with_nothing_fitted_is_tested_by_any_flow():
    shear = 100.0 * 2.0 * (1.0 - np.exp(-TIMES))
    stress = shear * (1 + np.random.default_rng(0).normal(0, 0.01, len(TIMES)))
    maxwell = dc.Run("only", TIMES, dc.start_up(2.0), np.full(len(TIMES), 2.0), stress)
    loop = looped(maxwell)
    assert loop.verdict == "no_effect_needed"
    assert loop.explanations.unexplained_probability < 0.5


def test_the_points_of_a_flow_curve_are_flows_of_their_own():
    assert count_flows([run("only", 1.0, 0)]) == 1
    assert count_flows([run("once", 1.0, 0), run("again", 1.0, 1)]) == 1
    assert count_flows([run("slow", 1.0, 0), run("fast", 2.0, 1)]) == 2
    rates = np.geomspace(0.1, 10.0, 12)
    curve = dc.Run("curve", np.arange(12.0), steady_rates(rates), rates, 100.0 * rates)
    assert count_flows([curve]) == 12
