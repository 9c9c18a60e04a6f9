"""Hostile inputs at the real command line: what is refused how, and what nonsense is taken.

    python benchmarks/hostile_inputs.py [cases=2000] [seed=1]

Each case runs the command in this process up to its first computation (to its end where that is
cheap, as for `data check`), with limits of time and memory. Wanted: no traceback, no hang, no exit
1 for an input, no message without what was got, what was wanted and how to mend it. Nonsense that
was taken is listed, to be looked at.
"""

import json
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

from hostile_grammar import UNITS, Case, folder_case, study_case
from hostile_results import export_case, import_case, options_case, planted_case
from typer.testing import CliRunner

from discover.cli import app

SECONDS = 20.0  # of the wall clock, on a busy machine
MEMORY = 3_000_000_000  # bytes of address space beside what the process starts with
GENERATORS: tuple[Callable[[random.Random], Case], ...] = (
    study_case, folder_case, folder_case, export_case, planted_case, import_case, options_case,
)  # fmt: skip
# Words of which a message that helps has one: what to do, or what would do
MENDS = re.compile(
    r"\b(give|write|name|add|remove|correct|use|check|mend|save|rename|choose|leave|keep|run|try|"
    r"set|put|change|sort|make|sample|widen|wait|download|install|ask|say|export|known keys|one of|"
    r"must|should|is not in the range|is not a valid|no such option|requires an argument)\b",
    re.IGNORECASE,
)


class Reached(BaseException):
    """The first computation would begin here."""


class Hang(BaseException):
    """The time is over."""


@dataclass(frozen=True)
class Outcome:
    """How a case ended.

    Attributes
    ----------
    verdict
        ``traceback``, ``hang``, ``exit 1``, ``lacking`` (refused without what to do), ``refused``
        or ``accepted``.
    text
        What the command said.
    """

    verdict: str
    text: str


def _reach(*_: object, **__: object) -> None:
    raise Reached


@contextmanager
def up_to_the_first_computation() -> Iterator[None]:
    """Let commands go to where they would begin to compute, and no further."""
    import distributed

    client = distributed.Client
    seams = [
        ("discover.simulate.synthetic.simulate", _reach),
        ("discover.loop.loop.unfelt_scatter", _reach),
        ("discover.comparison.instrument.known.comparison_flows", _reach),
        ("discover.learners.distillation.simulate", _reach),
        ("discover.batch.run.run_in_workers", _reach),
        ("distributed.Client", lambda address, timeout: client(address, timeout="1s")),
    ]
    with ExitStack() as stack:
        for name, instead in seams:
            stack.enter_context(patch(name, instead))
        yield


def put(folder: Path, case: Case) -> None:
    """Write the files of a case; what cannot be named so is left out."""
    for name, content in case.files.items():
        path = folder / name
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            if isinstance(content, bytes):
                path.write_bytes(content)
                continue
            kind, target = content
            if kind == "pipe":
                os.mkfifo(path)
            elif kind == "folder":
                path.mkdir()
            elif kind == "link":
                path.symlink_to(path.name if target == "itself" else target)
        except OSError:
            continue


def run(case: Case, folder: Path) -> Outcome:
    """Run one case in a folder of its own."""
    put(folder, case)
    arguments = [argument.replace("{}", str(folder)) for argument in case.arguments]

    def alarm(number: int, frame: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, alarm)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    started = time.process_time()
    try:
        done = CliRunner().invoke(app, arguments)
    except Reached:
        return Outcome("accepted", "reached the computation")
    except Hang:
        return Outcome("hang", f"{time.process_time() - started:.1f} s of the processor")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    text = done.stderr.strip() or done.stdout.strip()
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        lines = traceback.format_exception(done.exception)
        return Outcome("traceback", "".join(lines[-2:]).strip())
    if done.exit_code == 0:
        return Outcome("accepted", done.stdout)
    if done.exit_code != 2:
        return Outcome("exit 1", text)
    lacks = len(text.split()) < 5 or not MENDS.search(text) or "Traceback" in text
    return Outcome("lacking" if lacks else "refused", text)


def nonsense_taken(case: Case, outcome: Outcome) -> list[str]:
    """Return what of an accepted case no sane program would have taken without a word."""
    if outcome.verdict != "accepted":
        return []
    said = outcome.text
    taken = []
    for what in filter(None, case.nonsense):
        unit = what.removeprefix("unsaid ")
        if unit in UNITS:
            if case.arguments[1] == "check" and "is read as" not in said:
                taken.append(f"{unit} converted without a word")
        elif case.arguments[1:2] != ["check"] or "warning" not in said:
            taken.append(what)
    return taken


def make(number: int, seed: int) -> Case:
    """Return one case; the same for the same number and seed, whatever ran before."""
    generator = random.Random(f"{seed}/{number}")
    return generator.choice(GENERATORS)(generator)


def all_cases(cases: range, seed: int, say: Callable[[str], None]) -> tuple[Counter, list[str]]:
    """Run cases; return the verdicts by kind, and a line for each that needs to be looked at."""
    counts: Counter = Counter()
    lines: list[str] = []
    os.environ.pop("DISCOVER_DATA", None)
    os.environ.pop("DISCOVER_DEBUG", None)
    home = Path.cwd()
    with up_to_the_first_computation(), tempfile.TemporaryDirectory() as scratch:
        os.chdir(scratch)
        try:
            for number in cases:
                case, folder = make(number, seed), Path(scratch) / f"case{number}"
                folder.mkdir()
                outcome = run(case, folder)
                shutil.rmtree(folder, ignore_errors=True)
                counts[case.kind, outcome.verdict] += 1
                found = nonsense_taken(case, outcome)
                counts[case.kind, "nonsense"] += bool(found)
                if outcome.verdict not in ("accepted", "refused") or found:
                    verdict = "nonsense accepted" if found else outcome.verdict
                    call = json.dumps(case.arguments, ensure_ascii=True)
                    line = f"{number} {verdict}: {call[:160]} {found or case.nonsense}"
                    lines.append(line + ("" if found else f"\n    {outcome.text[-600:]}"))
                    say(lines[-1])
        finally:
            os.chdir(home)
    return counts, lines


def main() -> None:
    """Run the cases of the command line's arguments and print the table."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    import jax

    jax.devices()  # what JAX maps once is no case's
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, resource.RLIM_INFINITY))
    counts, _ = all_cases(range(n), seed, print)
    columns = ("traceback", "hang", "exit 1", "lacking", "refused", "accepted", "nonsense")
    print(f"\n{n} cases, seed {seed}")
    print(f"{'kind':<10}" + "".join(f"{column:>11}" for column in columns))
    kinds = sorted({kind for kind, _ in counts})
    for kind in kinds:
        print(f"{kind:<10}" + "".join(f"{counts[kind, column]:>11}" for column in columns))
    totals = [sum(counts[kind, column] for kind in kinds) for column in columns]
    print(f"{'all':<10}" + "".join(f"{total:>11}" for total in totals))
    print("lacking: refused without what to do; nonsense: accepted though no sane program should")


if __name__ == "__main__":
    main()
