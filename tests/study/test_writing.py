"""Bad days while writing, and what may be written over: results of ours, never what was read."""

import ast
import errno
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer
from typer.testing import CliRunner

import discover
from discover.batch.run import run_batch
from discover.cli.console import guarded
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.inputs_kept import inputs_kept
from discover.study import RunFolder, atomic
from discover.study.atomic import LOCK_FILE, PART_SUFFIX, lock_folder, write_text

HOLDER = """
import sys, time
from discover.study.run_folder import RunFolder
folder = RunFolder(sys.argv[1], "one")
folder.save("part", {"x": 1})
print("ready", flush=True)
time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(out)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "ready\n"
    yield process, out
    process.kill()
    process.wait()


def test_two_processes_cannot_work_in_one_folder_and_a_killed_one_does_not_block(holder):
    process, out = holder
    for overwrite in (False, True):
        with pytest.raises(InputError) as error:
            RunFolder(out, "one", overwrite)
        assert f"process {process.pid} on {socket.gethostname()}" in str(error.value)
        assert "--out" in str(error.value)
    (out / f".report.html.x{PART_SUFFIX}").write_text("half a page")
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert (out / LOCK_FILE).exists()  # left behind, and recognised as stale
    folder = RunFolder(out, "one")
    assert folder.load("part") == {"x": 1}  # what was computed is not lost
    assert not list(out.glob(f".*{PART_SUFFIX}"))
    folder.finish()
    assert not (out / LOCK_FILE).exists()


def test_one_process_may_open_its_folder_twice_and_forgetting_it_unlocks(tmp_path, monkeypatch):
    first = RunFolder(tmp_path, "one")
    second = RunFolder(tmp_path, "one")
    assert first._lock is second._lock
    del first, second
    assert not (tmp_path / LOCK_FILE).exists()

    # where the file system knows no locks one works without
    class NoLocks:
        LOCK_EX = LOCK_NB = 0

        @staticmethod
        def flock(*_):
            raise OSError(errno.ENOLCK, "No locks available")

    for system in (NoLocks, None):
        monkeypatch.setattr(atomic, "fcntl", system)
        lock_folder(tmp_path).release()


FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("step", "error", "code", "words"),
    [
        *((step, FULL, 1, ["No space left on device", "part.json"])
          for step in ("write", "fsync", "replace")),
        ("fsync", KeyboardInterrupt(), 130, ["run the same command again"]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("before", [{"x": 1}, None])
def test_a_full_disk_and_an_interrupt_while_writing_are_one_line_and_keep_what_was_there(
    tmp_path, monkeypatch, step, error, code, words, before
):
    folder = RunFolder(tmp_path, "one")
    if before:
        folder.save("part", before)

    def stop(*_):
        raise error

    def work() -> None:
        with monkeypatch.context() as patch:
            if step == "write":
                full = nullcontext(SimpleNamespace(write=stop))
                patch.setattr("discover.study.atomic.os.fdopen", lambda *a, **k: full)
            else:
                patch.setattr(os, step, stop)
            folder.save("part", {"x": 2})

    app = typer.Typer()
    app.command()(guarded(work))
    result = CliRunner().invoke(app, [])
    assert result.exit_code == code
    assert result.stderr.count("\n") == 1
    assert all(word in result.stderr for word in words)
    assert folder.load("part") == before
    assert not list(tmp_path.rglob(f"*{PART_SUFFIX}"))


# the module alone: the package would import much before the first write
WRITER = """
import importlib.util, sys
spec = importlib.util.spec_from_file_location("atomic", sys.argv[2])
atomic = importlib.util.module_from_spec(spec)
spec.loader.exec_module(atomic)
write_text = atomic.write_text
print("ready", flush=True)
i = 0
while True:
    write_text(sys.argv[1], str(i % 10) * 2_000_000)
    i += 1
