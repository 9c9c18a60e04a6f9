"""The command line: exit codes, one clear message, resuming, JSON, and programs that are kept."""

import json
import subprocess
import sys
import time
import zlib

import numpy as np
import pytest
from command_line import invoke
from fewer_hypotheses import few_candidates, verdict_alone, without_pictures
from made_exports import write_runs

from discover.compilation_cache import enable_compilation_cache, remove_cut_short
from discover.learners import LearnerResult, RecoveredTerm

STUDY = """
[data]
synthetic = { law = "giesekus", parameters = { alpha = 0.2 }, noise = 0.01, samples = 21 }
[compare]
library = { degree = 0 }
high_deborah = [1.5]
next = { weissenberg_numbers = [1.0, 2.0], deborah_numbers = [1.0] }
"""


# where it is asked what a command does with a study, whatever is in it
ONE_RUN = """
[data]
folder = "one"
[compare]
library = { degree = 0 }
high_deborah = [1.5]
next = { weissenberg_numbers = [1.0], deborah_numbers = [1.0] }
"""


@pytest.fixture
def trained(monkeypatch):
    """Learners that know the answer; the list says who was asked."""
    from discover.laws import Fluid, make_law

    calls = []

    def train(learner, study, model, runs, seed=0, progress=None, library=None):
        calls.append(learner)
        law = make_law("giesekus", {"alpha": 0.2})
        result = LearnerResult(learner, law, (RecoveredTerm("sigma.sigma", 0.2),), 1.0)
        return result, Fluid.dimensionless(law)

    monkeypatch.setattr("discover.comparison.learning.train", train)
    few_candidates(monkeypatch, ("giesekus_mobility", "stress_gain"))
    verdict_alone(monkeypatch)
    return calls


@pytest.fixture
def undrawn(monkeypatch):
    """A page of the verdict without pictures, where what a command does with it is asked."""
    without_pictures(monkeypatch)


def data_folder(path, **columns):
    t = np.linspace(0.0, 2.0, 12)
    table = {"time_s": t, "shear_rate_1_s": np.ones(12), "stress_Pa": 1.0 - np.exp(-t)}
    return write_runs(path, table | columns)


@pytest.mark.slow
def test_compare_writes_what_the_contract_names_and_resumes(tmp_path, trained, monkeypatch):
    study, out = tmp_path / "s.toml", tmp_path / "out"
    study.write_text(STUDY)
    first = invoke("compare", study, "--out", out, code=0)
    for name in ("report.html", "comparison.json", "equations.tex"):
        assert (out / name).is_file()
    assert str(out / "report.html") in first.output.replace("\n", "")
    again = invoke("compare", study, "--out", out, code=0)
    assert "complete; use --overwrite" in again.output
    assert sorted(trained) == ["tbnn_ude", "tensor_sindy"]  # side by side, in either order
    law = json.loads(invoke("export", out, "--format", "json", "--law", "tbnn_ude").stdout)
    assert law["terms"][0]["term"] == "sigma.sigma"
    assert "projection" in law["notes"][0]
    # the paper's training and test flows, in 20 and 40 relaxation times
    assert law["tested"]["learned_in"] == {"Wi": [1.0, 2.0], "De": [0.25, 1.0]}
    assert law["tested"]["judged_in"]["Wi"] == [2.0, 3.0]
    assert law["tested"]["judged_in"]["De"][1] == 1.5
    before = (out / "comparison.json").read_bytes()
    with monkeypatch.context() as patch:
        without_pictures(patch)
        fresh = invoke("compare", study, "--out", out, "--overwrite", "--json")
    assert len(trained) == 4
    assert json.loads(fresh.stdout) == json.loads(before)
    other = invoke("compare", study, "--out", out, "--seed", "7", code=2)
    assert "--overwrite" in other.stderr


