"""Bad days while writing: full disks, read-only folders, kills, two processes, moving clocks."""

import ast
import errno
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

import discover
from discover.cli.console import guarded
from discover.errors import InputError
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
    """Another process that works in a result folder."""
    out = tmp_path / "out"
    process = subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(out)], stdout=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
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


def test_one_process_may_open_its_folder_twice_and_forgetting_it_unlocks(tmp_path):
    first = RunFolder(tmp_path, "one")
    second = RunFolder(tmp_path, "one")
    assert first._lock is second._lock
    del first, second
    assert not (tmp_path / LOCK_FILE).exists()


def test_where_the_file_system_knows_no_locks_one_works_without(tmp_path, monkeypatch):
    class NoLocks:
        LOCK_EX = LOCK_NB = 0

        @staticmethod
        def flock(*_):
            raise OSError(errno.ENOLCK, "No locks available")

    for system in (NoLocks, None):
        monkeypatch.setattr(atomic, "fcntl", system)
        lock_folder(tmp_path).release()


def command(action):
    import typer

    app = typer.Typer()
    app.command()(guarded(action))
    return CliRunner().invoke(app, [])


FULL = OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize(
    ("step", "error", "code", "words"),
    [
        ("write", FULL, 1, ["No space left on device", "part.json"]),
        ("fsync", FULL, 1, ["No space left on device", "part.json"]),
        ("replace", FULL, 1, ["No space left on device", "part.json"]),
        ("fsync", KeyboardInterrupt(), 130, ["run the same command again"]),
    ],
)
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
                patch.setattr("discover.study.atomic.os.fdopen", lambda *a, **k: _FullDisk(stop))
            else:
                patch.setattr(os, step, stop)
            folder.save("part", {"x": 2})

    result = command(work)
    assert result.exit_code == code
    assert result.stderr.count("\n") == 1
    assert all(word in result.stderr for word in words)
    assert folder.load("part") == before
    assert not list(tmp_path.rglob(f"*{PART_SUFFIX}"))


class _FullDisk:
    def __init__(self, write):
        self.write = write

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return False


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
        assert process.stdout is not None
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
    with monkeypatch.context() as patch:
        patch.setattr("discover.study.atomic.os.access", lambda *_: False)
        with pytest.raises(InputError, match=r"cannot be written to.*--out"):
            RunFolder(tmp_path / "a", "one")
    with monkeypatch.context() as patch:
        patch.setattr("discover.study.atomic.os.open", forbidden)
        with pytest.raises(InputError, match=r"Permission denied.*--out"):
            RunFolder(tmp_path / "b", "one")
    with monkeypatch.context() as patch:
        patch.setattr(Path, "mkdir", forbidden)
        with pytest.raises(InputError, match=r"Permission denied.*--out"):
            RunFolder(tmp_path / "c", "one")


def test_a_part_of_another_study_is_never_taken_over(tmp_path):
    folder = RunFolder(tmp_path, "one")
    folder.save("part", {"x": 1})
    (tmp_path / "state" / "study.json").unlink()  # as a crash of the disk might leave it
    other = RunFolder(tmp_path, "two")
    assert other.load("part") is None
    assert RunFolder(tmp_path, "two").load("part") is None


def test_a_part_edited_by_hand_is_computed_again(tmp_path):
    folder = RunFolder(tmp_path, "one")
    folder.save("part", {"x": 0.5, 2: [float("nan")], 10: None})
    file = tmp_path / "state" / "part.json"
    kept = folder.load("part")
    assert kept is not None
    assert kept["x"] == 0.5
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
