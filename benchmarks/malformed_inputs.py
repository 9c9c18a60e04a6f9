"""Malformed inputs against the command line: every one must end in one clear message and code 2.

    python benchmarks/malformed_inputs.py [cases] [seed] [--show]

Study files, data folders, result folders, exports, mappings and options are mutated, and the
command that reads them runs in this process by its real entry. A case fails if the command ends
with another code than 0 or 2, shows a traceback, takes longer than `LIMIT` seconds, or refuses
without naming the place and a remedy. A mutated input that is valid after all counts as accepted:
a command that starts to compute is stopped there. Prints the counts, and with ``--show`` one
message of each sort.
"""

import contextlib
import io
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from malformed_cases import KINDS, Case

LIMIT = 120.0
"""Seconds; one case takes some 10 ms, the first some seconds on a busy machine: only a hang takes
as long."""

MEMORY = 16 * 2**30
"""Bytes that the process may address."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended: exit code, what it printed, seconds; code None for one that started."""

    code: int | None
    stdout: str
    stderr: str
    seconds: float


class _Started(BaseException):
    """The input was accepted: the command began to compute."""


class _TooLong(BaseException):
    """The time is up."""


@contextlib.contextmanager
def stopped_at_the_first_computation() -> Iterator[None]:
    """Let commands go on until they begin to compute, and no further."""
    import discover.batch.tasks as tasks
    import discover.cli.study_commands as commands
    import discover.comparison.instrument.known as comparison

    def report(label: str, fraction: float) -> None:
        if "declared model on" in label or "starting" in label:
            raise _Started

    def settle(model, dataset):
        if model.free:
            raise _Started
        return model

    kept = commands.progress_bar, tasks.fit_declared, comparison.comparison_flows
    commands.progress_bar = lambda quiet: contextlib.nullcontext(report)
    tasks.fit_declared = settle
    comparison.comparison_flows = lambda data, deborah, pipkin=(): []
    try:
        yield
    finally:
        commands.progress_bar, tasks.fit_declared, comparison.comparison_flows = kept


def run(arguments: list[str]) -> Outcome:
    """Run the command as a shell would; standard streams are UTF-8, as in a terminal."""
    from discover.cli import main

    out, err = (
        io.TextIOWrapper(io.BytesIO(), "utf-8", errors=errors)
        for errors in ("strict", "backslashreplace")
    )
    argv, sys.argv = sys.argv, ["discover", *arguments]
    handler = signal.signal(signal.SIGALRM, _time_is_up)
    signal.setitimer(signal.ITIMER_REAL, LIMIT)
    started = time.perf_counter()
    code: int | None = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except _Started:
        code = None
    except _TooLong:
        code = 124
    except BaseException as error:
        code = 1
        print(f"Traceback: {type(error).__name__}: {error}", file=err)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        sys.argv = argv
    seconds = time.perf_counter() - started
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode("utf-8"))  # type: ignore[attr-defined]
    return Outcome(code, texts[0], texts[1], seconds)


def _time_is_up(*_: object) -> None:
    raise _TooLong


_REMEDY = re.compile(
    r"\b(add|change|check|choose|close|correct|declare|download|export|give|keep|known keys|leave"
    r"|make|mend|must be|name (it|its|one|the|other)|names are case-sensitive|needs|put"
    r"|remove|rename|replace|run again|sample|save|say|set|should (be|have)|sort|take|try|use|wait"
    r"|write|is \S+ meant)\b",
    re.IGNORECASE,
)


def complaint(case: Case, outcome: Outcome) -> str | None:
    """Return what is wrong with how a command ended, or None."""
    everything = outcome.stdout + outcome.stderr
    if outcome.code == 124:
        return "takes too long"
    if "Traceback" in everything or "not your input's fault" in everything:
        return "fails in the software"
    if outcome.code in (0, None):
        return None
    if outcome.code != 2:
        return f"ends with {outcome.code}"
    said = [line for line in everything.splitlines() if line.startswith(("discover: ", "error: "))]
    if case.arguments[0] == "data" and "--json" in case.arguments:
        said = said or [outcome.stdout]
    if not said and re.search(r"Usage:.*Error", outcome.stderr, re.DOTALL):
        return None  # typer's own words on options
    if any(not (c.isprintable() or c == "\n") for c in everything):
        return "prints what a terminal would obey"
    if not said:
        return "says nothing"
    for line in said:
        if not any(name in line for name in case.names):
            return "names no place"
        if len(line) > 1200:
            return "says too much"
        if not _REMEDY.search(line):
            return "names no remedy"
    return None


def attempt(kind: str, seed: int, root: Path) -> tuple[Case, Outcome, str | None]:
    """Make one case of a kind in an empty folder, run it, and judge it."""
    case = KINDS[kind](root, random.Random(f"{kind} {seed}"))
    outcome = run(case.arguments)
    return case, outcome, complaint(case, outcome)


def main(cases: int = 3000, seed: int = 0, show: bool = False) -> int:
    """Run the cases, the kinds in turn, and print the counts."""
    os.environ.pop("DISCOVER_DATA", None)
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    sorts: dict[str, str] = {}
    slowest = 0.0
    failures = 0
    # what reads a device for ever ends in an error and not in this machine's memory
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as scratch, stopped_at_the_first_computation():
        os.chdir(scratch)  # a default of --out must not land in the project
        for i in range(cases):
            kind = list(KINDS)[i % len(KINDS)]
            root = Path(scratch) / f"case{i}"
            root.mkdir()
            case, outcome, wrong = attempt(kind, seed + i, root)
            slowest = max(slowest, outcome.seconds)
            ended = "refused" if outcome.code == 2 else "accepted"
            counts[kind]["wrong" if wrong else ended] += 1
            text = (outcome.stderr or outcome.stdout).replace(str(root), "FOLDER").strip()
            if wrong:
                failures += 1
                command = " ".join(case.arguments).replace(str(root), "FOLDER")
                print(f"{kind}, seed {seed + i}: {wrong}\n  {command[:200]!r}\n  {text[-600:]!r}")
            elif outcome.code == 2:
                sorts.setdefault(kind + re.sub(r"'[^']*'|\d+|\S*\.\w+", "·", text)[:60], text)
        os.chdir(here)
    if show:
        for text in sorts.values():
            print(text[:400])
    print(f"{'':<24}{'refused':>9}{'accepted':>10}{'wrong':>7}")
    for kind, count in counts.items():
        print(f"{kind:<24}{count['refused']:>9}{count['accepted']:>10}{count['wrong']:>7}")
    print(f"{len(sorts)} sorts of message; the slowest case took {slowest:.1f} s")
    return 1 if failures else 0


if __name__ == "__main__":
    numbers = [int(argument) for argument in sys.argv[1:] if argument != "--show"]
    sys.exit(main(*numbers, show="--show" in sys.argv))
