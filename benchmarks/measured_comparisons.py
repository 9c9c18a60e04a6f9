"""`discover compare` on every set of measured shear data: exit code 0, a whole page, a verdict.

The default learners on whole records. A study that is done already, in the folder of results, is
not run again, and one that was stopped goes on where it stopped. The data are not part of this
project: set DISCOVER_DATA to the folder that holds them.

    python benchmarks/measured_comparisons.py --out measured
    python benchmarks/measured_comparisons.py --out measured --only gel-laos --learners tensor_sindy
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

LEARNERS = ("tensor_sindy", "tbnn_ude")
SWEEP = 'law = "ucm"\nmodes = "lve"'
FITTED = 'law = "ucm"\nmodulus_Pa = "fit"\nrelaxation_time_s = "fit"'
SHEAR = "fit = {fit}\nheld_out = {held_out}"

STUDIES = {
    "ldpe150r": (
        SHEAR.format(
            fit=[f"shear_{rate}.csv" for rate in ("0p003", "0p03", "0p3", "3")],
            held_out=[f"shear_{rate}.csv" for rate in ("0p01", "0p1", "1")],
        ),
        SWEEP,
    ),
    "pi95k-startup": (
        f"held_out = {[f'pi_Tm23_rate{rate}.csv' for rate in (1, 2, 5)]}",
        SWEEP,
    ),
    "gel-laos": (
        'held_out = ["gel_laos_1rads_3000Pa.csv"]\nrate = "measured"',
        # above, the correction for inertia is off by more than 1 % of the modulus
        f"{SWEEP}\nsweep_rad_s = [0.1, 16.0]",
    ),
    # the steady flow before each step is not told: compare starts every run from rest
    "blood-steps": ('held_out = ["blood_up_0p1_10p0.csv"]\nrate = "measured"', FITTED),
    "cpycl-laos": ("", FITTED),
}


def main() -> None:
    """Run the studies and print a table."""
    parser = argparse.ArgumentParser(description="discover compare on measured data")
    parser.add_argument("--out", type=Path, required=True, help="folder of results")
    parser.add_argument("--only", nargs="*", choices=[*STUDIES], default=[*STUDIES])
    parser.add_argument("--learners", nargs="*", choices=LEARNERS, default=LEARNERS)
    asked = parser.parse_args()
    rows = [compare(name, asked.out, asked.learners) for name in asked.only]
    print(f"{'data set':15} {'exit':>4} {'seconds':>8}  verdict")
    for row in rows:
        print(f"{row['name']:15} {row['exit']:4d} {row['seconds']:8.0f}  {row['verdict']}")
        for text in row.get("missing", ()):
            print(f"{'':15} missing: {text}")
    sys.exit(any(row["exit"] or row.get("missing") for row in rows))


def compare(name: str, out: Path, learners: Sequence[str]) -> dict:
    """Run one study by the command itself, or read what an earlier run said of it."""
    folder = out / name
    kept = out / f"{name}.json"
    if kept.is_file() and (row := json.loads(kept.read_text("utf-8")))["exit"] == 0:
        return row
    out.mkdir(parents=True, exist_ok=True)
    data, model = STUDIES[name]
    study = out / f"{name}.toml"
    text = f'[data]\nfolder = "{name}"\n{data}\n[model]\n{model}\n'
    study.write_text(f"{text}[compare]\nlearners = {list(learners)}\n", encoding="utf-8")
    command = [sys.executable, "-c", "from discover.cli import main; main()", "compare"]
    before = time.perf_counter()
    ended = subprocess.run([*command, str(study), "--out", str(folder)], check=False)
    row = {
        "name": name,
        "exit": ended.returncode,
        "seconds": time.perf_counter() - before,
        "verdict": verdict(folder / "comparison.json") if ended.returncode == 0 else "–",
        "missing": what_is_missing(folder) if ended.returncode == 0 else [],
    }
    kept.write_text(json.dumps(row), encoding="utf-8")
    return row


def verdict(file: Path) -> str:
    """Return the verdict of a comparison, with what each learner leaves."""
    content = json.loads(file.read_text("utf-8"))
    left = ", ".join(
        f"{learner} {100 * one['misfit']:.2g} %" if one["misfit"] is not None else learner
        for learner, one in content["lack_of_fit"].items()
    )
    return f"{content['verdict']} ({left})"


def what_is_missing(folder: Path) -> list[str]:
    """Return what a finished comparison should hold and does not; nothing where it is whole."""
    content = json.loads((folder / "comparison.json").read_text("utf-8"))
    missing = []
    if content["verdict"] not in ("explained", "unexplained", "no_signal"):
        missing.append(f"a verdict: {content['verdict']}")
    for learner in LEARNERS:
        told = content["lack_of_fit"].get(learner)
        if told is None and learner not in content["learners"]:
            continue
        asked = {"misfit", "noise", "lag_one_correlation", "probability"}
        missing += [f"{key} of {learner}" for key in sorted(asked - set(told or ()))]
    if not content["lack_of_fit"]:
        missing.append("a test of what any learner leaves")
    if "could not be drawn" in (folder / "report.html").read_text("utf-8"):
        missing.append("a picture")
    return missing


if __name__ == "__main__":
    main()
