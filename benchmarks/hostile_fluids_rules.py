"""What is false of an answer. The rules in words are in `hostile_fluids.py`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from bad_day_rules import (
    BANDS,
    CONFIDENT,
    DETECTABLE,
    FLOOR,
    HALF_WIDTHS,
    HELD_OUT_DETECTABLE,
    read_predictions,
)
from hostile_fluids_records import Case, Record
from independent.noise import rms

Records = dict[str, Record]
CONSTANT = {"sigma": "relaxation_time_s", "gammadot": "modulus_Pa"}
QUANTITY = {
    "stress_Pa": "sigma12", "strain": "strain", "tensile_stress_Pa": "tensile_stress"
}  # fmt: skip


def judge(case: Case, task: str, folder: Path, clean: Records, noisy: Records) -> dict[str, Any]:
    """Return what is recorded of a finished task: verdict, names, errors, falsehoods."""
    name = {"close-loop": "loop.json", "compare": "comparison.json"}[task]
    said = json.loads((folder / name).read_text(encoding="utf-8"))
    rows = read_predictions(folder / "predictions.csv")
    sources = ["augmented"] if task == "close-loop" else list(said["learners"])
    misses = {source: miss(case, rows, source, clean, noisy) for source in sources}
    found = {"verdict": said["verdict"], "misses": misses, "falsehoods": [], "notes": []}
    look = of_loop if task == "close-loop" else of_compare
    look(case, said, rows, clean, found)
    confident = found["verdict"] in CONFIDENT
    if confident and not case.fluid:
        found["falsehoods"].append(f"{found['verdict']}, where no fluid is")
    elif confident:
        fit, held = min(misses.values())
        open_ = {s["quantity"] for s in said.get("statements", []) if s["determined"] == "no"}
        if fit > DETECTABLE or held > HELD_OUT_DETECTABLE:
            text = f"{found['verdict']}, but misses by {fit:.2g}, held out {held:.2g} of the noise"
            # a law whose stress in transients is said to be open claims nothing of the run held out
            only_held = fit <= DETECTABLE and "sigma12" in open_
            found["notes" if only_held else "falsehoods"].append(text)
    return found


def of_loop(case: Case, said: dict, rows, clean: Records, found: dict) -> None:
    """Judge names, probabilities and intervals."""
    del rows, clean
    true = {*case.planted, *case.same_as}
    found["stages"] = [
        {k: stage[k] for k in ("effect", "aliases", "parameters")} for stage in said["stages"]
    ]
    found["inclusion"] = {k: round(v, 3) for k, v in said["inclusion"].items() if v >= 0.05}
    found["unexplained_probability"] = said["unexplained_probability"]
    twins = {
        alias
        for stage in said["stages"]
        if true & {stage["effect"], *stage["aliases"]}
        for alias in (stage["effect"], *stage["aliases"])
    }
    if said["verdict"] == "effects_added":
        for stage in said["stages"]:
            if not true & {stage["effect"], *stage["aliases"]}:
                likely = said["inclusion"].get(stage["effect"], 0.0)
                text = f"{stage['effect']} is named, at {likely:.2f}, and not there"
                found["falsehoods" if likely >= 0.5 else "notes"].append(text)
            for name, value in case.planted.get(stage["effect"], {}).items():
                _interval(name, stage["parameters"][name], value, found)
    for name, probability in said["inclusion"].items():
        named = any(stage["effect"] == name for stage in said["stages"])
        if probability >= 0.5 and name not in true | twins and not named:
            text = f"{name} has a probability of {probability:.2f}"
            found["falsehoods" if found["verdict"] in CONFIDENT else "notes"].append(text)
    if said["verdict"] == "unexplained" and not case.outside and case.fluid:
        found["notes"].append("not explained, though it could be")


def of_compare(case: Case, said: dict, rows, clean: Records, found: dict) -> None:
    """Judge terms, their intervals, and the quantities said to be determined."""
    terms = said["learners"]["tensor_sindy"]["terms"]
    found["terms"] = {t["term"]: [t["coefficient"], t.get("ci95")] for t in terms}
    found["undetermined"] = said["undetermined"]
    if said["verdict"] != "explained":
        if case.terms is not None:
            found["notes"].append("not explained, though it could be")
        return
    if case.terms is not None:
        # a term that may be zero, as an interval says, is no claim
        sure = {t["term"] for t in terms if not _holds_zero(t.get("ci95"))}
        # nor is one of which it is told that it may as well be another declared constant, as it is
        sure -= {
            term
            for term, one in CONSTANT.items()
            if one in said["undetermined"] and {term, one} & {*case.same_as}
        }
        if sure != set(case.terms):
            text = f"the law is {', '.join(found['terms']) or 'the declared one'}"
            found["falsehoods"].append(f"{text}, not {', '.join(case.terms) or 'the declared one'}")
        for term in terms:
            if term["term"] in case.terms:
                value = {"value": term["coefficient"], "ci95": term.get("ci95")}
                _interval(term["term"], value, case.terms[term["term"]], found)
    open_ = {s["quantity"] for s in said["statements"] if s["determined"] == "no"}
    for quantity in ("N1", "N2", "sigma12"):
        if quantity not in open_ and quantity not in said["undetermined"]:
            _band(quantity, rows, clean, found)


def _holds_zero(interval) -> bool:
    return interval is not None and None not in interval and interval[0] <= 0.0 <= interval[1]


def _interval(name: str, value: dict, true: float, found: dict) -> None:
    low, high = value["ci95"] or (None, None)
    if low is None or high is None or not np.isfinite([low, high]).all():
        return
    found.setdefault("constants", []).append([name, true, value["value"], low, high])
    if abs(value["value"] - true) > HALF_WIDTHS * (high - low) / 2 + 1e-4 * abs(true):
        found["falsehoods"].append(
            f"{name} = {value['value']:.4g} ({low:.4g} to {high:.4g}), truly {true:.4g}"
        )


def _band(quantity: str, rows, clean: Records, found: dict) -> None:
    """Judge the band of a quantity that is determined, in every run whose truth is known."""
    for run, record in clean.items():
        if quantity == "sigma12":
            truth = record.columns["stress_Pa"] if record.observed == "stress_Pa" else None
        else:
            truth = getattr(record, quantity)
        predicted = rows.get((run, quantity, "tensor_sindy"))
        if predicted is None or truth is None:
            continue
        scale = rms(truth if quantity == "sigma12" else record.N1)
        there = np.interp(predicted["time"], record.columns["time_s"], truth)
        half = (predicted["high"] - predicted["low"]) / 2
        # no band is a claim to be exact: the noise of σ12 is granted
        band = rms(half) if np.all(np.isfinite(half)) else 0.01 * scale
        off = rms(predicted["value"] - there)
        if off > BANDS * band + FLOOR * scale:
            found["falsehoods"].append(
                f"{quantity} of {run} is determined, and off by {100 * off / scale:.3g} % "
                f"(band {100 * band / scale:.2g} %)"
            )


def miss(case: Case, rows, source: str, clean: Records, noisy: Records) -> tuple[float, float]:
    """Return how far the record without noise is missed, over the noise: fitted, held out.

    Root-mean-square over runs; infinite where nothing is predicted, 0 where no run is.
    """
    parts: dict[bool, list[float]] = {False: [], True: []}
    for run, record in clean.items():
        values, times = record.columns[record.observed], record.columns["time_s"]
        key = (run, QUANTITY[record.observed])
        predicted = rows.get((*key, source))
        if predicted is None and source == "augmented":
            predicted = rows.get((*key, "declared"))  # nothing was added
        noise = rms(noisy[run].columns[record.observed] - values)
        size = max(noise, FLOOR * rms(values))
        if predicted is None or not np.all(np.isfinite(predicted["value"])):
            parts[run in case.held_out].append(np.inf)
            continue
        there = np.interp(predicted["time"], times, values)
        parts[run in case.held_out].append(rms(predicted["value"] - there) / size)
    return tuple(rms(np.array(parts[held])) if parts[held] else 0.0 for held in (False, True))
