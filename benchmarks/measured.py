"""Both commands on every measured set, as a user runs them: verdict, bands, and what they cost.

Each study of `studies/` is run by the command itself, in a process of its own with an empty cache
of programs, and again. DISCOVER_DATA is the folder of the data, which are no part of this project.
A loop on blood holds each run out in turn from a search among four effects; a
comparison counts as whole with a verdict, a test of what each learner leaves, and its pictures.
"""

import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import product

QUESTIONS, SEED, LIMIT = ("first start", "second start"), 0, 7200.0
ROOT = Path(__file__).resolve().parent.parent
LOOPS = {
    "polyisoprene, small strains": "polyisoprene-small-strain",
    "polyisoprene": "polyisoprene-startup",
    "polyethylene, shear": "ldpe-shear",
    "polyethylene, two extensions": "ldpe-shear-and-extension",
    "hydrogel": "gel-laos",
    "micelles": "micelles",
}
BLOOD = [f"{way}_{rates}" for way in ("up_0p1", "down") for rates in ("5p0", "10p0", "20p0")]
_FOUR = '["stress_offset", "thixotropy", "thixotropic_relaxation_two_times", "solvent_viscosity"]'
COMPARISONS = {
    path.stem.replace("-comparison", ""): path.stem
    for path in sorted((ROOT / "studies").glob("*-comparison*.toml"))
}
GROUPS = {
    "loops": [f"loop on {name}" for name in (*LOOPS, *(f"blood without {run}" for run in BLOOD))],
    "comparisons": [f"comparison of {name}" for name in COMPARISONS],
}


def names(seed: int) -> list[str]:
    del seed
    return [*GROUPS["loops"], *GROUPS["comparisons"]]


def study_of(name: str) -> str:
    """Return the text of the study of a case."""

    def text(file: str) -> str:
        return (ROOT / "studies" / f"{file}.toml").read_text("utf-8")

    title = name.removeprefix("loop on ").removeprefix("comparison of ")
    if name.startswith("comparison"):
        return text(COMPARISONS[title])
    if title in LOOPS:
        return text(LOOPS[title])
    run = title.removeprefix("blood without ")
    file = f"blood_{run}_0p1.csv" if run.startswith("down") else f"blood_{run}.csv"
    one = re.sub(r'held_out = "each"', f'held_out = ["{file}"]', text("blood-steps"))
    return re.sub(r"effects = \[[^\]]*\]", f"effects = {_FOUR}", one)


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return what a command says of a study, with the seconds of its own process."""
    study, is_loop = folder / "study.toml", name.startswith("loop")
    study.write_text(study_of(name), encoding="utf-8")
    command = [sys.executable, "-m", "discover", "close-loop" if is_loop else "compare"]
    own = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
    wall, used = time.perf_counter(), processor()
    for start in QUESTIONS[: 1 + QUESTIONS.index(question)]:
        wall, used = time.perf_counter(), processor()
        ended = subprocess.run(
            [*command, str(study), "--out", str(folder / "out"), "--overwrite", "--quiet"],
            check=False, env=own, cwd=ROOT,
        )  # fmt: skip
        if ended.returncode:
            return {"verdict": "fault", "message": f"{start}: exit code {ended.returncode}"}
    row = {"wall": time.perf_counter() - wall, "processor": processor() - used}
    return row | (of_loop if is_loop else of_comparison)(folder)


def processor() -> float:
    """Return the seconds of processor that ended processes of this one used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def of_loop(folder: Path) -> dict:
    """Return verdict and errors, and what the band holds of each run held out."""
    said = json.loads((folder / "out" / "loop.json").read_text("utf-8"))
    bands = {}
    for (run, _, source), found in product.predictions(folder, "held_out").items():
        kept = np.isfinite(found["low"]) & np.isfinite(found["measured"])
        if source == "augmented" and kept.any():
            low, high, measured = (found[key][kept] for key in ("low", "high", "measured"))
            bands[run] = {
                "held": float(np.mean((low <= measured) & (measured <= high))),
                "samples": len(measured),
                "half": float(np.median(high - low) / 2 / np.sqrt(np.mean(measured**2))),
            }
    errors = [said[key]["held_out"] for key in ("error_before", "error_after")]
    return {"verdict": said["verdict"], "errors": errors, "bands": bands}


def of_comparison(folder: Path) -> dict:
    """Return the verdict, what each law leaves and misses of unseen runs, and what is missing."""
    said = json.loads((folder / "out" / "comparison.json").read_text("utf-8"))
    laws = {law: [fit["misfit"], fit["errors"]] for law, fit in said.get("classical", {}).items()}
    laws |= {
        learner: [said["lack_of_fit"].get(learner, {}).get("misfit"), found["errors"]]
        for learner, found in said["learners"].items()
    }
    missing = what_is_missing(folder / "out")
    return {"verdict": said["verdict"], "laws": laws, "notes": [f"missing: {m}" for m in missing]}


def what_is_missing(out: Path) -> list[str]:
    """Return what a finished comparison should hold and does not; nothing where it is whole."""
    said = json.loads((out / "comparison.json").read_text("utf-8"))
    missing = [] if said["lack_of_fit"] else ["a test of what any learner leaves"]
    if said["verdict"] not in ("explained", "unexplained", "no_signal"):
        missing.append(f"a verdict: {said['verdict']}")
    wanted = {"misfit", "noise", "lag_one_correlation", "probability"}
    for learner in said["learners"]:
        told = said["lack_of_fit"].get(learner, {})
        missing += [f"{key} of {learner}" for key in sorted(wanted - set(told))]
    if "could not be drawn" in (out / "report.html").read_text("utf-8"):
        missing.append("a picture")
    return missing


def line(row: dict) -> str:
    """Return errors and bands of a loop, or what laws leave in a comparison."""
    text = f"{row['wall']:.0f} s, processor {row['processor']:.0f} s"
    if "laws" in row:
        left = (f"{law} {100 * misfit:.2g} %" for law, (misfit, _) in row["laws"].items() if misfit)
        return f"{text}: {', '.join(left)}"
    before, after = ("–" if e is None else f"{100 * e:.1f} %" for e in row["errors"])
    bands = row["bands"].values()
    held = ""
    if samples := sum(band["samples"] for band in bands):
        inside = sum(band["held"] * band["samples"] for band in bands) / samples
        half = np.median([band["half"] for band in bands])
        held = f"; {inside:.1%} in band, half-width {half:.1%}"
    return f"{text}: held out {before} before, {after} after{held}"


def table(rows: list[dict]) -> str:
    lines = ["| set | start | verdict | |", "|---|---|---|---|"]
    for row in rows:
        said = row["message"] if "message" in row else line(row)
        lines.append(f"| {row['case']} | {row['question']} | {row['verdict']} | {said} |")
    return "\n".join(lines)
