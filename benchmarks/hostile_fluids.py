"""Data sets that an outside evaluator might make: what is claimed of them, against what is true.

Made by `independent` and scipy alone, which share nothing with the software under test; it gets a
data folder and a study file and no more. The rules, written before the first run:

1. **No fluid**: any verdict but `unexplained` and `no_signal` is false. A refusal is as good.
2. **Any verdict that claims to explain** (`explained`, `effects_added`, `no_effect_needed`) is
   false where what is predicted misses the record without its noise by more than half the noise in
   the runs fitted, or by more than the noise in the run held out.
3. **Names**: under such a verdict of the loop every effect with a probability of one half or more
   is there, or is an alias of one that is. A name that is less likely than not is listed.
4. **Terms**: where the library holds what is missing, `explained` is by these terms and no others
   but such whose interval holds zero, or which are told to be another declared constant where that
   is what is there (these two exceptions came later, with the words that the page has for them; for
   a day the second held whether or not the constant was told wrong).
5. **Intervals**: a constant that is known lies within three half-widths of its 95 % interval.
6. **N1, N2, σ12** of a comparison that are not said to be open are off, in every run, by no more
   than two half-bands (rms); 1 % where there is no band.

To say `unexplained` of what could be explained is no falsehood; it is listed.

    python benchmarks/hostile_fluids.py --out hostile_fluids
    python benchmarks/hostile_fluids.py --out hostile_fluids --cases rubber,one_run --again
    python benchmarks/hostile_fluids.py --out hostile_fluids --table
"""

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from bad_days import answer
from hostile_fluids_noises_cases import CASES
from hostile_fluids_records import Case
from hostile_fluids_rules import Records, judge
from independent.folders import write_study, write_table

TASKS = ("compare", "close-loop")


def make(case: Case, seed: int) -> tuple[Records, Records]:
    """Return the runs without and with their noise; the same for the same seed."""
    clean, noisy = case.records(), {}
    for number, (name, run) in enumerate(clean.items()):
        lot = np.random.default_rng([seed, number])
        changed = {run.observed: case.noise(run.columns[run.observed], lot)}
        noisy[name] = replace(run, columns={**run.columns, **changed})
    if case.export is None:
        return clean, noisy
    return case.export(clean), case.export(noisy)


