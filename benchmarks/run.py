"""Every benchmark that asks the product: cases are asked, kept as lines of JSON, told as a table.

    python benchmarks/run.py TASK [--cases NAMES] [--ask QUESTIONS] [--seed N] [--out FILE]

A case, a question and a seed that stand in the file are not asked again. ``README.md`` lists the
tasks. A task is a module with `QUESTIONS`, `SEED`, `GROUPS` of names or
`names(seed)`, `run(name, question, seed, folder)`, `line(row)` and `table(rows)`; it may have a
`LIMIT` in seconds.
"""

import argparse
import importlib
import json
import signal
import tempfile
import time
import traceback
import warnings
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from types import ModuleType

TASKS = "calibration", "field", "hostile", "malformed", "measured"
TIMERS = (signal.ITIMER_PROF, signal.SIGPROF, 1), (signal.ITIMER_REAL, signal.SIGALRM, 10)
FAILED = ("refused", "fault", "late")


class Late(BaseException):
    """The time of a case is over."""


def task_named(name: str) -> ModuleType:
    """Return the module of a task."""
    return importlib.import_module(name)


def ask(task: str, name: str, question: str, seed: int, folder: str | None, limit: float) -> dict:
    """Return the row of one case: what the task says of it, or how it failed; and its seconds."""
    row: dict = {"case": name, "question": question, "seed": seed}

    def late(*_) -> None:
        raise Late

    # of the processor, for a shared machine is no fault of a case; what only waits ends as well
    for timer, number, seconds in TIMERS:
        signal.signal(number, late)
        signal.setitimer(timer, seconds * limit)
    wall, used = time.perf_counter(), time.process_time()
    try:
        with tempfile.TemporaryDirectory() as scratch, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            place = Path(folder or scratch) / f"{name}-{question}"
            place.mkdir(parents=True, exist_ok=True)
            row |= task_named(task).run(name, question, seed, place)
    except Late:
        row |= {"verdict": "late", "message": f"not done in {limit:g} s of processor"}
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        where = f" ({Path(last.filename).name}, line {last.lineno})"
        refused = type(error).__name__ == "InputError"
        row["verdict"] = "refused" if refused else "fault"
        row["message"] = str(error) if refused else f"{type(error).__name__}: {error}{where}"
    finally:
        for timer, *_ in TIMERS:
            signal.setitimer(timer, 0.0)
    used, wall = time.process_time() - used, time.perf_counter() - wall
    return {**row, "seconds": round(wall, 2), "processor_seconds": round(used, 2)}


def rounded(value):
    """Return JSON with numbers of four digits, which is what a count needs."""
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [rounded(one) for one in value]
    return float(f"{value:.4g}") if isinstance(value, float) else value


def chosen(text: str | None, names: Sequence[str], groups: dict) -> list[str]:
    """Return names: those of a list of names, groups, and ranges such as 0-99; all by default."""
    found = []
    for part in text.split(",") if text else names:
        low, _, high = part.partition("-")
        if part in names:
            found.append(part)
        elif part in groups:
            found += groups[part]
        elif low.isdigit() and high.isdigit():
            found += [n for n in names if int(low) <= int(n) <= int(high)]
        else:
            raise SystemExit(f"{part} is no case; there are {', '.join([*groups, *names][:40])}")
    return found


def read(file: Path) -> list[dict]:
    """Return the rows of a file, none where there is no file."""
    return (
        [json.loads(line) for line in file.read_text("utf-8").splitlines()] if file.exists() else []
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Ask what is not answered yet, and print all answers of the file as tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", choices=TASKS)
    parser.add_argument("--cases", help="names, groups or ranges (0-99), with commas between")
    parser.add_argument("--ask", help="questions, with commas between; by default all")
    parser.add_argument("--seed", type=int, help="by default that of the task")
    parser.add_argument("--out", type=Path, help="file of answers; by default TASK.jsonl")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, help="seconds of processor for one case")
    parser.add_argument("--keep", help="folder in which what is asked is kept")
    parser.add_argument("--table", action="store_true", help="ask nothing")
    given = parser.parse_args(arguments)
    task = task_named(given.task)
    seed = task.SEED if given.seed is None else given.seed
    out = given.out or Path(f"{given.task}.jsonl")
    rows = read(out)
    done = {(str(r.get("case", r.get("index"))), r.get("question"), r["seed"]) for r in rows}
    groups = getattr(task, "GROUPS", {})
    names = task.names(seed) if not groups else [name for some in groups.values() for name in some]
    names = chosen(given.cases, names, groups)
    questions = given.ask.split(",") if given.ask else task.QUESTIONS
    limit = given.limit or getattr(task, "LIMIT", 3600.0)
    left = [
        (given.task, name, question, seed, given.keep, limit)
        for name in ([] if given.table else names)
        for question in questions
        if not {(name, question, seed), (name, None, seed)} & done
        and getattr(task, "is_asked", lambda *_: True)(name, question)
    ]
    fresh = getattr(task, "FRESH", None)  # cases in a process before nothing is compiled
    pool_of = partial(ProcessPoolExecutor, given.workers, get_context("spawn"))
    with pool_of(max_tasks_per_child=fresh) as pool:
        for future in as_completed([pool.submit(ask, *one) for one in left]):
            rows.append(rounded(future.result()))
            with out.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
            print(line(task, rows[-1]), flush=True)
    print(task.table(rows))


def line(task: ModuleType, row: dict) -> str:
    """Return one row of the log, and below it what is false and what is noted."""
    failed = row.get("verdict") in FAILED
    said = row["message"] if failed else task.line(row)
    text = f"{row['case']} {row['question']}: {row.get('verdict', '')} {said}"
    more = [f"    FALSE: {one}" for one in row.get("false", ())]
    more += [f"    {one}" for one in row.get("notes", ())]
    return "\n".join([f"{text} {row['processor_seconds']:.0f} s", *more])


if __name__ == "__main__":
    main()
