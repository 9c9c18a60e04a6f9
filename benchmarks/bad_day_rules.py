"""What counts as a confident falsehood. The rules in words are in `bad_days.py`."""

import csv
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from bad_day_cases import Case
from independent.instruments import Recording
from independent.noise import rms

CONFIDENT = ("explained", "effects_added", "no_effect_needed")
DETECTABLE = 0.5
"""Of the noise; a miss so large raises the squared residuals by a quarter, four standard errors of
their mean over 240 samples or more, and stands against their neighbours too."""
HELD_OUT_DETECTABLE = 1.0
HALF_WIDTHS, BANDS = 3.0, 2.0
FLOOR = 2e-3
"""Of the rms: what sampling of the commanded rate and text cost."""

Runs = dict[str, Recording]


def judge(case: Case, task: str, folder: Path, clean: Runs, noisy: Runs) -> dict[str, Any]:
    """Return what is recorded of a finished task: verdict, names, errors, falsehoods."""
    name = {"close-loop": "loop.json", "compare": "comparison.json"}[task]
    said = json.loads((folder / name).read_text(encoding="utf-8"))
    verdict = said.get("verdict", "explained")  # a comparison without a verdict claims to explain
    sources = ["augmented"] if task == "close-loop" else list(said["learners"])
    rows = read_predictions(folder / "predictions.csv")
    misses = {source: miss(case, rows, source, clean, noisy) for source in sources}
    outside = case.outside if task == "close-loop" else not case.library
    found = {
        "verdict": verdict,
        "stages": [
            {k: stage[k] for k in ("effect", "aliases", "parameters")}
            for stage in said.get("stages", [])
        ],
        "miss_over_noise": misses,
        "error": said.get("error_after", {}),
        "undetermined": said.get("undetermined"),
        "falsehoods": [],
        "notes": [],
    }
    falsehoods, notes = found["falsehoods"], found["notes"]
    if not case.signal:
        if verdict in CONFIDENT:
            falsehoods.append(f"{verdict}, where nothing is to be seen")
        return found
    if outside and verdict in CONFIDENT:
        # of two learners one that predicts is enough for the verdict
        fit, held = min(misses.values(), default=(np.inf, None))
        if fit > DETECTABLE or (held or 0.0) > HELD_OUT_DETECTABLE:
            text = f"{fit:.2g}" + ("" if held is None else f", held out {held:.2g}")
            falsehoods.append(f"{verdict}, but the prediction misses by {text} of the noise")
        else:
            notes.append("not to be told from an explanation by σ12")
    if task == "close-loop":
        falsehoods += false_names(case, verdict, found["stages"])
        if verdict == "no_effect_needed" and case.planted and not outside:
            fit, _ = misses["augmented"]
            if fit > DETECTABLE:
                falsehoods.append(f"nothing is missing, but {fit:.2g} of the noise is")
        if verdict == "effects_added":
            falsehoods += false_intervals(case, found["stages"])
        if verdict == "unexplained" and not outside:
            notes.append("not explained, though it could be")
    else:
        falsehoods += false_normal_stresses(said, rows, clean, sources)
        if verdict != "explained" and not outside:
            notes.append("not explained, though it could be")
    return found


def read_predictions(path: Path) -> dict[tuple[str, str, str], dict[str, np.ndarray]]:
    """Return ``predictions.csv`` of fitted and held-out runs by run, quantity and source."""
    lists: dict[tuple[str, str, str], list[tuple[float, ...]]] = defaultdict(list)
    with path.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["role"] not in ("fit", "held_out"):
                continue
            values = [row[k] for k in ("time_s", "value", "low95", "high95")]
            numbers = tuple(float(v) if v else np.nan for v in values)
            lists[row["run"], row["quantity"], row["source"]].append(numbers)
    columns = ("time", "value", "low", "high")
    return {key: dict(zip(columns, np.array(rows).T, strict=True)) for key, rows in lists.items()}


def miss(case: Case, rows, source: str, clean: Runs, noisy: Runs) -> tuple[float, float | None]:
    """Return how far σ12 misses the record without its noise, over the noise, rms over runs.

    Fitted runs, and held-out ones or None; infinite where a law predicts nothing.
    """
    parts: dict[bool, list[float]] = {False: [], True: []}
    for run, record in clean.items():
        predicted = rows.get((run, "sigma12", source))
        if predicted is None and source == "augmented":  # nothing was added
            predicted = rows.get((run, "sigma12", "declared"))
        level = max(rms(noisy[run].stress - record.stress), FLOOR * rms(record.stress))
        if predicted is None or not np.all(np.isfinite(predicted["value"])):
            parts[run in case.held_out].append(np.inf)
            continue
        there = np.interp(predicted["time"], record.time, record.stress)
        parts[run in case.held_out].append(rms(predicted["value"] - there) / level)
    held = parts[True]
    return rms(np.array(parts[False])), (rms(np.array(held)) if held else None)


def false_names(case: Case, verdict: str, stages: list[dict]) -> list[str]:
    """Return the effects named that are not there."""
    if verdict != "effects_added":
        return []
    true = {*case.planted, *case.same_as}
    wrong = [s["effect"] for s in stages if not true & {s["effect"], *s["aliases"]}]
    return [f"{name} named, which is not there" for name in wrong]


def false_intervals(case: Case, stages: list[dict]) -> list[str]:
    """Return the intervals of planted constants that miss by more than three half-widths."""
    wrong = []
    for stage in stages:
        for name, true in case.planted.get(stage["effect"], {}).items():
            found = stage["parameters"][name]
            low, high = found["ci95"] or (None, None)
            if low is None or high is None:
                continue
            if abs(found["value"] - true) > HALF_WIDTHS * (high - low) / 2:
                wrong.append(
                    f"{stage['effect']} {name} = {found['value']:.4g} "
                    f"({low:.4g} to {high:.4g}), truly {true:.4g}"
                )
    return wrong


def false_normal_stresses(said: dict, rows, clean: Runs, sources: list[str]) -> list[str]:
    """Return the normal stresses said to be determined that are off by more than two bands."""
    determined = {s["quantity"]: s.get("determined", "yes") for s in said.get("statements", [])}
    wrong = []
    for quantity in ("N1", "N2"):
        if quantity in said.get("undetermined", ()) or determined.get(quantity) == "no":
            continue
        for source in sources:
            for run, record in clean.items():
                predicted = rows.get((run, quantity, source))
                if predicted is None:
                    continue
                scale = rms(record.true.N1)
                truth = np.interp(predicted["time"], record.time, getattr(record.true, quantity))
                half = (predicted["high"] - predicted["low"]) / 2
                # no band is a claim to be exact: the noise of σ12 is granted
                band = rms(half) if np.all(np.isfinite(half)) else 0.01 * scale
                off = rms(predicted["value"] - truth)
                if off > BANDS * band + FLOOR * scale:
                    wrong.append(
                        f"{quantity} of {source} in {run} determined, but off by "
                        f"{100 * off / scale:.3g} % of N1 (band {100 * band / scale:.2g} %)"
                    )
    return wrong
