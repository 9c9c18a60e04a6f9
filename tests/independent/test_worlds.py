"""The worlds by which the software is judged, and the counts of what it said of them."""

import numpy as np
import pytest
from calibration import calibration_error, comparison_table, is_right, loop_table, share
from independent.worlds import FLOWS, NOISES, draw_world, known_flaws, known_laws, unknown_laws


def test_worlds_hold_every_law_flaw_protocol_and_noise():
    worlds = [draw_world(1, index) for index in range(500)]

    def draw(low, high):
        return 0.5 * (low + high)

    assert {w.law for w in worlds} == {*known_laws(draw), *unknown_laws(draw)}
    assert len({w.law for w in worlds}) >= 12
    assert {w.flaw for w in worlds} >= {"sound", *known_flaws(draw), "saturated", "ringing"}
    assert {w.protocol for w in worlds} == {*FLOWS}
    assert {w.noise for w in worlds} == {*NOISES}
    # K-BKZ is damping by strain exactly where no flow turns
    named = [w for w in worlds[1::2] if w.inside]
    assert {(w.law, w.protocol) for w in named} == {("K-BKZ", "start-ups")}
    assert len(named) < 20
    assert sum(w.inside for w in worlds[::2]) > 150


def test_a_world_is_the_same_by_its_seed_and_holds_the_law_that_it_names():
    def stress(seed):
        runs = draw_world(seed, 2).make(np.random.default_rng(0))
        return np.concatenate([run.stress for run in runs.values()])

    np.testing.assert_array_equal(stress(1), stress(1))
    assert not np.array_equal(stress(1), stress(2))
    world = next(w for i in range(0, 200, 2) if (w := draw_world(1, i)).library_laws)
    exact, noisy = world.make(None), world.make(np.random.default_rng(0))
    for name, run in exact.items():
        np.testing.assert_array_equal(run.stress, run.true.sigma12)
        off = np.linalg.norm(noisy[name].stress - run.stress) / np.linalg.norm(run.stress)
        assert 0.0 < off < 0.2


TWO = [["ptt_linear", "tr(sigma)*sigma"], ["stress_gain"]]


@pytest.mark.parametrize(
    ("members", "effects", "right"),
    [
        ([["wall_slip"], ["stress_gain", "tr(sigma)*sigma"]], TWO, True),
        ([["ptt_linear"]], TWO, False),
        ([["ptt_linear", "stress_gain", "wall_slip"]], TWO, False),
        ([["ptt_linear", "tr(sigma)*sigma"]], TWO, False),
        ([[]], [], True),
        ([["ptt_linear"]], [], False),
        ([[]], None, False),
    ],
)
def test_an_answer_is_right_if_a_twin_names_all_there_is_and_no_more(members, effects, right):
    assert is_right(members, effects) == right


def test_calibration_error_is_what_was_said_less_what_was_so_and_few_cases_leave_little_open():
    said = np.array([0.9, 0.9, 0.9, 0.9, 0.1, 0.1])
    error, _ = calibration_error(said, np.array([1, 1, 1, 0, 0, 0]))
    assert error == pytest.approx(4 / 6 * 0.15 + 2 / 6 * 0.1)
    # said with certainty, and right
    assert calibration_error(np.array([1.0, 0.0]), np.array([1, 0]))[0] == 0.0
    # Clopper & Pearson 1934: of n trials without a hit the upper end is 1 − 0.025^(1/n)
    assert share(0, 100) == f"0 of 100 (0 to {100 * (1 - 0.025 ** (1 / 100)):.0f} %)"


def case(effects, verdict, members, probability, **more):
    return {
        "index": 0, "law": "a law", "flaw": "sound", "protocol": "steps", "noise": "white",
        "effects": effects, "verdict": verdict, "inclusion": {}, "constants": [], "bands": [],
        "explanations": [{"members": members, "probability": probability}],
        "unexplained_probability": 1.0 - probability, "processor_seconds": 1.0,
        "library_laws": [], "terms": [], **more,
    }  # fmt: skip


def band(quantity, inside):
    return {"source": "tensor_sindy", "run": "e", "quantity": quantity, "inside": inside,
            "half_width": 0.1}  # fmt: skip


def curve(quantity, off):
    return {"source": "posterior", "run": "e", "quantity": quantity, "off": off}


LOOPS = [
    case([["wall_slip"]], "effects_added", [["wall_slip"]], 1.0,
         constants=[{"ci95": [0.0, 1.0], "truth": 0.5}]),
    case([["wall_slip"]], "effects_added", [["stress_gain"]], 1.0,
         inclusion={"stress_gain": 0.8, "wall_slip": 0.2}),
    case([], "effects_added", [["stress_gain"]], 1.0),
    case(None, "effects_added", [["stress_gain"]], 1.0),
    case(None, "unexplained", [["stress_gain"]], 0.1),
]  # fmt: skip
OF_LOOPS = [
    "in the likeliest class: 1 of 2", "a name beside it, 50 % or more: 1 of 2",
    "named where there is none: 1 of 1", "where something has none: 1 of 2",
    "but: 0, a law, sound, steps, white: effects_added, stress_gain 1.00",
    "hold the constant: 1 of 1",
]  # fmt: skip
LEARNERS = [
    case([], "explained", [[]], 1.0, bands=[band("N1", 0.95), band("N1", 0.5)]),
    case(None, "unexplained", [[]], 0.0, bands=[band("N2", 1.0)]),
]
OF_LEARNERS = [
    "tensor_sindy, N1: 72.5 % of the samples, runs held to 90 % 1 of 2",
    "tensor_sindy, N2: 100.0 %", "something has none: explained in 0 of 1",
]  # fmt: skip
DETERMINED = [
    case([], "explained", [[]], 1.0, library_laws=[{"sigma.sigma": 0.2}], undetermined=["N2"],
         terms=[{"term": "sigma.sigma", "ci95": [0.18, 0.22]}],
         bands=[curve("N1", 0.01), curve("N2", 0.5)]),
    case([], "explained", [[]], 1.0, library_laws=[{"sigma.sigma": 0.2}], undetermined=[],
         bands=[curve("N1", 0.2), curve("N2", 0.05)]),
]  # fmt: skip
OF_DETERMINED = [
    "found alone: 1 of 2", "hold the coefficient: 1 of 1", "off by a tenth: 1 of 3", "N1 by 20 %",
]  # fmt: skip


@pytest.mark.parametrize(
    ("table", "cases", "counts"),
    [
        (loop_table, LOOPS, OF_LOOPS),
        (comparison_table, LEARNERS, OF_LEARNERS),
        (comparison_table, DETERMINED, OF_DETERMINED),
    ],
    ids=["false loops", "learners and quantities apart", "determined, and not so"],
)
def test_a_table_counts_what_was_said_and_was_so(table, cases, counts):
    for count in counts:
        assert count in table(cases)
