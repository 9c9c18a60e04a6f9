"""The page and the table over a batch."""

import json
import re

import pytest

from discover.batch.status import BatchResult, StudyStatus, Summary
from discover.effects.registry import named_effects
from discover.report.page import batch_page
from discover.words import effect_title


def statuses():
    return (
        StudyStatus("good", "compare", "done", "Found.", False, 2.0),
        StudyStatus("loop", "close-loop", "complete", "Added.", False, 0.1),
        StudyStatus("<script>x", "compare", "failed", "a <b>reason</b>", True, 0.0),
        StudyStatus("later", "compare", "waiting", ""),
    )


def test_the_page_says_what_failed_and_how_the_others_ended():
    page = batch_page(statuses())
    assert "<script>x" not in page
    assert "a &lt;b&gt;reason&lt;/b&gt;" in page
    assert "2 with a result, 1 failed, 1 not run yet" in page
    assert 'href="good/report.html"' in page
    assert "script%3E" not in page  # a failed study has no link
    assert "Added." in page


def test_the_page_needs_no_network_and_its_rows_no_script():
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


def test_the_table_does_not_depend_on_times_and_holds_the_reason_of_a_failure(tmp_path):
    table = BatchResult(statuses(), tmp_path / "index.html").table()
    assert table["study"].tolist() == ["good", "loop", "<script>x", "later"]
    # done now or complete before: the same line
    assert table["outcome"].tolist() == ["result", "result", "failed", "waiting"]
    assert table["text"].tolist() == ["Found.", "Added.", "a <b>reason</b>", ""]
    assert not {"seconds", "status"} & set(table.columns)


def test_a_batch_shows_itself_in_a_notebook(tmp_path):
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
