"""Malformed inputs at every place where something is read: what comes of each.

Sane files are harmed by `harm`, and the command that reads them runs in this process by its real
entry, up to its first computation. Wanted is an end with code 0, or one message with a place and a
remedy and code 2. Wrong are tracebacks, hangs, other codes, messages without a place or a remedy or
with what a terminal would obey, and nonsense that is taken without a word.
"""

import contextlib
import io
import os
import random
import re
import resource
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from malformed_kinds import KINDS, Case

QUESTIONS, SEED, LIMIT = ("harm",), 0, 120.0
"""Seconds: a case takes some 10 ms, the first some seconds on a busy machine."""
MEMORY = 16 * 2**30
EACH = 200


@dataclass(frozen=True)
class Outcome:
    """How a call ended: exit code, what it printed; code None for one that began to compute."""

    code: int | None
    stdout: str = ""
    stderr: str = ""


class Started(BaseException):
    """The input was accepted: the command began to compute."""


@contextmanager
def stopped_at_the_first_computation() -> Iterator[None]:
    """Let commands go on until they begin to compute, and no further."""

    def report(label: str, fraction: float) -> None:
        if "declared model on" in label or "starting" in label:
            raise Started

    def start(*_, **__):
        raise Started

    bar = "discover.cli.app.progress_bar"
    with (
        patch(bar, lambda quiet: contextlib.nullcontext(report)),
        patch("discover.inference.rows.make_batch", start),
    ):
        yield


def run_call(call: list[str] | Callable[[], object]) -> Outcome:
    """Run a call as a shell would; standard streams are UTF-8, as in a terminal."""
    from discover.cli import main
    from discover.errors import InputError

    out, err = (
        io.TextIOWrapper(io.BytesIO(), "utf-8", errors=errors)
        for errors in ("strict", "backslashreplace")
    )

    argv, sys.argv = sys.argv, ["discover", *(call if isinstance(call, list) else ())]
    code: int | None = 0
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            main() if isinstance(call, list) else call()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except Started:
        code = None
    except InputError as error:
        code = 2
        print(f"discover: {error}", file=err)
    except Exception as error:
        code = 1
        print(f"Traceback: {type(error).__name__}: {error}", file=err)
    finally:
        sys.argv = argv
        out.flush()
        err.flush()
    return Outcome(code, *(one.buffer.getvalue().decode() for one in (out, err)))


_REMEDY = re.compile(
    r"\b(add|change|check|choose|close|copy|correct|declare|download|export|fix|give|install|keep"
    r"|known keys|leave|make|mend|must|name|names are case-sensitive|needs|one of|put|remove|rename"
    r"|replace|run|sample|save|say|see|set|should|sort|take|try|use|wait|widen|write"
    r"|is \S+ meant)\b",
    re.IGNORECASE,
)


def complaint(case: Case, outcome: Outcome) -> str | None:
    """Return what is wrong with how a call ended, or None."""
    everything = outcome.stdout + outcome.stderr
    if "Traceback" in everything or "not your input's fault" in everything:
        return "fails in the software"
    if outcome.code in (0, None):
        warned = "warning" in everything.lower() or "is read as" in everything
        return f"takes nonsense: {case.nonsense}" if case.nonsense and not warned else None
    if outcome.code != 2:
        return f"ends with {outcome.code}"
    # each problem of a list is judged, beside the place that its first line names
    listed = re.sub(
        r"^(discover: .*) problems\.\n((?: *- .*\n?)+)",
        lambda found: "".join(f"{found[1]}: {one}\n" for one in found[2].splitlines()),
        everything,
        flags=re.MULTILINE,
    )
    said = [line for line in listed.splitlines() if line.startswith(("discover: ", "error: "))]
    if isinstance(case.call, list) and "--json" in case.call:
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


GROUPS = {kind: [f"{kind} {number}" for number in range(EACH)] for kind in KINDS}


def attempt(kind: str, seed: int, root: Path) -> tuple[Case, Outcome, str | None]:
    """Make one case of a kind in an empty folder, run it, and judge it."""
    case = KINDS[kind](root, random.Random(f"{kind} {seed}"))
    outcome = run_call(case.call)
    return case, outcome, complaint(case, outcome)


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return how a command ended on one input, and what is wrong with that."""
    os.environ.pop("DISCOVER_DATA", None)
    # what reads a device for ever ends in an error and not in this machine's memory
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, resource.RLIM_INFINITY))
    kind, number = name.rsplit(" ", 1)
    here = Path.cwd()
    os.chdir(folder)  # a default of --out must not land in the project
    root = folder / "case"
    root.mkdir()
    try:
        with stopped_at_the_first_computation():
            _, outcome, wrong = attempt(kind, seed + int(number), root)
    finally:
        os.chdir(here)
    text = (outcome.stderr or outcome.stdout).replace(str(root), "FOLDER").strip()
    verdict = "wrong" if wrong else "refused" if outcome.code == 2 else "accepted"
    said = text.encode("ascii", "backslashreplace").decode()[-600:]
    return {"verdict": verdict, "message": said, "false": [wrong] if wrong else []}


def line(row: dict) -> str:
    return row["message"]


def table(rows: list[dict]) -> str:
    """Return how many inputs of each kind were refused, accepted, and dealt with wrongly."""
    heads = ("refused", "accepted", "wrong", "fault", "late")
    counts = Counter((row["case"].rsplit(" ", 1)[0], row["verdict"]) for row in rows)
    lines = [f"| kind | {' | '.join(heads)} |", "|---" * 6 + "|"]
    for kind in KINDS:
        lines.append(f"| {kind} | {' | '.join(str(counts[kind, head]) for head in heads)} |")
    return "\n".join(lines)
