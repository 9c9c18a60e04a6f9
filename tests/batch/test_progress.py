"""How far a batch is: in a terminal, from studies that run here or in workers."""

import errno

import pytest

from discover.batch import run
from discover.batch.status import StudyStatus, Summary, now_and_then


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
