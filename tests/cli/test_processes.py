"""The command as a process: its cache, what guards it, and how it is interrupted."""

import os
import signal
import subprocess
import sys
import time
import zlib

import pytest
import typer
from typer.testing import CliRunner

from discover.cli import interruption
from discover.cli.guard import guarded
from discover.cli.interruption import INTERRUPTED, INTERRUPTED_CODE, obeying_interrupts
from discover.compilation_cache import remove_cut_short
from discover.errors import InputError

SIMULATE = """
import sys
from discover.compilation_cache import enable_compilation_cache
enable_compilation_cache(sys.argv[1])
import numpy as np
from discover.laws import Fluid, Giesekus
from discover.protocols import start_up
from discover.simulate import simulate
simulate(Fluid(Giesekus(0.3), np.ones(1), np.ones(1)), start_up(2.0), np.linspace(0.1, 3.0, 7))
"""


def start(folder):
    """What a process says that simulates with a cache folder."""
    command = [sys.executable, "-c", SIMULATE, str(folder)]
    return subprocess.run(command, check=True, timeout=300, capture_output=True, text=True).stderr


@pytest.mark.slow
def test_a_program_with_a_solver_in_it_is_kept_and_one_cut_short_is_made_again(tmp_path):
    # a check that calls back to Python would make it one that cannot be kept
    start(tmp_path)
    (kept,) = (path for path in tmp_path.iterdir() if "_solve_adaptively" in path.name)
    whole = kept.read_bytes()
    kept.write_bytes(whole[: len(whole) // 2])  # as a full disk does, or a kill
    assert start(tmp_path) == ""
    assert kept.stat().st_size > 0.9 * len(whole)


def test_whole_programs_are_left_and_broken_ones_go(tmp_path):
    whole = zlib.compress(b"program " * 1000)
    contents = {"jit_a": whole, "jit_b": whole[:-3], "jit_c": b"", "jit_d": b"nonsense"}
    for name, content in contents.items():
        (tmp_path / f"{name}-{'0f' * 32}-cache").write_bytes(content)
    (tmp_path / "web-cache").write_bytes(b"no program, and somebody else's")
    remove_cut_short(tmp_path)
    left = sorted(path.name.partition("-")[0] for path in tmp_path.glob("*-cache"))
    assert left == ["jit_a", "web"]


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
        (KeyboardInterrupt(), 130, "run the same command again"),
        (InputError("there is no run 'a'"), 2, "there is no run 'a'"),
        (PermissionError(13, "Permission denied", "out"), 1, "out"),
        (ZeroDivisionError("division by zero"), 1, "not your input's fault"),
    ],
)
def test_each_end_has_a_code_of_its_own_and_says_what_to_do(error, code, said, monkeypatch):
    monkeypatch.delenv("DISCOVER_DEBUG", raising=False)
    done = ended_with(error)
    assert done.exit_code == code
    assert said in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_a_command_that_ends_well_says_nothing():
    done = ended_with(typer.Exit())
    assert (done.exit_code, done.output) == (0, "")


# a call without a Python instruction for minutes, as the compiler's are
AT_WORK = """
import hashlib, signal, sys, time
from discover.cli import interruption
from discover.cli.interruption import obeying_interrupts
from discover.stop_callbacks import on_stop

interruption._PATIENCE = float(sys.argv[1])
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
        [sys.executable, "-c", AT_WORK, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert process.stdout.readline() == "at work\n"
    started = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    try:
        out, err = process.communicate(timeout=30)
    finally:
        process.kill()
    return out, err, process.returncode, time.monotonic() - started


def test_a_call_that_python_cannot_interrupt_is_left_with_one_line():
    out, err, code, seconds = interrupted("10.0", "0.0")
    assert (out, err, code) == ("last words\n", f"discover: {INTERRUPTED}\n", INTERRUPTED_CODE)
    assert INTERRUPTED_CODE == 130
    assert seconds < 15  # and not the hour that the call takes


def test_last_words_that_do_not_end_are_cut_short():
    out, err, code, _ = interrupted("0.2", "60.0")
    assert (out, err, code) == ("", f"discover: {INTERRUPTED}\n", INTERRUPTED_CODE)


def test_who_ignores_the_signal_goes_on_ignoring_it(monkeypatch):
    monkeypatch.setattr(interruption, "run_stop_callbacks", lambda: pytest.fail("nobody pressed"))
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