"""


def test_a_kill_at_any_moment_leaves_a_whole_file(tmp_path):
    target = tmp_path / "part.json"
    write_text(target, "x" * 2_000_000)
    for delay in (0.0, 0.013, 0.031):
        process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(target), str(atomic.__file__)],
            stdout=subprocess.PIPE,
            text=True,
        )
        process.stdout.readline()
        time.sleep(delay)
        process.kill()
        process.wait()
        text = target.read_text()
        assert len(text) == 2_000_000
        assert len(set(text)) == 1  # of one piece


def test_a_read_only_folder_is_refused_at_the_start(tmp_path, monkeypatch):
    def forbidden(*_args, **_kwargs):
        raise PermissionError(errno.EACCES, "Permission denied", "x")

    # the tests may run as root, whom no mode stops
    for what, name, stand_in, said in (
        (os, "access", lambda *_: False, r"cannot be written to.*--out"),
        (os, "open", forbidden, r"Permission denied.*--out"),
        (Path, "mkdir", forbidden, r"Permission denied.*--out"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(what, name, stand_in)
            with pytest.raises(InputError, match=said):
                RunFolder(tmp_path / name, "one")


def test_a_part_of_another_study_or_edited_by_hand_is_never_taken_over(tmp_path):
    folder = RunFolder(tmp_path / "a", "one")
    folder.save("part", {"x": 1})
    (tmp_path / "a" / "state" / "study.json").unlink()  # as a crash of the disk might leave it
    for _ in range(2):
        assert RunFolder(tmp_path / "a", "two").load("part") is None
    folder = RunFolder(tmp_path / "b", "one")
    folder.save("part", {"x": 0.5, 2: [float("nan")], 10: None})
    assert folder.load("part")["x"] == 0.5
    file = tmp_path / "b" / "state" / "part.json"
    file.write_text(file.read_text().replace("0.5", "0.6"))
    assert folder.load("part") is None


def test_no_result_can_depend_on_the_calendar():
    """Only durations are measured, by a clock that nobody can set."""
    wall_clocks = {("time", "time"), ("datetime", "now"), ("datetime", "utcnow"), ("date", "today")}
    packages = Path(discover.__file__).parents[1]
    for folder in ("discover", "tensor_library"):
        for file in (packages / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                    assert (node.value.id, node.attr) not in wall_clocks, file
                if isinstance(node, ast.ImportFrom) and node.module == "time":
                    assert "time" not in {alias.name for alias in node.names}, file


@pytest.fixture
def umask():
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


NO_PLAIN_FILES = {
    "link": lambda path: path.symlink_to(path.with_name("target")),
    "dangling link": lambda path: path.symlink_to(path.with_name("nowhere")),
    "pipe": os.mkfifo,
    "folder": os.mkdir,
}


@pytest.mark.parametrize("make", NO_PLAIN_FILES.values(), ids=NO_PLAIN_FILES)
def test_what_is_no_plain_file_is_not_replaced(tmp_path, make):
    (tmp_path / "target").write_text("theirs")
    make(tmp_path / "law.py")
    before = os.lstat(tmp_path / "law.py")
    with pytest.raises(InputError, match="no plain file"):
        write_text(tmp_path / "law.py", "law")
    assert os.lstat(tmp_path / "law.py")[:3] == before[:3]
    assert (tmp_path / "target").read_text() == "theirs"
    assert sorted(os.listdir(tmp_path)) == ["law.py", "target"]
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


def test_what_a_command_read_may_be_gone_and_results_of_ones_own_are_replaced_within_it(tmp_path):
    (tmp_path / "a").write_text("a")
    (tmp_path / "b").write_text("b")
    with inputs_kept():
        read_bytes(tmp_path / "a", "a")
        os.replace(tmp_path / "a", tmp_path / "c")  # somebody moves it away: c is that file now
        write_text(tmp_path / "c", "new")
    assert (tmp_path / "c").read_text() == "new"
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
