"""The rules by which a claim is a confident falsehood, on claims written by hand."""

import ast
from dataclasses import replace

import hostile
import numpy as np
import product
import pytest
from hostile import GROUPS, case_named, judge, make
from independent.noise import rms
from run import ask

KNOWN, PLANTED = case_named("control_ucm"), case_named("mobility")
OUTSIDE, EMPTY = replace(KNOWN, outside=True), case_named("dead_sensor")
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


def claim(case, verdict, stages=(), off=0.0, **more):
    """Return the falsehoods of a loop whose prediction is off by this many times the noise."""
    clean, noisy = made(case)
    rows = {}
    for name, run in clean.items():
        exact = run.columns["stress_Pa"]
        size = rms(noisy[name].columns["stress_Pa"] - exact)
        rows[name, "sigma12", "augmented"] = {
            "time": run.columns["time_s"],
            "value": exact + off * size,
        }
    said = {"verdict": verdict, "stages": list(stages), **more}
    return judge(case, "close-loop", said, rows, clean, noisy)["false"]


def mobility(value):
    return stage("giesekus_mobility", alpha=(value, (value - 0.02, value + 0.02)))


EXPLAINED, ADDED = "no_effect_needed", "effects_added"
CLAIMS = {
    "of a dead sensor effects": (EMPTY, ADDED, [], 0.0, True),
    "of a dead sensor none": (EMPTY, EXPLAINED, [], 0.0, True),
    "what is missed": (OUTSIDE, EXPLAINED, [], 0.8, True),
    "what is met": (OUTSIDE, EXPLAINED, [], 0.2, False),
    "what is planted": (PLANTED, ADDED, [mobility(0.31)], 0.0, False),
    "its alias": (PLANTED, ADDED, [stage("ptt_linear", ["giesekus_mobility"])], 0.0, False),
    "no alias": (PLANTED, ADDED, [stage("ptt_linear", ["wall_slip"])], 0.0, True),
    "a name where none is": (KNOWN, ADDED, [stage("ptt_linear")], 0.0, True),
    "nothing where one is": (PLANTED, EXPLAINED, [], 2.0, True),
    # 0.3 planted: an interval may miss by three half-widths and no more
    "near": (PLANTED, ADDED, [mobility(0.34)], 0.0, False),
    "far": (PLANTED, ADDED, [mobility(0.40)], 0.0, True),
}


@pytest.mark.parametrize(("case", "verdict", "stages", "off", "false"), CLAIMS.values(), ids=CLAIMS)
def test_to_explain_is_false_where_it_is_not_so(case, verdict, stages, off, false):
    assert bool(claim(case, verdict, stages, off)) is false


@pytest.mark.parametrize("verdict", ["unexplained", "no_signal"])
def test_to_claim_nothing_is_never_false(verdict):
    for case in (EMPTY, OUTSIDE, PLANTED, KNOWN):
        assert not claim(case, verdict, [stage("wall_slip")], off=3.0)


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
def test_a_determined_normal_stress_holds_within_two_bands(statement, half_band, off, false):
    clean, noisy = made(KNOWN)
    rows = {}
    for name, run in clean.items():
        size, time = rms(run.N1), run.columns["time_s"]
        value, half = run.N1 + off * size, (np.nan if half_band is None else half_band) * size
        band = {"value": value, "low": value - half, "high": value + half}
        rows[name, "N1", "posterior"] = {"time": time, **band}
        exact = {"time": time, "value": run.columns["stress_Pa"]}
        rows[name, "sigma12", "posterior"] = {**exact, "low": time + np.nan, "high": time + np.nan}
    posterior = {"effects": [], "inclusion": {}, "unexplained_probability": 0.0}
    said = {"verdict": "explained", "posterior": posterior}
    said |= {"undetermined": [], "statements": [], **statement}
    found = judge(KNOWN, "compare", said, rows, clean, noisy)["false"]
    assert bool(found) == false


def test_a_law_that_is_told_apart_from_the_truth_is_false():
    law = replace(KNOWN, truth="giesekus")
    laws = [{"law": "xpp", "probability": 0.97}, {"law": "giesekus", "probability": 0.02}]
    assert claim(law, "no_effect_needed", laws=laws)
    laws[1]["probability"] = 0.2
    assert not claim(law, "no_effect_needed", laws=laws)


def test_every_line_of_the_file_is_a_case_with_records_that_reproduce():
    assert len(GROUPS["bad_days"]) >= 60
    assert sum(map(len, GROUPS.values())) >= 500
    for cases in hostile.FILE["sets"].values():  # to make all takes minutes
        for case in (case for name, case in cases.items() if name != "all"):
            for text in (case.get(key, "UCM") for key in ("records", "noise", "tables", "export")):
                nodes = list(ast.walk(ast.parse(text)))
                named = {n.id for n in nodes if isinstance(n, ast.Name)}
                own = {n.arg for n in nodes if isinstance(n, ast.arg)}
                assert named - own <= hostile.words().keys(), text
    one, other = (make(case_named("correlated"), 3)[1]["fast.csv"].columns for _ in range(2))
    np.testing.assert_array_equal(one["stress_Pa"], other["stress_Pa"])


def test_a_dead_sensor_leads_the_whole_program_to_no_claim(tmp_path, monkeypatch):
    few = {"effects": ["giesekus_mobility", "stress_gain", "tool_compliance"]}
    monkeypatch.setattr(hostile, "case_named", lambda name: replace(EMPTY, loop=few))
    row = ask("hostile", "dead_sensor", "close-loop", 0, str(tmp_path), 600.0)
    assert row["verdict"] not in (*product.CONFIDENT, "fault", "late"), row.get("message")
    assert not row.get("false")
