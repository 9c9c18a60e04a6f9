"""A deterministic slice of ``benchmarks/malformed_inputs.py``: whatever the command line reads."""

import os
import tempfile
from pathlib import Path

import malformed_inputs
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from malformed_inputs import KINDS, Case, Outcome, attempt, complaint

CASE = Case(["close-loop", "s.toml"], ("s.toml",))
CLEAR = "discover: s.toml: model.law: unknown law 'x'; write one of ucm.\n"


@pytest.fixture(scope="module", autouse=True)
def nothing_is_computed():
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as scratch:
        patch.delenv("DISCOVER_DATA", raising=False)
        patch.chdir(scratch)  # where commands put results by default
        with malformed_inputs.stopped_at_the_first_computation():
            yield


@settings(max_examples=120, deadline=None, derandomize=True, database=None)
@given(kind=st.sampled_from(list(KINDS)), seed=st.integers(0, 10**6))
def test_a_malformed_input_ends_with_code_2_a_place_and_a_remedy(kind, seed):
    with tempfile.TemporaryDirectory() as root:
        _, outcome, wrong = attempt(kind, seed, Path(root))
    assert wrong is None, (wrong, outcome)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("package", "options")])
def test_the_same_input_unspoiled_is_accepted(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(malformed_inputs, "mutate_text", lambda text, source: text.encode())
    monkeypatch.setattr(malformed_inputs, "mutate_values", lambda content, source: content)
    monkeypatch.setattr(malformed_inputs, "spoil_file", lambda path, source: None)
    for seed in range(3):
        (tmp_path / str(seed)).mkdir()
        _, outcome, _ = attempt(kind, seed, tmp_path / str(seed))
        assert outcome.code in (0, None), outcome


@pytest.mark.parametrize(
    ("code", "stdout", "stderr", "wrong"),
    [
        (2, "", CLEAR, None),
        (0, "done", "", None),
        (None, "", "", None),
        (1, "", CLEAR, "ends with 1"),
        (124, "", "", "takes too long"),
        (2, "", "", "says nothing"),
        (2, "", "discover: Correct it.", "names no place"),
        (2, "", "discover: s.toml is wrong.", "names no remedy"),
        (2, "", CLEAR + "\x1b[2J", "prints what a terminal would obey"),
        (2, "", "Traceback (most recent call last):", "fails in the software"),
        (1, "", "discover: KeyError: 3 (not your input's fault; ...)", "fails in the software"),
        (2, "", f"discover: s.toml: correct {'x' * 2000}", "says too much"),
    ],
)
def test_the_judge_tells_bad_endings_from_good_ones(code, stdout, stderr, wrong):
    assert complaint(CASE, Outcome(code, stdout, stderr, 0.1)) == wrong


def test_a_reader_that_waits_for_ever_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setattr(malformed_inputs, "LIMIT", 0.2)
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setattr("discover.cli.main", lambda: (tmp_path / "pipe").read_text())
    assert complaint(CASE, malformed_inputs.run(["demo"])) == "takes too long"
