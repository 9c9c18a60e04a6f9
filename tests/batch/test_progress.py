"""How far a batch is, in a terminal and on its page, and how its studies ended."""

import errno
import json
import re

import pytest

from discover.batch import run
from discover.batch.status import BatchResult, StudyStatus, Summary, now_and_then
from discover.effects.registry import named_effects
from discover.report.page import batch_page
from discover.words import effect_title


def ended(status, name="x"):
    return StudyStatus(name, "compare", status, "")


@pytest.fixture
def said():
    return []


@pytest.fixture
def followed(tmp_path, said):
    def of(*names):
        jobs = [(name, "compare") for name in names]
        return Summary(tmp_path, jobs, lambda *line: said.append(line))

    return of


def test_studies_side_by_side_add_up(said, followed):
    progress = followed("a", "b")
    progress.say(0, "fitting", 0.5)
    progress.say(1, "loading", 0.25)
    progress.end(0, ended("done", "a"))
    progress.say(0, "news that came late", 0.75)
    progress.end(1, ended("failed", "b"))
    assert said == [
        ("0 of 2 ended; a: fitting", 0.25),
        ("0 of 2 ended; b: loading", 0.375),
        ("1 of 2 ended; a: done", 0.625),
        ("2 of 2 ended; b: failed", 1.0),
    ]


def test_results_that_were_there_do_not_make_the_rest_look_short(said, followed):
    progress = followed(*"abcd")
    for i in range(3):
        progress.end(i, ended("complete"))
    progress.say(3, "fitting", 0.1)
    assert [fraction for _, fraction in said] == pytest.approx([0.0, 0.0, 0.0, 0.1])
    progress.end(3, ended("complete"))
    assert said[-1][1] == 1.0


def test_a_worker_sends_word_now_and_then_and_not_at_every_step(said):
    often = now_and_then(lambda *line: said.append(line), pause=60.0)
    always = now_and_then(lambda *line: said.append(line), pause=0.0)
    for say in (often, always):
        say("one", 0.1)
        say("two", 0.2)
    assert said == [("one", 0.1), ("one", 0.1), ("two", 0.2)]


def test_a_study_on_a_full_disk_says_so_in_words(tmp_path, monkeypatch):
    def full(*arguments):
        raise OSError(errno.ENOSPC, "No space left on device", "a.svg")

    monkeypatch.setitem(run._TASKS, "compare", full)
    status = run.run_one("a.toml", "a", "compare", str(tmp_path), None, False)
    assert (status.status, status.input_error) == ("failed", False)
    assert status.text.startswith("No space left on device (a.svg); make room and run again")


def statuses():
    return (
        StudyStatus("good", "compare", "done", "Found.", False, 2.0),
        StudyStatus("loop", "close-loop", "complete", "Added.", False, 0.1),
        StudyStatus("<script>x", "compare", "failed", "a <b>reason</b>", True, 0.0),
        StudyStatus("later", "compare", "waiting", ""),
    )


def test_the_page_says_what_failed_and_needs_no_network_nor_a_script_for_its_rows():
    page = batch_page(statuses())
    assert "<script>x" not in page
    assert "a &lt;b&gt;reason&lt;/b&gt;" in page
    assert "2 with a result, 1 failed, 1 not run yet" in page
    assert 'href="good/report.html"' in page
    assert "script%3E" not in page  # a failed study has no link
    assert "Added." in page
    page = batch_page(statuses())
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//""", page)
    assert page.count("<script>") == 1
    assert "fetch(" not in page
    assert "import(" not in page
    tables = page.split("<script>")[0]
    for study in statuses():
        assert study.text.split("<")[0] in tables
    # seconds are sorted as numbers, not as text
    assert 'data-value="2.0"' in tables


def test_the_table_depends_on_no_times_and_holds_failures_and_a_notebook_shows_it(tmp_path):
    table = BatchResult(statuses(), tmp_path / "index.html").table()
    assert table["study"].tolist() == ["good", "loop", "<script>x", "later"]
    # done now or complete before: the same line
    assert table["outcome"].tolist() == ["result", "result", "failed", "waiting"]
    assert table["text"].tolist() == ["Found.", "Added.", "a <b>reason</b>", ""]
    assert not {"seconds", "status"} & set(table.columns)
    shown = BatchResult(statuses(), tmp_path / "index.html")._repr_html_()
    assert "Added." in shown
    assert "<script>x" not in shown


def test_the_page_is_there_while_the_next_study_still_runs(tmp_path):
    summary = Summary(tmp_path, [("a", "compare"), ("b", "compare")])
    summary.end(0, StudyStatus("a", "compare", "failed", "the reason", True))
    page = (tmp_path / "index.html").read_text("utf-8")
    assert "the reason" in page
    assert "1 not run yet" in page
    assert json.loads((tmp_path / "batch.json").read_text())["studies"][1]["status"] == "waiting"


def test_a_page_that_cannot_be_written_is_told_at_the_end_and_not_by_a_traceback(tmp_path, capfd):
    summary = Summary(tmp_path / "gone", [("a", "compare")])
    summary.end(0, StudyStatus("a", "compare", "failed", "the reason", True))
    assert capfd.readouterr().err == ""
    with pytest.raises(FileNotFoundError):
        summary.write()


def test_every_effect_has_a_title_in_words():
    for name in named_effects():
        assert "_" not in effect_title(name)
    assert effect_title("ptt_linear") == "linear PTT"
    assert effect_title("sigma.sigma") == "σ·σ"