def test_an_interrupted_run_says_so_and_goes_on_quietly(tmp_path, monkeypatch, trained, undrawn):
    from discover.comparison import learning as module

    known, kept = module.train, tmp_path / "out" / "state" / "tensor_sindy.json"

    def interrupted(learner, *args, **kwargs):
        if learner == "tbnn_ude":
            # the two are trained side by side: stopped once the other one has ended
            deadline = time.monotonic() + 60.0
            while not kept.is_file() and time.monotonic() < deadline:
                time.sleep(0.01)
            raise KeyboardInterrupt
        return known(learner, *args, **kwargs)

    data_folder(tmp_path / "one")
    (tmp_path / "s.toml").write_text(ONE_RUN)
    with monkeypatch.context() as patch:
        patch.setattr(module, "train", interrupted)
        result = invoke("compare", tmp_path / "s.toml", "--out", tmp_path / "out", code=130)
    assert "run the same command again" in result.stderr
    result = invoke("compare", tmp_path / "s.toml", "--out", tmp_path / "out", "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    assert sorted(trained) == ["tbnn_ude", "tensor_sindy"]  # side by side, in either order


@pytest.mark.slow
def test_constants_to_be_fitted_are_fitted_before_the_learners_run(tmp_path, trained, undrawn):
    to_fit = 'modulus_Pa = "fit"\nrelaxation_time_s = "fit"\n'
    to_fit += '[loop]\nnoise = 0.01\nmax_effects = 1\neffects = ["stress_offset"]'
    study = STUDY + '[model]\nlaw = "giesekus"\nparameters = {alpha = "fit"}\n' + to_fit
    (tmp_path / "s.toml").write_text(study)
    invoke("close-loop", tmp_path / "s.toml", "--out", tmp_path / "loop", code=0)
    loop = json.loads((tmp_path / "loop" / "loop.json").read_text())
    assert loop["noise_floor"] == 0.01  # as the study says, not as estimated
    mobility = loop["declared_parameters"]["alpha"]
    low, high = mobility["ci95"]
    assert low - (high - low) < 0.2 < high + (high - low)  # twice the 95 % interval
    invoke("compare", tmp_path / "s.toml", "--out", tmp_path / "out", code=0)
    assert "fitted)" in (tmp_path / "out" / "report.html").read_text()


BAD_STUDIES = {
    "missing": (None, "bad.toml"),
    "wrong_parameter": (STUDY.replace("alpha", "beta"), "'beta'"),
    "nan_in_a_run": ('[data]\nfolder = "spoiled"\n', "r0.csv"),
    "known_relaxation": (
        STUDY + '\n[model]\nlaw = "giesekus"\nparameters = {alpha = 0.1}\nknown_relaxation = false',
        "known_relaxation",
    ),
    # a comparison knows no constants by mode, and a loop none of a single mode
    "by_mode": (
        STUDY + '\n[model]\nlaw = "giesekus"\nparameters = {alpha = "fit"}\nby_mode = ["alpha"]',
        "by_mode",
    ),
}


@pytest.mark.parametrize("command", ["compare", "close-loop"])
@pytest.mark.parametrize("case", BAD_STUDIES)
def test_a_wrong_study_ends_with_one_line_and_exit_code_2(tmp_path, command, case):
    text, word = BAD_STUDIES[case]
    data_folder(tmp_path / "spoiled", stress_Pa=np.where(np.arange(12) == 4, np.nan, 1.0))
    if text is not None:
        (tmp_path / "bad.toml").write_text(text)
    result = invoke(command, tmp_path / "bad.toml", "--out", tmp_path / "out", code=2)
    assert word in result.stderr
    first, *problems = result.stderr.strip().split("\n")
    assert first.startswith("discover: ")
    assert all(line.startswith("  - ") for line in problems)
    assert "Traceback" not in result.output
    assert result.stdout == ""


@pytest.mark.parametrize("arguments", [("fit", "giesekus"), ("compare",)])
def test_a_tolerance_that_is_none_is_refused_with_what_was_got(tmp_path, arguments):
    (tmp_path / "mine.toml").write_text(STUDY)
    data_folder(tmp_path / "runs")
    where = tmp_path / ("runs" if "fit" in arguments else "mine.toml")
    result = invoke(*arguments, where, "--tolerance", "-1", code=2)
    assert "tolerance: should be greater than 0; got -1" in result.stderr


def test_data_commands(tmp_path, monkeypatch):
    data_folder(tmp_path / "mine")
    monkeypatch.setenv("DISCOVER_DATA", str(tmp_path))
    assert "mine" in invoke("data", "list").output
    shown = invoke("data", "show", "mine", code=0)
    assert "r0.csv" in shown.output
    assert json.loads(invoke("data", "show", "mine", "--json").stdout)["runs"][0]["samples"] == 12
    invoke("data", "check", "mine", code=0)
    bad = data_folder(tmp_path / "bad", time_s=np.zeros(12))
    assert "r0.csv" in invoke("data", "check", bad, code=2).stderr
    monkeypatch.delenv("DISCOVER_DATA")
    invoke("data", "list", code=2)


def test_a_batch_goes_on_past_a_study_that_fails(tmp_path, trained, undrawn):
    data_folder(tmp_path / "one")
    (tmp_path / "good.toml").write_text(ONE_RUN)
    (tmp_path / "bad.toml").write_text("[data]\n")
    studies = (tmp_path / "bad.toml", tmp_path / "good.toml")
    invoke("batch", *studies, "--out", tmp_path / "b", code=2)
    table = json.loads((tmp_path / "b" / "batch.json").read_text())["studies"]
    assert [row["status"] for row in table] == ["failed", "done"]
    assert "bad.toml" in table[0]["text"]
    page = (tmp_path / "b" / "index.html").read_text()
    assert "good/report.html" in page
    assert "bad/report.html" not in page
    again = invoke("batch", tmp_path / "good.toml", "--out", tmp_path / "b", "--json")
    assert json.loads(again.stdout)["studies"][0]["status"] == "complete"
    assert len(trained) == 2


@pytest.mark.parametrize("names", [("a", "a"), ("a", "A"), ("a", "a-loop")])
def test_a_batch_refuses_two_studies_for_one_folder(tmp_path, names):
    # both learners and a loop: two folders, a and a-loop
    (tmp_path / "a.toml").write_text(STUDY + "[loop]\n")
    (tmp_path / "A.toml").write_text(STUDY)
    (tmp_path / "a-loop.toml").write_text(STUDY)
    studies = [tmp_path / f"{name}.toml" for name in names]
    result = invoke("batch", *studies, "--out", tmp_path / "b", code=2)
    assert "Two studies would write to the folder" in result.stderr
    assert result.stderr.count("\n") == 1


COMPLETED = """
import os, sys
from discover.cli import main
os.environ["_DISCOVER_COMPLETE"] = "complete_bash"
for words in sys.argv[1:]:
    os.environ |= {"COMP_WORDS": words, "COMP_CWORD": str(len(words.split()) - 1)}
    try:
        main()
    except SystemExit:
        print("|")
"""


def test_completion_knows_commands_and_options():
    asked = ("close", "fit --held", "zzz")
    command = [sys.executable, "-c", COMPLETED, *(f"discover {words}" for words in asked)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    close, held, nothing, _ = (part.split() for part in done.stdout.split("|"))
    assert close == ["close-loop"]
    assert "--held-out" in held
    assert nothing == []  # control: nothing begins so


def test_a_folder_in_place_of_a_study_is_answered_with_a_study(tmp_path):
    (tmp_path / "a.csv").write_text("time_s\n")
    assert "Give a study file" in invoke("close-loop", tmp_path, code=2).stderr
    (tmp_path / "melt.toml").write_text("")
    meant = invoke("close-loop", tmp_path)
    assert "Did you mean" in meant.stderr
    assert "melt.toml" in meant.stderr


def test_broken_programs_go_and_none_is_kept_where_the_user_says_so(tmp_path, monkeypatch):
    whole = zlib.compress(b"program " * 1000)
    contents = {"jit_a": whole, "jit_b": whole[:-3], "jit_c": b"", "jit_d": b"nonsense"}
    for name, content in contents.items():
        (tmp_path / f"{name}-{'0f' * 32}-cache").write_bytes(content)
    (tmp_path / "web-cache").write_bytes(b"no program, and somebody else's")
    remove_cut_short(tmp_path)
    left = sorted(path.name.partition("-")[0] for path in tmp_path.glob("*-cache"))
    assert left == ["jit_a", "web"]
    monkeypatch.setenv("DISCOVER_NO_CACHE", "1")
    assert enable_compilation_cache(tmp_path / "compiled") is None
    assert not (tmp_path / "compiled").exists()
