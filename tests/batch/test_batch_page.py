"""The page, the table and the rows over a batch."""

import json
import re

import pytest

from discover.batch.status import BatchResult, LearnerRow, StudyRow, StudyStatus, Summary, read_row
from discover.effects.registry import named_effects
from discover.report.batch_report import batch_page
from discover.words import effect_title

SPARSE = {
    "terms": [{"term": "sigma.sigma", "coefficient": 0.2}],
    "errors": {
        "a": {"sigma12": 0.01, "N1": 0.02, "N2": None},
        "b": {"sigma12": 0.03, "N1": 0.001, "N2": None},
    },
}
EXPONENTIAL = {"term": "(exp(epsilon*tr(sigma))-1)*sigma", "inner": {"epsilon": 0.375}}
NETWORK = {"terms": [EXPONENTIAL | {"coefficient": 1.0}], "errors": {}, "details": {}}
GOOD = {
    "learners": {"tensor_sindy": SPARSE, "tbnn_ude": NETWORK},
    "rivals": [{}, {}],
    "undetermined": ["N2"],
    "verdict": "no_signal",
}
LOOP = {
    "verdict": "effects_added",
    "error_before": {"fit": 0.4, "held_out": 0.5},
    "error_after": {"fit": 0.01, "held_out": None},
    "stages": [{"effect": "rate_gain"}],
}


def statuses():
    return (
        StudyStatus("good", "compare", "done", "Found.", False, 2.0),
        StudyStatus("loop", "close-loop", "complete", "Added.", False, 0.1),
        StudyStatus("<script>x", "compare", "failed", "a <b>reason</b>", True, 0.0),
        StudyStatus("later", "compare", "waiting", ""),
    )


@pytest.fixture
def rows(tmp_path):
    for name, file, content in (("good", "comparison", GOOD), ("loop", "loop", LOOP)):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{file}.json").write_text(json.dumps(content))
    return (read_row(tmp_path / "good"), read_row(tmp_path / "loop"), StudyRow(), StudyRow())


def test_rows_hold_the_worst_error(rows):
    good, loop, *_ = rows
    assert good.learners["tensor_sindy"].errors == {"sigma12": 0.03, "N1": 0.02}
    assert good.learners["tbnn_ude"].text.endswith("*sigma [epsilon = 0.375]")
    assert LearnerRow((), {}).text == "no term"
    assert (good.rivals, good.undetermined) == (2, ("N2",))
    assert good.verdict == "no_signal"
    assert (loop.effects, loop.error_before, loop.error_after) == (("rate_gain",), 0.5, 0.01)


def test_the_page_says_what_failed_and_what_was_found(rows):
    page = batch_page(statuses(), rows)
    assert "<script>x" not in page
    assert "a &lt;b&gt;reason&lt;/b&gt;" in page
    assert "2 with a result, 1 failed, 1 not run yet" in page
    assert 'href="good/report.html"' in page
    assert "script%3E" not in page  # a failed study has no link
    assert "3 %" in page
    loops = page.split('id="loops"')[1].split("</table>")[0]
    assert "rate gain" in loops
    assert "effects added" in loops
    assert "_" not in re.sub("<[^>]*>", "", loops)  # what readers see is words
    found = page.split('id="found"')[1].split("</table>")[0]
    assert "0.375" in found
    assert '<td class="text">no signal</td>' in found
    assert "no signal" not in loops  # a comparison is no loop


def test_the_page_needs_no_network_and_its_rows_no_script(rows):
    page = batch_page(statuses(), rows)
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//""", page)
    assert page.count("<script>") == 1
    assert "fetch(" not in page
    assert "import(" not in page
    tables = page.split("<script>")[0]
    for study in statuses():
        assert study.text.split("<")[0] in tables
    # every column of errors can be sorted by its number, not by its text
    assert 'data-value="0.03"' in tables


def test_the_table_does_not_depend_on_times_and_holds_the_reason_of_a_failure(rows, tmp_path):
    table = BatchResult(statuses(), tmp_path / "index.html", rows).table()
    assert table["study"].tolist() == ["good", "loop", "<script>x", "later"]
    # done now or complete before: the same line
    assert table["outcome"].tolist() == ["result", "result", "failed", "waiting"]
    assert table["reason"].tolist() == ["", "", "a <b>reason</b>", ""]
    assert table.loc[0, "tensor_sindy_terms"] == "0.2 sigma.sigma"
    assert table.loc[0, "tensor_sindy_sigma12"] == 0.03
    assert table.loc[1, "effects"] == "rate_gain"
    assert table["verdict"].tolist()[:2] == ["no_signal", "effects_added"]
    assert not {"seconds", "status"} & set(table.columns)


def test_a_batch_shows_itself_in_a_notebook(rows, tmp_path):
    shown = BatchResult(statuses(), tmp_path / "index.html", rows)._repr_html_()
    assert "sigma.sigma" in shown
    assert "<script>x" not in shown


@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"learners": 3}', '{"learners": {"a": {"terms": [{}]}}}', "[" * 9999]
)
def test_a_damaged_result_is_an_empty_row(tmp_path, text):
    (tmp_path / "comparison.json").write_text(text)
    assert read_row(tmp_path) == StudyRow()


def test_the_page_is_there_while_the_next_study_still_runs(tmp_path):
    summary = Summary(tmp_path, [("a", "compare"), ("b", "compare")])
    summary.add(0, StudyStatus("a", "compare", "failed", "the reason", True))
    page = (tmp_path / "index.html").read_text("utf-8")
    assert "the reason" in page
    assert "1 not run yet" in page
    assert json.loads((tmp_path / "batch.json").read_text())["studies"][1]["status"] == "waiting"


def test_a_page_that_cannot_be_written_is_told_at_the_end_and_not_by_a_traceback(tmp_path, capfd):
    summary = Summary(tmp_path / "gone", [("a", "compare")])
    summary.add(0, StudyStatus("a", "compare", "failed", "the reason", True))
    assert capfd.readouterr().err == ""
    with pytest.raises(FileNotFoundError):
        summary.write()


def test_every_effect_has_a_title_in_words():
    for name in named_effects():
        assert "_" not in effect_title(name)
    assert effect_title("ptt_linear") == "linear PTT"
    assert effect_title("sigma.sigma") == "σ·σ"


def test_a_term_that_nobody_knows_is_shown_as_text():
    row = StudyRow({"tensor_sindy": LearnerRow((("<img src=x>", 1.0, {}),), {})}, 0)
    page = batch_page((StudyStatus("a", "compare", "done", ""),), (row,))
    assert "<img" not in page
    assert "&lt;img src=x&gt;" in page
