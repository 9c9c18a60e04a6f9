"""Both commands on every measured set, as a user runs them: verdict, bands, and what they cost.

Each study of `studies/` is run by the command itself, in a process of its own with an empty cache
of programs, and again. DISCOVER_DATA is the folder of the data, which are no part of this project.
The loop on blood holds each run out in turn.
"""

import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

QUESTIONS, SEED, LIMIT = ("first start", "second start"), 0, 7200.0
ROOT = Path(__file__).resolve().parent.parent
LOOPS = ("polyisoprene-small-strain", "polyisoprene-startup", "ldpe-shear",
         "ldpe-shear-and-extension", "gel-laos", "micelles", "blood-steps")  # fmt: skip
COMPARISONS = [path.stem for path in sorted((ROOT / "studies").glob("*-comparison*.toml"))]
GROUPS = {"loops": [f"loop of {name}" for name in LOOPS],
          "comparisons": [f"comparison of {name}" for name in COMPARISONS]}  # fmt: skip


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    """Return what a command says of a study, with the seconds of its own process."""
    kind, file = name.split(" of ")
    study, is_loop = ROOT / "studies" / f"{file}.toml", kind == "loop"
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
    rows = pd.read_csv(folder / "out" / "predictions.csv").dropna(subset=["low95", "measured"])
    rows = rows[(rows["role"] == "held_out") & (rows["source"] == "augmented")]
    for run, found in rows.groupby("run"):
        low, high, measured = (found[key] for key in ("low95", "high95", "measured"))
        bands[run] = {
            "held": float(measured.between(low, high).mean()),
            "samples": len(found),
            "half": float((high - low).median() / 2 / np.sqrt(np.mean(measured**2))),
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
    page = (folder / "out" / "report.html").read_text("utf-8")
    missing = [] if said["lack_of_fit"] else ["missing: a test of what any learner leaves"]
    missing += ["missing: a picture"] if "could not be drawn" in page else []
    return {"verdict": said["verdict"], "laws": laws, "notes": missing}


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
