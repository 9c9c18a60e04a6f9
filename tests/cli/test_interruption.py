"""Ctrl-C: obeyed at once, in the middle of a call that Python cannot interrupt."""

import os
import signal
import subprocess
import sys
import time

import pytest

from discover.cli import console
from discover.cli.console import INTERRUPTED, INTERRUPTED_CODE, obeying_interrupts

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
