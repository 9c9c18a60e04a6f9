"""What somebody else put into a result folder is refused, neither followed nor waited for."""

import os
import socket

import pytest

from discover.errors import InputError
from discover.study import RunFolder
from discover.study.atomic import LOCK_FILE


@pytest.mark.parametrize("kind", ["pipe", "link", "folder", "socket"])
def test_a_lock_that_is_no_plain_file_is_refused_at_once(tmp_path, kind, monkeypatch):
    lock = tmp_path / LOCK_FILE
    if kind == "socket":
        monkeypatch.chdir(tmp_path)  # an address has no room for a long path
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(LOCK_FILE)
    elif kind == "pipe":
        os.mkfifo(lock)
    elif kind == "link":
        lock.symlink_to(tmp_path / "elsewhere")
    else:
        lock.mkdir()
    with pytest.raises(InputError, match="no plain file"):
        RunFolder(tmp_path, "abc")
    assert not (tmp_path / "elsewhere").exists()


def test_a_lock_that_is_another_file_by_a_second_name_is_left_as_it_is(tmp_path):
    precious = tmp_path / "precious"
    precious.write_text("thesis")
    (tmp_path / "out").mkdir()
    os.link(precious, tmp_path / "out" / LOCK_FILE)
    with pytest.raises(InputError, match="one name"):
        RunFolder(tmp_path / "out", "abc")
    assert precious.read_text() == "thesis"


def test_a_lock_left_behind_is_taken_over(tmp_path):
    (tmp_path / LOCK_FILE).write_text('{"pid": 1, "host": "another"}')
    assert not RunFolder(tmp_path, "abc").complete


@pytest.mark.parametrize("name", ["state", "figures"])
def test_a_planted_link_is_not_followed(tmp_path, name):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="is a link"):
        RunFolder(tmp_path / "out", "abc")
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_folder_for_results_may_be_a_link_itself(tmp_path):
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    RunFolder(tmp_path / "out", "abc").write("report.html", "page")
    assert (tmp_path / "disk" / "report.html").read_text() == "page"


RESULTS = {"report.html": "<p>page</p>", "loop.json": '{"verdict": "unexplained"}',
           "figures/run.svg": "<svg/>"}  # fmt: skip


def finished(out):
    folder = RunFolder(out, "abc")
    for name, text in RESULTS.items():
        folder.write(name, text)
    folder.finish()
    return out


def holds(out):
    folder = RunFolder(out, "abc")
    return folder.complete and folder.holds("report.html", "loop.json")


@pytest.mark.parametrize(
    ("name", "text"),
    [("report.html", ""), ("report.html", "<p>pa"), ("loop.json", '{"content": {}}'),
     ("loop.json", "{}"), ("figures/run.svg", "")],
)  # fmt: skip
def test_a_result_that_was_damaged_or_planted_is_made_again(tmp_path, name, text):
    finished(tmp_path)
    (tmp_path / name).write_text(text)
    assert not holds(tmp_path)
    finished(tmp_path)
    assert holds(tmp_path)


def test_a_result_that_is_gone_or_a_pipe_is_made_again(tmp_path):
    finished(tmp_path)
    (tmp_path / "report.html").unlink()
    assert not holds(tmp_path)
    os.mkfifo(tmp_path / "report.html")
    assert not holds(tmp_path)


def test_a_folder_said_to_be_complete_without_its_list_of_results_is_not(tmp_path):
    finished(tmp_path)
    (tmp_path / "state" / "study.json").write_text('{"fingerprint": "abc", "complete": true}')
    assert not holds(tmp_path)


def test_an_untouched_folder_is_complete(tmp_path):
    assert holds(finished(tmp_path))


def test_a_title_with_half_characters_is_written(tmp_path):
    name = os.fsdecode(b"m\xe9lange")  # latin-1, as old disks have it
    RunFolder(tmp_path, "abc").write("report.html", f"<title>{name}</title>")
    assert (tmp_path / "report.html").read_text("utf-8") == "<title>m\\udce9lange</title>"
