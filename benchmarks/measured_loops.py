"""`discover close-loop` on measured data: what its band holds of runs held out, and its cost.

Each study is run by the command itself, in a process of its own, with the eight explanations that a
loop carries side by side and with the search's own alone. Programs are compiled by a start that
does not count. A run that is done, in the folder of results, is not made again, and one that was
stopped goes on. The data are not part of this project: set DISCOVER_DATA to the folder that holds
them.

    python benchmarks/measured_loops.py --out loops
    python benchmarks/measured_loops.py --out loops --only hydrogel --explanations 8 --starts 1

Blood has six runs and a study that holds each out in turn from a search among 23 candidates, which
takes an hour. Here each of the six is held out from a search among the four that
docs/blood.md names.
"""

import argparse
import csv
import json
import os
import re
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
from measured_comparisons import ROOT, processor

WHOLE = {
    "polyisoprene, small strains": "polyisoprene-small-strain",
    "polyisoprene": "polyisoprene-startup",
    "polyethylene, shear": "ldpe-shear",
    "polyethylene, two extensions": "ldpe-shear-and-extension",
    "hydrogel": "gel-laos",
    "micelles": "micelles",
}
BLOOD = tuple(f"{way}_{rates}" for way in ("up_0p1", "down") for rates in ("5p0", "10p0", "20p0"))
_FOUR = '["stress_offset", "thixotropy", "thixotropic_relaxation_two_times", "solvent_viscosity"]'


def studies() -> dict[str, str]:
    """Return the text of each study by the name that the table has for it."""
    texts = {name: _text(file) for name, file in WHOLE.items()}
    for run in BLOOD:
        file = f"blood_{run}_0p1.csv" if run.startswith("down") else f"blood_{run}.csv"
        one = _replace(_text("blood-steps"), r'held_out = "each"', f'held_out = ["{file}"]')
        texts[f"blood, {run} held out"] = _replace(
            one, r"effects = \[[^\]]*\]", f"effects = {_FOUR}"
        )
    return texts


def _text(file: str) -> str:
    return (ROOT / "studies" / f"{file}.toml").read_text("utf-8")


def _replace(text: str, pattern: str, by: str) -> str:
    replaced, count = re.subn(pattern, lambda _: by, text)
    if count != 1:
        raise SystemExit(f"{pattern} stands {count} times in a study, and should stand once")
    return replaced


def with_explanations(text: str, number: int) -> str:
    """Return a study that carries so many explanations side by side."""
    line = f"[loop]\nexplanations = {number}"
    return _replace(text, r"\[loop\]", line) if "[loop]" in text else f"{text}\n{line}\n"


def main() -> None:
    """Run the studies and print a table."""
    texts = studies()
    parser = argparse.ArgumentParser(description="discover close-loop on measured data")
    parser.add_argument("--out", type=Path, required=True, help="folder of results")
    parser.add_argument("--only", nargs="*", default=[""], help="studies whose names begin so")
    parser.add_argument("--explanations", nargs="*", type=int, default=[8, 1])
    parser.add_argument("--starts", type=int, default=2, help="of each study; the last is timed")
    asked = parser.parse_args()
    out = asked.out.resolve()
    heads = (f"{'':36}", f"{'seconds':>8}", f"{'processor':>9}", f"{'before':>7}", f"{'after':>7}")
    print(*heads, f"{'in band':>8}", f"{'least':>6}", f"{'half':>6}", " verdict")
    for name, text in texts.items():
        if not name.startswith(tuple(asked.only)):
            continue
        rows, starts = {}, asked.starts
        for number in asked.explanations:
            rows[number] = loop(name, with_explanations(text, number), number, out, starts)
            starts = 1  # its programs are compiled by now
            print(_line(name, number, rows[number]), flush=True)
        if {8, 1} <= set(rows):
            times = [rows[8][key] / rows[1][key] for key in ("seconds", "processor")]
            print(f"{'':32} 8/1 {times[0]:8.2f} {times[1]:9.2f}", flush=True)


def loop(name: str, text: str, number: int, out: Path, starts: int) -> dict:
    """Run one study so often and time the last, or read what an earlier run said of it."""
    folder = out / f"{name.replace(', ', '-').replace(' ', '-')}-{number}"
    kept = folder.with_suffix(".json")
    if kept.is_file():
        return json.loads(kept.read_text("utf-8"))
    out.mkdir(parents=True, exist_ok=True)
    study = folder.with_suffix(".toml")
    study.write_text(text, encoding="utf-8")
    own = {**os.environ, "XDG_CACHE_HOME": str(out / "cache")}
    command = [sys.executable, "-c", "from discover.cli import main; main()", "close-loop"]
    before = used = 0.0
    for _ in range(starts):
        before, used = time.perf_counter(), processor()
        ended = subprocess.run(
            [*command, str(study), "--out", str(folder), "--overwrite", "--quiet"],
            check=False, env=own, cwd=ROOT,
        )  # fmt: skip
        if ended.returncode:
            raise SystemExit(f"{name} ended with exit code {ended.returncode}")
    row = {
        "seconds": time.perf_counter() - before,
        "processor": processor() - used,
        **what_is_said(folder),
    }
    kept.write_text(json.dumps(row), encoding="utf-8")
    return row


def what_is_said(folder: Path) -> dict:
    """Return verdict and errors, and what the band holds of each run held out, from `folder`."""
    said = json.loads((folder / "loop.json").read_text("utf-8"))
    runs = defaultdict(list)
    with open(folder / "predictions.csv", encoding="utf-8", newline="") as lines:
        for line in csv.DictReader(lines):
            judged = line["role"] == "held_out" and line["source"] == "augmented"
            if judged and line["low95"] and line["measured"]:
                runs[line["run"]].append([float(line[k]) for k in ("low95", "high95", "measured")])
    bands = {}
    for run, samples in runs.items():
        low, high, measured = np.array(samples).T
        bands[run] = {
            "held": float(np.mean((low <= measured) & (measured <= high))),
            "samples": len(measured),
            "half": float(np.median(high - low) / 2 / np.sqrt(np.mean(measured**2))),
        }
    return {
        "verdict": said["verdict"],
        "before": said["error_before"]["held_out"],
        "after": said["error_after"]["held_out"],
        "explanations": len(said["explanations"]),
        "bands": bands,
    }


def _line(name: str, number: int, row: dict) -> str:
    bands, held = row["bands"].values(), [f"{'–':>8}"]
    if samples := sum(one["samples"] for one in bands):
        inside = sum(one["held"] * one["samples"] for one in bands)
        least, half = (
            f([one[k] for one in bands]) for f, k in ((min, "held"), (np.median, "half"))
        )
        held = [f"{inside / samples:8.1%}", f"{least:6.0%}", f"{half:6.1%}"]
    errors = [f"{'–':>7}" if row[k] is None else f"{row[k]:7.1%}" for k in ("before", "after")]
    return (
        f"{name:32} {number:3d} {row['seconds']:8.0f} {row['processor']:9.0f} {' '.join(errors)} "
        f"{' '.join(held)}  {row['verdict']}, {row['explanations']}"
    )


if __name__ == "__main__":
    main()
