"""Sixty records with bad days: what is claimed of them, against what is true.

Every record comes from `independent`, which shares nothing with the software under test; the
software gets a data folder and a study file and no more. What it must not do is to be sure and
wrong. The rules were written before the first run:

1. **No signal** (noise alone, a dead sensor): any verdict but `unexplained` and `no_signal` is a
   falsehood. So is an error message none: a refusal is as good.
2. **Outside** (a law in no library, a fault in no dictionary, a record taken for another):
   `explained`, `effects_added` and `no_effect_needed` are falsehoods where the prediction of the
   law found misses the record without its noise by more than half the noise over the fitted runs,
   or by more than the noise over the held-out ones. Nearer than that σ12 cannot tell; such cases
   are listed apart.
3. **Names**: under `effects_added` every effect named is one that is there, or its list of aliases
   holds one; what comes to the same in the flows of a case is written down with the case. This
   holds for cases outside too, however well the false effect fits.
4. `no_effect_needed` where something of the dictionary is there and the declared law misses by more
   than half the noise.
5. **Intervals**: under `effects_added`, a constant that was planted lies within three half-widths
   of its 95 % interval.
6. **N1 and N2** of a comparison, where they are not `undetermined` and not `determined = "no"`: in
   no run is the rms error more than twice the rms half-band. No band is a claim to be exact, to 1 %
   of N1.

To say `unexplained` of what could be explained is no falsehood; it is listed.
A traceback is a fault and is counted apart. Finished cases are kept, one JSON file each.

    python benchmarks/bad_days.py --out bad_days
    python benchmarks/bad_days.py --out bad_days --part 1/2 --task close-loop
    python benchmarks/bad_days.py --out bad_days --cases pom_pom,dead_sensor --again
"""

import argparse
import json
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from bad_day_cases import CASES, Case
from bad_day_rules import Runs, judge
from independent.folders import write_folder, write_study, write_table

COMPARE = {
    "learners": ["tensor_sindy"],
    "quick": True,
    "high_deborah": [3.0],
    "next": {"flows": ["start_up"], "weissenberg_numbers": [2.0], "deborah_numbers": [1.0]},
}


def make(case: Case, seed: int) -> tuple[Runs, Runs]:
    """Return the runs without and with their noise; the same for the same seed."""
    clean = case.runs()
    noisy = {}
    for number, (name, run) in enumerate(clean.items()):
        generator = np.random.default_rng([seed, number])
        noisy[name] = replace(run, stress=case.noise(run.stress, generator))
    return clean, noisy


def write(case: Case, noisy: Runs, folder: Path) -> dict[str, Path]:
    """Write the data folder and a study for each task; return the studies."""
    data = write_folder(folder / "data", noisy)
    sweep = case.sweep()
    if sweep is not None:
        write_table(data / "lve.csv", sweep)
    held_out = {"held_out": list(case.held_out)} if case.held_out else {}
    source = {"folder": str(data.resolve()), **held_out}
    loop = {"effects": "named", "max_effects": 2, **case.loop}
    studies = {"close-loop": {"data": source, "model": case.model, "loop": loop}}
    if case.compare is not None:
        studies["compare"] = {"data": source, "model": case.compare, "compare": COMPARE}
    return {task: write_study(folder / f"{task}.toml", s) for task, s in studies.items()}


@contextmanager
def without_pages() -> Iterator[None]:
    """Write JSON and predictions alone: to draw a page takes as long as to decide."""
    from discover.report.comparison import report as comparison_report
    from discover.report.loop import report as loop_report
    from discover.report.predictions import (
        comparison_predictions,
        loop_predictions,
        write_predictions,
    )

    def loop(result, folder, *of_the_page, **of_it):
        result.write_json(folder.path / "loop.json")
        write_predictions(loop_predictions(result), folder)

    def comparison(result, folder, *of_the_page, **of_it):
        folder.write("comparison.json", json.dumps(result.to_json(), indent=1) + "\n")
        write_predictions(comparison_predictions(result), folder)

    with (
        patch.object(loop_report, "write_loop", loop),
        patch.object(comparison_report, "write_comparison", comparison),
    ):
        yield


