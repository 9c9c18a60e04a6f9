"""A deterministic slice of ``benchmarks/malformed.py``: whatever the command line reads."""

import io
import os
import tempfile
from pathlib import Path

import harm
import malformed
import pytest
import run
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from malformed import Outcome, attempt, complaint
from malformed_kinds import KINDS, Case, complete_results

from discover import cli
from discover.batch.run import folder_names
from discover.errors import InputError

CASE = Case(["close-loop", "s.toml"], ("s.toml",))
CLEAR = "discover: s.toml: model.law: unknown law 'x'; write one of ucm.\n"


@pytest.fixture(scope="module", autouse=True)
def nothing_is_computed():
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as scratch:
        patch.delenv("DISCOVER_DATA", raising=False)
        patch.chdir(scratch)  # where commands put results by default
        with malformed.stopped_at_the_first_computation():
            yield


@pytest.mark.usefixtures("as_users_run_it")
@settings(
    max_examples=20, deadline=None, derandomize=True, database=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
@given(kind=st.sampled_from(list(KINDS)), seed=st.integers(0, 10**6))
def test_a_malformed_input_ends_with_code_2_a_place_and_a_remedy(kind, seed):
    with tempfile.TemporaryDirectory() as root:
        _, outcome, wrong = attempt(kind, seed, Path(root))
    assert wrong is None, (wrong, outcome)


HARMED_OTHERWISE = ("options", "estimator", "frame")


@pytest.mark.parametrize(
    "kind", [kind for kind in KINDS if kind not in HARMED_OTHERWISE and "nonsense" not in kind]
)
def test_the_same_input_unspoiled_is_accepted(tmp_path, monkeypatch, kind):
    monkeypatch.setattr(harm, "mutate_text", lambda text, source: text.encode())
    monkeypatch.setattr(harm, "mutate_values", lambda content, source: content)
    monkeypatch.setattr(harm, "spoil_file", lambda path, source: None)
    _, outcome, _ = attempt(kind, 0, tmp_path)
    assert outcome.code in (0, None), outcome


@pytest.mark.parametrize(
    ("code", "stdout", "stderr", "wrong"),
    [
        (2, "", CLEAR, None),
        (0, "done", "", None),
        (None, "", "", None),
        (1, "", CLEAR, "ends with 1"),
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
    assert complaint(CASE, Outcome(code, stdout, stderr)) == wrong


def test_nonsense_that_is_taken_without_a_word_is_seen():
    case = Case(["data", "check", "data"], ("data",), nonsense="time_s2")
    assert complaint(case, Outcome(0, "2 runs")) == "takes nonsense: time_s2"
    assert complaint(case, Outcome(0, "warning: time_s2 is no unit")) is None
    assert complaint(case, Outcome(2, "", "discover: data: correct time_s2.")) is None


@pytest.mark.parametrize("error", [RuntimeError("x"), MemoryError(), SystemError()])
def test_a_fault_of_the_software_is_seen(tmp_path, monkeypatch, error):
    def fail(*_):
        raise error

    monkeypatch.setattr("discover.dataset.checking.folder.read_index", fail)
    harm.write_files(tmp_path, harm.SANE["FOLDER"])
    case = Case(["data", "check", str(tmp_path)])
    said = complaint(case, malformed.run_call(case.call))
    assert said in ("fails in the software", "ends with 1")


def test_a_reader_that_waits_for_ever_is_late(tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.setattr(malformed, "attempt", lambda *_: (tmp_path / "pipe").read_text())
    monkeypatch.setattr(malformed.resource, "setrlimit", lambda *_: None)
    assert run.ask("malformed", "data folder 0", "harm", 0, None, 0.02)["verdict"] == "late"


def test_names_from_files_cannot_steer_the_terminal_and_need_no_utf_8(tmp_path, monkeypatch):
    (tmp_path / "runs.csv").write_text("file\na.csv\n")
    (tmp_path / "a.csv").write_text("time_s,shear_rate_1_s,stress_Pa\n0,1,0\n1,1,1\n")
    (tmp_path / "b\x1b[2J.csv").write_text("")
    Path(os.fsdecode(bytes(tmp_path) + b"/c\xff.csv")).write_text("")
    outcome = malformed.run_call(["data", "check", str(tmp_path)])
    assert outcome.code == 0, outcome
    assert "c" in outcome.stdout
    assert all(c.isprintable() or c == "\n" for c in outcome.stdout)
    stream = io.TextIOWrapper(io.BytesIO(), "ascii", errors="strict")
    monkeypatch.setattr("sys.stdout", stream)
    monkeypatch.setattr("sys.argv", ["discover", "data", "show", "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    print("σ12", file=stream, flush=True)
    assert b"\\u03c312" in stream.buffer.getvalue()


def test_a_damaged_result_is_not_taken_for_a_complete_one(tmp_path):
    complete_results(tmp_path)
    again = ["close-loop", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--json"]
    assert malformed.run_call(again).code == 0
    (tmp_path / "out" / "loop.json").write_bytes(b"\x90")
    assert malformed.run_call(again).code is None  # it computes


def test_a_batch_says_its_failures_on_standard_error_however_quiet(tmp_path):
    (tmp_path / "s.toml").write_text("[data]\n")
    words = ["batch", str(tmp_path / "s.toml"), "--out", str(tmp_path / "o"), "--quiet"]
    outcome = malformed.run_call(words)
    assert outcome.code == 2
    assert outcome.stdout == ""
    assert outcome.stderr.startswith("discover: s (compare): ")


def test_a_study_named_by_dots_or_as_a_file_of_the_batch_gets_a_folder_within_the_results():
    assert folder_names([Path("...toml"), Path("a.toml")]) == ["study", "a"]
    paths = [Path("batch.json.toml"), Path("Index.HTML.toml"), Path("table.toml")]
    assert folder_names(paths) == ["study-batch.json", "study-Index.HTML", "table"]
    with pytest.raises(InputError):
        folder_names([Path("batch.json.toml"), Path("study-batch.json.toml")])
