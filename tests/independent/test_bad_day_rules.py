"""The rules by which a claim is a confident falsehood, on claims written by hand."""

import json
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from bad_day_cases import CASES, Case, recorded, white
from bad_day_rules import judge
from bad_days import make, write
from bad_days import run as run_case
from independent import Giesekus

MOBILITY = {"giesekus_mobility": {"alpha": 0.3}}
KNOWN = Case("UCM", recorded())
PLANTED = Case("Giesekus", recorded(Giesekus(0.3, 100.0)), planted=MOBILITY)
OUTSIDE = Case("something else", recorded(), outside=True)
EMPTY = Case("nothing", recorded(), signal=False)
MADE: dict[str, tuple] = {}


def made(case):
    """Return the runs of a case, made once."""
    if case.truth not in MADE:
        MADE[case.truth] = make(case, 0)
    return MADE[case.truth]


def stage(effect, aliases=(), **parameters):
    values = {
        name: {"value": value, "ci95": list(interval)}
        for name, (value, interval) in parameters.items()
    }
    return {"effect": effect, "aliases": list(aliases), "parameters": values}


def claim(tmp_path, case, verdict, stages=(), off=0.0):
    """Return the falsehoods of a loop whose prediction is off by this many times the noise."""
    clean, noisy = made(case)
    lines = ["run,role,quantity,source,time_s,value,low95,high95"]
    for name, run in clean.items():
        role = "held_out" if name in case.held_out else "fit"
        level = np.sqrt(np.mean((noisy[name].stress - run.stress) ** 2))
        for time, stress in zip(run.time, run.stress, strict=True):
            lines.append(f"{name},{role},sigma12,augmented,{time:.9g},{stress + off * level:.9g},,")
    (tmp_path / "predictions.csv").write_text("\n".join(map(str, lines)))
    said = {"verdict": verdict, "stages": list(stages)}
    (tmp_path / "loop.json").write_text(json.dumps(said))
    return judge(case, "close-loop", tmp_path, clean, noisy)["falsehoods"]


@pytest.mark.parametrize("verdict", ["effects_added", "no_effect_needed"])
def test_to_explain_nothing_is_false(tmp_path, verdict):
    assert claim(tmp_path, EMPTY, verdict)


@pytest.mark.parametrize("verdict", ["unexplained", "no_signal"])
def test_to_claim_nothing_is_never_false(tmp_path, verdict):
    for case in (EMPTY, OUTSIDE, PLANTED, KNOWN):
        assert not claim(tmp_path, case, verdict, [stage("wall_slip")], off=3.0)


def test_to_explain_what_is_missed_is_false_and_what_is_met_is_not(tmp_path):
    assert claim(tmp_path, OUTSIDE, "no_effect_needed", off=0.8)
    assert not claim(tmp_path, OUTSIDE, "no_effect_needed", off=0.2)


def test_a_name_must_be_planted_or_an_alias_of_what_is(tmp_path):
    right = {"alpha": (0.31, (0.29, 0.33))}
    assert not claim(tmp_path, PLANTED, "effects_added", [stage("giesekus_mobility", **right)])
    alias = stage("ptt_linear", ["giesekus_mobility"])
    assert not claim(tmp_path, PLANTED, "effects_added", [alias])
    assert claim(tmp_path, PLANTED, "effects_added", [stage("ptt_linear", ["wall_slip"])])
    assert claim(tmp_path, KNOWN, "effects_added", [stage("ptt_linear")])
    assert claim(tmp_path, PLANTED, "no_effect_needed", off=2.0)


def test_an_interval_may_miss_by_three_half_widths_and_no_more(tmp_path):
    near = {"alpha": (0.34, (0.32, 0.36))}
    far = {"alpha": (0.40, (0.38, 0.42))}
    assert not claim(tmp_path, PLANTED, "effects_added", [stage("giesekus_mobility", **near)])
    assert claim(tmp_path, PLANTED, "effects_added", [stage("giesekus_mobility", **far)])


@pytest.mark.parametrize(
    ("statement", "half_band", "off", "false"),
    [
        ({"undetermined": ["N1"]}, 0.0, 0.5, False),
        ({"statements": [{"quantity": "N1", "determined": "no"}]}, 0.0, 0.5, False),
        ({}, None, 0.5, True),
        ({}, 0.1, 0.5, True),
        ({}, 0.1, 0.15, False),
    ],
)
def test_a_normal_stress_that_is_determined_holds_within_two_bands(
    tmp_path, statement, half_band, off, false
):
    clean, noisy = made(KNOWN)
    lines = ["run,role,quantity,source,time_s,value,low95,high95"]
    for name, run in clean.items():
        size = np.sqrt(np.mean(run.N1**2))
        for time, first in zip(run.time, run.N1, strict=True):
            value = first + off * size
            low, high = (value + side * (half_band or 0.0) * size for side in (-1, 1))
            band = "," if half_band is None else f"{low},{high}"
            lines.append(f"{name},fit,N1,tensor_sindy,{time},{value},{band}")
    (tmp_path / "predictions.csv").write_text("\n".join(lines))
    said = {"verdict": "unexplained", "learners": {"tensor_sindy": {}}, **statement}
    (tmp_path / "comparison.json").write_text(json.dumps(said))
    found = judge(KNOWN, "compare", tmp_path, clean, noisy)["falsehoods"]
    assert bool(found) == false


def test_the_cases_are_sixty_and_reproduce(tmp_path):
    assert len(CASES) >= 60
    assert sum(case.compare is not None for case in CASES.values()) >= 20
    kinds = Counter(
        "empty" if not c.signal else "outside" if c.outside else "planted" if c.planted else "sound"
        for c in CASES.values()
    )
    assert min(kinds.values()) >= 5
    one, other = (make(CASES["white_metzner"], 3)[1]["fast.csv"].stress for _ in range(2))
    np.testing.assert_array_equal(one, other)
    studies = write(CASES["two_mode_giesekus_known_modes"], made(KNOWN)[1], tmp_path)
    assert set(studies) == {"close-loop", "compare"}
    assert (tmp_path / "data" / "lve.csv").exists()
    assert white(0.0)(one, np.random.default_rng(0)) is not one


@pytest.mark.parametrize(
    ("task", "loop"),
    [
        # few candidates are a small program
        ("close-loop", {"effects": ["giesekus_mobility", "stress_gain", "tool_compliance"]}),
        pytest.param("close-loop", {}, marks=pytest.mark.slow),
        pytest.param("compare", {}, marks=pytest.mark.slow),
    ],
    ids=["few candidates", "close-loop", "compare"],
)
def test_a_dead_sensor_goes_through_the_whole_program_without_a_claim(
    task, loop, tmp_path, monkeypatch
):
    monkeypatch.setitem(CASES, "dead_sensor", replace(CASES["dead_sensor"], loop=loop))
    row = run_case("dead_sensor", task, tmp_path, 0, pages=False)
    assert row["verdict"] in ("no_signal", "unexplained", "refused"), row.get("message")
    assert not row["falsehoods"]