def run(name: str, task: str, out: Path, seed: int, pages: bool) -> dict:
    """Return the row of one case and task."""
    case, folder = CASES[name], out / name
    clean, noisy = make(case, seed)
    study = write(case, noisy, folder)[task]
    row = {"case": name, "task": task, "truth": case.truth}
    started = time.perf_counter()
    row |= answer(
        study, task, folder / task, pages, lambda: judge(case, task, folder / task, clean, noisy)
    )
    return {**row, "seconds": time.perf_counter() - started}


def answer(study: Path, task: str, out: Path, pages: bool, judged: Callable[[], dict]) -> dict:
    """Return what a command says of a study and what is wrong with it, or how it ended."""
    from discover.batch.tasks import run_close_loop, run_compare
    from discover.errors import InputError

    execute = run_close_loop if task == "close-loop" else run_compare
    try:
        with warnings.catch_warnings(), nullcontext() if pages else without_pages():
            warnings.simplefilter("ignore")
            execute(study, out, None, True, lambda text, fraction: None)
        return judged()
    except InputError as error:
        ended = {"verdict": "refused", "message": str(error)}
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__}: {error} ({Path(last.filename).name}, line {last.lineno})"
        ended = {"verdict": "fault", "message": text}
    return {**ended, "falsehoods": [], "notes": []}


def line(row: dict) -> str:
    """Return one line of the table, and one more for each falsehood and note."""
    named = ", ".join(
        s["effect"] + (f" (or {', '.join(s['aliases'])})" if s["aliases"] else "")
        for s in row.get("stages", [])
    )
    misses = "; ".join(
        f"{fit:.2g}" + ("" if held is None else f", {held:.2g}")
        for fit, held in row.get("miss_over_noise", {}).values()
    )
    text = (
        f"{row['case']:30s} {row['task']:10s} {row['truth'][:38]:38s} {row['verdict']:16s} "
        f"{named or '-':30s} {misses:14s} {row['seconds']:4.0f} s"
    )
    for falsehood in row["falsehoods"]:
        text += f"\n    FALSE: {falsehood}"
    for note in [*row["notes"], *([row["message"]] if "message" in row else [])]:
        text += f"\n    {note}"
    return text


def main() -> None:
    """Run or resume the records and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("bad_days"))
    parser.add_argument("--cases", help="names, separated by commas")
    parser.add_argument("--part", default="1/1", help="which part of the cases, such as 1/2")
    parser.add_argument("--task", choices=["close-loop", "compare", "both"], default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="run finished cases again")
    parser.add_argument("--pages", action="store_true", help="draw the pages too")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="stop after so long")
    options = parser.parse_args()
    names = options.cases.split(",") if options.cases else list(CASES)
    unknown = [name for name in names if name not in CASES]
    if unknown:
        parser.error(f"unknown case {unknown[0]!r}; the cases are {', '.join(CASES)}")
    part, parts = map(int, options.part.split("/"))
    wanted = [
        (name, task)
        for name in names[part - 1 :: parts]
        for task in ("close-loop", "compare")
        if options.task in (task, "both") and not (task == "compare" and not CASES[name].compare)
    ]
    kept = options.out / "rows"
    kept.mkdir(parents=True, exist_ok=True)
    rows, started = [], time.perf_counter()
    print(f"{'case':30s} {'task':10s} {'truth':38s} {'verdict':16s} {'named':30s} miss/noise")
    for name, task in wanted:
        file = kept / f"{name}.{task}.json"
        if file.exists() and not options.again:
            row = json.loads(file.read_text(encoding="utf-8"))
        elif time.perf_counter() - started > options.seconds:
            continue
        else:
            row = run(name, task, options.out, options.seed, options.pages)
            file.write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
        rows.append(row)
        print(line(row), flush=True)
    false = [row for row in rows if row["falsehoods"]]
    faults = [row for row in rows if row["verdict"] == "fault"]
    print(
        f"\n{len(rows)} of {len(wanted)} done; confident falsehoods {len(false)}, faults "
        f"{len(faults)}, refused {sum(row['verdict'] == 'refused' for row in rows)}, not told "
        f"apart {sum('not to be told' in ' '.join(row['notes']) for row in rows)}, not explained "
        f"though possible {sum('though it could' in ' '.join(row['notes']) for row in rows)}"
    )


if __name__ == "__main__":
    main()
