"""Which test would tell the explanations apart, on records by scipy."""

import numpy as np
import pytest
from independent import Giesekus
from independent.flow import start_up
from independent.folders import with_noise, write_folder
from independent.instruments import Instrument

import discover as dc
from discover.loop import NextTest, NextTests
from discover.closed_loop.results.next_test import DECISIVE, entropy
from discover.report.loop.verdict import loop_verdict

BASE = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)
TRUTH = Giesekus(0.5, 100.0, 1.0)
NOISE = 0.02
SLOW = {"slow.csv": (start_up(0.2), 8.0), "faster.csv": (start_up(0.6), 6.0)}
LAWS = ["giesekus_mobility", "non_affine_motion"]


def recorded(folder, flows, seed=0):
    runs = {
        name: Instrument().record(TRUTH, flow, np.linspace(0.05, end, 80))
        for name, (flow, end) in flows.items()
    }
    noisy = with_noise(runs, NOISE, np.random.default_rng(seed))
    return dc.load_dataset(write_folder(folder, noisy))


@pytest.fixture(scope="module")
def undecided(tmp_path_factory):
    folder = tmp_path_factory.mktemp("slow")
    return dc.close_loop(recorded(folder, SLOW), BASE, effects=LAWS, max_effects=1)


@pytest.mark.slow
def test_the_test_that_is_proposed_decides_for_the_law_that_made_the_records(undecided, tmp_path):
    following = undecided.next_tests
    assert set(following.explanations) == {(name,) for name in LAWS}
    start_ups = [t for t in following.tests if t.title.startswith("start-up of shear at 1.8 1/s")]
    (proposed,) = start_ups
    assert proposed.pairs == ((0, 1),)
    # as it is proposed, by scipy, with noise
    run = Instrument().record(TRUTH, start_up(1.8), proposed.samples)
    size = NOISE * np.sqrt(np.mean(run.stress**2))
    seen = run.stress + size * np.random.default_rng(1).standard_normal(run.stress.size)
    chi = [np.sum((seen - curve) ** 2) / size**2 for curve in proposed.curves]
    right = following.explanations.index(("giesekus_mobility",))
    # more than it was expected to bring: there, what constants can take up is taken off
    assert 0.5 * (chi[1 - right] - chi[right]) > DECISIVE
    data = recorded(tmp_path, SLOW | {"fast.csv": (start_up(1.8), 11.0)})
    loop = dc.close_loop(data, BASE, effects=LAWS, max_effects=1)
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    assert not loop.stages[0].aliases


def test_a_repeat_of_what_was_fitted_is_not_expected_to_decide(undecided):
    again = [t for t in undecided.next_tests.tests if t.title == "start-up of shear at 0.6 1/s"]
    assert again[0].pairs == ()
    assert again[0].nats < 0.5 * undecided.next_tests.open_nats


def test_no_test_tells_more_than_is_open(undecided):
    following = undecided.next_tests
    assert all(0.0 <= t.nats <= following.open_nats + 1e-9 for t in following.tests)
    # of two at even odds one bit is open
    assert entropy([0.5, 0.5]) == pytest.approx(np.log(2.0))


def test_the_verdict_names_the_test_and_both_laws(undecided):
    told = loop_verdict(undecided)[2]
    assert "Giesekus mobility" in told
    assert "non-affine motion" in told
    assert undecided.next_tests.best.title in told


def test_one_explanation_alone_asks_for_no_test(tmp_path):
    flows = SLOW | {"fast.csv": (start_up(3.0), 6.0)}
    data = recorded(tmp_path, flows)
    loop = dc.close_loop(data, BASE, effects=["giesekus_mobility"], max_effects=1)
    assert loop.next_tests == NextTests()
    assert loop.next_tests.best is None


def test_a_test_that_decides_nothing_is_not_proposed():
    curve = np.ones((2, 5))
    test = NextTest("dull", "sigma12", 0.0, np.zeros((2, 2)), np.arange(5.0), curve)
    assert NextTests((("a",), ("b",)), (0.5, 0.5), 0.01, (test,)).best is None
