"""How commands end: one line, a code of its own, and Ctrl-C where Python cannot be stopped."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
import typer
from typer.testing import CliRunner

from discover.cli import console
from discover.cli.console import INTERRUPTED_CODE, guarded, obeying_interrupts
from discover.errors import InputError
from discover.study import run_folder

# a call without a Python instruction for minutes, as the compiler's are
AT_WORK = """
import hashlib, signal, sys, time
from discover.cli import console
from discover.cli.console import obeying_interrupts
from discover.progress import on_stop

console._PATIENCE = float(sys.argv[1])
# a shell's & has it ignored in all that it starts, the tests among them
signal.signal(signal.SIGINT, signal.default_int_handler)

def words():
    time.sleep(float(sys.argv[2]))
    print("last words")

with obeying_interrupts(), on_stop(words):
    print("at work", flush=True)
    hashlib.pbkdf2_hmac("sha256", b"", b"", 2**31 - 1)
"""


def interrupted(*arguments):
    """What a program says that hears Ctrl-C as from a terminal, its exit code, and the wait."""
    process = subprocess.Popen(
        [sys.executable, "-c", AT_WORK, *arguments], stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stdout.readline() == "at work\n"
    started = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    try:
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    return out, err, process.returncode, time.monotonic() - started


def test_a_call_that_python_cannot_interrupt_is_left_with_one_line_and_last_words_cut_short():
    out, err, code, seconds = interrupted("10.0", "0.0")
    assert (out, err, code) == ("last words\n", "discover: interrupted.\n", INTERRUPTED_CODE)
    assert INTERRUPTED_CODE == 130
    assert seconds < 15  # and not the hour that the call takes
    out, err, code, _ = interrupted("0.2", "60.0")
    assert (out, err, code) == ("", "discover: interrupted.\n", INTERRUPTED_CODE)


def test_who_ignores_the_signal_goes_on_ignoring_it(monkeypatch):
    monkeypatch.setattr(console, "run_stop_callbacks", lambda: pytest.fail("nobody pressed"))
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as nohup and a shell's & do
    try:
        with obeying_interrupts():
            assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
            os.kill(os.getpid(), signal.SIGINT)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        with obeying_interrupts():
            assert signal.getsignal(signal.SIGINT) is not signal.default_int_handler
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert signal.set_wakeup_fd(-1) == -1


def ended_with(error):
    app = typer.Typer()

    @app.command()
    @guarded
    def command() -> None:
        raise error

    return CliRunner().invoke(app, [])


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (KeyboardInterrupt(), 130, "interrupted."),
        (InputError("there is no run 'a'"), 2, "there is no run 'a'"),
        (PermissionError(13, "Permission denied", "out"), 1, "out"),
        (RuntimeError("it broke\nin two"), 1, "RuntimeError: it broke (not your input's fault"),
    ],
)
def test_each_end_has_a_code_of_its_own_and_says_what_to_do(error, code, said, monkeypatch):
    monkeypatch.delenv("DISCOVER_DEBUG", raising=False)
    done = ended_with(error)
    assert done.exit_code == code
    assert said in done.stderr
    assert done.stderr.strip().count("\n") == 0
    assert done.stdout == ""
    well = ended_with(typer.Exit())  # the control
    assert (well.exit_code, well.output) == (0, "")


def test_what_was_finished_is_kept_only_once_there_is_a_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(console, "resumable", event := threading.Event())
    monkeypatch.setattr(run_folder, "resumable", event)
    assert console.interrupted() == "interrupted."
    run_folder.RunFolder(tmp_path, "a study")
    assert "run the same command again" in console.interrupted()