def write(case: Case, noisy: Records, folder: Path, seed: int) -> dict[str, Path]:
    """Write the data folder and a study for each task; return the studies."""
    data = folder / "data"
    data.mkdir(parents=True, exist_ok=True)
    keys = list(dict.fromkeys(key for run in noisy.values() for key in run.cells))
    lines = [",".join(["file", *keys])]
    for name, run in noisy.items():
        write_table(data / name, run.columns)
        lines.append(",".join([name, *(str(run.cells.get(key, "")) for key in keys)]))
    (data / "runs.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    source = {"folder": str(data.resolve()), **case.told}
    if case.held_out:
        source["held_out"] = list(case.held_out)
    lot = np.random.default_rng([seed, 99])
    for name, columns in (case.tables() if case.tables else {}).items():
        told = {"strain", "omega_rad_s", "shear_rate_1_s"}
        rough = {k: v if k in told else v * (1 + 0.01 * lot.standard_normal(len(v)))
                 for k, v in columns.items()}  # fmt: skip
        write_table(data / name, rough)
        if name != "lve.csv":  # the modes come from it
            source[name.removesuffix(".csv")] = "fit"
    own = {
        "close-loop": {"loop": {"max_effects": 3}},
        "compare": {"compare": {"learners": ["tensor_sindy"], "library": {"degree": 1}}},
    }
    return {
        task: write_study(
            folder / f"{task}.toml", {"data": source, "model": case.model, **sections}
        )
        for task, sections in own.items()
    }


def run(name: str, task: str, out: Path, seed: int, pages: bool) -> dict:
    """Return the row of one case and task."""
    return ask(CASES[name], name, task, out, seed, pages)


def ask(case: Case, name: str, task: str, out: Path, seed: int, pages: bool = False) -> dict:
    """Return the row of a case with this name."""
    folder = out / name
    clean, noisy = make(case, seed)
    study = write(case, noisy, folder, seed)[task]
    row = {"case": name, "task": task, "truth": case.truth}
    started = time.process_time()
    row |= answer(
        study, task, folder / task, pages, lambda: judge(case, task, folder / task, clean, noisy)
    )
    return {**row, "seconds": round(time.process_time() - started, 1)}


def said(row: dict) -> str:
    """Return what an answer names."""
    if row["verdict"] in ("refused", "fault"):
        return row["message"]
    if row["task"] == "compare":
        names = ", ".join(f"{c:.3g} {term}" for term, (c, _) in row["terms"].items())
        left = ", ".join(row["undetermined"])
        return (names or "nothing") + (f"; open: {left}" if left else "")
    parts = []
    for stage in row["stages"]:
        values = ", ".join(f"{p['value']:.3g}" for p in stage["parameters"].values())
        also = f" (or {', '.join(stage['aliases'])})" if stage["aliases"] else ""
        parts.append(f"{stage['effect']} {values}{also}")
    return ", ".join(parts) or "nothing"


def line(row: dict) -> str:
    """Return one line, and one more for each falsehood and note."""
    misses = "; ".join(f"{fit:.2g}, {held:.2g}" for fit, held in row.get("misses", {}).values())
    text = f"{row['case']:24s} {row['task']:10s} {row['verdict']:16s} {said(row)} [{misses}]"
    text += f" {row['seconds']:.0f} s"
    for falsehood in row["falsehoods"]:
        text += f"\n    FALSE: {falsehood}"
    return text + "".join(f"\n    {note}" for note in row["notes"])


def table(rows: list[dict]) -> str:
    """Return the answers as Markdown."""
    lines = ["| data | `compare` | `close-loop` |", "|---|---|---|"]
    by_case = {}
    for row in rows:
        by_case.setdefault(row["case"], {"truth": row["truth"]})[row["task"]] = row
    for case in by_case.values():
        cells = [case["truth"]]
        for task in TASKS:
            row = case.get(task)
            cells.append("" if row is None else _cell(row))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(row: dict) -> str:
    text = f"*{row['verdict'].replace('_', ' ')}*: {said(row)}"
    return text + "".join(f"; **false: {one}**" for one in row["falsehoods"])


def main() -> None:
    """Run or resume the cases and print the answers."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("hostile_fluids"))
    parser.add_argument("--cases", help="names, separated by commas")
    parser.add_argument("--task", choices=[*TASKS, "both"], default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--again", action="store_true", help="run finished cases again")
    parser.add_argument("--pages", action="store_true", help="draw the pages too")
    parser.add_argument("--table", action="store_true", help="Write what is there, run nothing.")
    options = parser.parse_args()
    names = options.cases.split(",") if options.cases else list(CASES)
    unknown = [name for name in names if name not in CASES]
    if unknown:
        parser.error(f"unknown case {unknown[0]!r}; the cases are {', '.join(CASES)}")
    kept = options.out / "rows"
    kept.mkdir(parents=True, exist_ok=True)
    rows = []
    for name in names:
        for task in TASKS:
            file = kept / f"{name}.{task}.json"
            if options.task not in (task, "both"):
                continue
            if file.exists() and not options.again:
                row = json.loads(file.read_text(encoding="utf-8"))
            elif options.table:
                continue
            else:
                row = run(name, task, options.out, options.seed, options.pages)
                file.write_text(json.dumps(row, indent=1) + "\n", encoding="utf-8")
            rows.append(row)
            if not options.table:
                print(line(row), flush=True)
    if options.table:
        print(table(rows))
    false = sum(bool(row["falsehoods"]) for row in rows)
    constants = [one for row in rows for one in row.get("constants", [])]
    inside = sum(low <= true <= high for _, true, _, low, high in constants)
    print(f"\n{len(rows)} answers, {false} with something false; intervals {inside} of "
          f"{len(constants)}")  # fmt: skip


if __name__ == "__main__":
    main()
