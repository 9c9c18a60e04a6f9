"""What may be written over: results of ours, and never what was read, or what is no plain file."""

import os
import subprocess
import sys

import pytest

from discover.batch.run import run_batch
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.inputs_kept import inputs_kept
from discover.study import RunFolder
from discover.study.atomic import write_text


@pytest.fixture
def umask():
    """Sets the umask, and puts it back."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


@pytest.mark.parametrize("mask", [0o000, 0o022, 0o027, 0o077])
def test_a_new_file_is_open_to_those_whom_the_umask_lets_in(tmp_path, umask, mask):
    umask(mask)
    write_text(tmp_path / "ours", "law")
    (tmp_path / "theirs").write_text("law")  # as any program makes it
    modes = [(tmp_path / name).stat().st_mode for name in ("ours", "theirs")]
    assert modes[0] == modes[1]


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664, 0o444])
def test_a_file_that_is_replaced_stays_as_open_as_it_was(tmp_path, umask, mode):
    umask(0o077)
    path = tmp_path / "law.py"
    path.write_text("old")
    path.chmod(mode)
    write_text(path, "new")
    assert (path.read_text(), path.stat().st_mode & 0o777) == ("new", mode)


def test_a_name_as_long_as_a_name_may_be_is_written(tmp_path):
    write_text(tmp_path / ("n" * 255), "law")
    write_text(tmp_path / ("σ" * 127), "law")
    assert sorted(len(os.fsencode(path.name)) for path in tmp_path.iterdir()) == [254, 255]


def link(path):
    path.symlink_to(path.with_name("target"))


def dangling_link(path):
    path.symlink_to(path.with_name("nowhere"))


@pytest.mark.parametrize("make", [link, dangling_link, os.mkfifo, os.mkdir])
def test_what_is_no_plain_file_is_not_replaced(tmp_path, make):
    (tmp_path / "target").write_text("theirs")
    make(tmp_path / "law.py")
    before = os.lstat(tmp_path / "law.py")
    with pytest.raises(InputError, match="no plain file"):
        write_text(tmp_path / "law.py", "law")
    assert os.lstat(tmp_path / "law.py")[:3] == before[:3]
    assert (tmp_path / "target").read_text() == "theirs"
    assert sorted(os.listdir(tmp_path)) == ["law.py", "target"]


def test_a_device_is_not_replaced():
    with pytest.raises(InputError, match="no plain file"):
        write_text(os.devnull, "law")


def test_a_command_does_not_write_over_what_it_read_by_whatever_name(tmp_path, monkeypatch):
    source = tmp_path / "start.csv"
    source.write_text("time_s\n")
    os.link(source, tmp_path / "second.csv")
    (tmp_path / "folder").symlink_to(tmp_path)
    monkeypatch.chdir(tmp_path)
    with inputs_kept():
        read_bytes(source, "start.csv")
        for name in ("start.csv", "second.csv", "folder/start.csv", str(source)):
            with pytest.raises(InputError, match="reads, and it is not written over"):
                write_text(name, "converted")
        write_text("other.csv", "converted")  # the control
    assert source.read_text() == "time_s\n"
    write_text("start.csv", "by hand")  # outside of a command one knows what one does


def test_what_a_command_read_may_be_gone_and_its_number_given_to_another(tmp_path, monkeypatch):
    (tmp_path / "a").write_text("a")
    (tmp_path / "b").write_text("b")
    with inputs_kept():
        read_bytes(tmp_path / "a", "a")
        os.replace(tmp_path / "a", tmp_path / "c")  # somebody moves it away: c is that file now
        write_text(tmp_path / "c", "new")
    assert (tmp_path / "c").read_text() == "new"


def test_results_of_ones_own_are_replaced_within_a_command(tmp_path):
    with inputs_kept():
        for text in ("one", "two"):
            folder = RunFolder(tmp_path / "out", "fingerprint")
            folder.save("part", {"x": text})
            assert folder.load("part") == {"x": text}
            folder.write("report.html", text)
            folder.finish()
            assert folder.holds("report.html")
    assert (tmp_path / "out" / "report.html").read_text() == "two"


@pytest.mark.parametrize("name", ["report.html", "loop.json"])
def test_a_page_that_nobody_of_ours_wrote_is_replaced_only_where_it_is_asked_for(tmp_path, name):
    (tmp_path / name).write_text("written by hand")
    with pytest.raises(InputError, match=rf"{name} that is not a result.*--overwrite"):
        RunFolder(tmp_path, "fingerprint")
    assert os.listdir(tmp_path) in ([name], [name, ".discover-lock"], [".discover-lock", name])
    RunFolder(tmp_path, "fingerprint", overwrite=True)
    RunFolder(tmp_path, "fingerprint")  # from here on it is known as ours


@pytest.mark.parametrize("name", ["index.html", "table.csv"])
def test_the_page_over_a_batch_replaces_none_of_somebody_elses(tmp_path, name):
    (tmp_path / name).write_text("written by hand")
    with pytest.raises(InputError, match=f"{name} that is not a result"):
        run_batch([], tmp_path)
    assert (tmp_path / name).read_text() == "written by hand"
    run_batch([], tmp_path, overwrite=True)
    run_batch([], tmp_path)
    assert (tmp_path / name).read_text() != "written by hand"


LISTED = [sys.executable, "-P", "-c", "from discover.cli import main; main()", "laws"]


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_reader_who_leaves_early_changes_nothing(tmp_path, stream):
    command = LISTED if stream == "stdout" else [*LISTED, "nothing"]
    read, write = os.pipe()
    os.close(read)  # as `| true` does
    other = "stderr" if stream == "stdout" else "stdout"
    try:
        done = subprocess.run(command, cwd=tmp_path, **{stream: write, other: subprocess.PIPE})
    finally:
        os.close(write)
    assert done.returncode == (0 if stream == "stdout" else 2)
    assert getattr(done, other) == b""


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_an_output_that_is_full_is_told_in_one_line(tmp_path):
    with open("/dev/full", "wb") as full:
        done = subprocess.run(LISTED, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert "No space left" in done.stderr
