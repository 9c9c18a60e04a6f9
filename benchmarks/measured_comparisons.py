"""`discover compare` on every set of measured shear data: exit code 0, a whole page, a verdict.

Each study of `studies/` is run as it stands, in a process of its own, at a first start (nothing
compiled) and at a second. A start that is done already, in the folder of results, is not run again,
and one that was stopped goes on where it stopped. The data are not part of this project: set
DISCOVER_DATA to the folder that holds them.

    python benchmarks/measured_comparisons.py --out measured
    python benchmarks/measured_comparisons.py --out measured --only gel blood --first
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

LEARNERS = ("tensor_sindy", "tbnn_ude")
ROOT = Path(__file__).resolve().parent.parent
STUDIES = {
    path.stem.replace("-comparison", ""): path
    for path in sorted((ROOT / "studies").glob("*-comparison*.toml"))
}


def main() -> None:
    """Run the studies and print a table."""
    parser = argparse.ArgumentParser(description="discover compare on measured data")
    parser.add_argument("--out", type=Path, required=True, help="folder of results")
    parser.add_argument("--only", nargs="*", choices=[*STUDIES], default=[*STUDIES])
    parser.add_argument("--first", action="store_true", help="no second start")
    asked = parser.parse_args()
    asked.out = asked.out.resolve()  # the command runs in the folder of the project
    starts = ("first",) if asked.first else ("first", "second")
    rows = [compare(name, asked.out, start) for name in asked.only for start in starts]
    print(f"{'study':22} {'start':6} {'exit':>4} {'seconds':>8} {'processor':>9}  verdict")
    for row in rows:
        print(
            f"{row['name']:22} {row['start']:6} {row['exit']:4d} {row['seconds']:8.0f} "
            f"{row['processor']:9.0f}  {row['verdict']}"
        )
        for text in row.get("missing", ()):
            print(f"{'':15} missing: {text}")
    for name in asked.only:
        print_laws(asked.out / f"{name}-{starts[0]}" / "comparison.json", name)
    sys.exit(any(row["exit"] or row.get("missing") for row in rows))


def compare(name: str, out: Path, start: str) -> dict:
    """Run one study by the command itself, or read what an earlier run said of it."""
    folder = out / f"{name}-{start}"
    kept = out / f"{name}-{start}.json"
    if kept.is_file() and (row := json.loads(kept.read_text("utf-8")))["exit"] == 0:
        return row
    out.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-c", "from discover.cli import main; main()", "compare"]
    # what one study compiled is not to help another
    own = {**os.environ, "XDG_CACHE_HOME": str(out / f"{name}-cache")}
    before, used = time.perf_counter(), processor()
    ended = subprocess.run(
        [*command, str(STUDIES[name]), "--out", str(folder)], check=False, env=own, cwd=ROOT
    )
    row = {
        "name": name,
        "start": start,
        "exit": ended.returncode,
        "seconds": time.perf_counter() - before,
        "processor": processor() - used,
        "verdict": verdict(folder / "comparison.json") if ended.returncode == 0 else "–",
        "missing": what_is_missing(folder) if ended.returncode == 0 else [],
    }
    kept.write_text(json.dumps(row), encoding="utf-8")
    return row


def processor() -> float:
    """Return the seconds of processor that ended processes of this one used."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def print_laws(file: Path, name: str) -> None:
    """Print every law fitted to a study's runs: constants, misfit, errors on unseen runs."""
    if not file.is_file():
        return
    content = json.loads(file.read_text("utf-8"))
    inside = {flow: placed["inside"] for flow, placed in content["range"].items()}

    def unseen(errors) -> str:
        told = [
            f"{'runs away' if (value := next(iter(row.values()))) is None else f'{value:.1%}'}"
            f"{'' if inside[flow] else ' beyond'}"
            for flow, row in errors.items()
        ]
        return ", ".join(told) or "–"

    print(f"\n{name}: law, constants, misfit, unseen runs, criterion")
    for law, fit in content["classical"].items():
        constants = {**fit["parameters"], **fit.get("fitted_along", {})}
        said = ", ".join(f"{key} = {value:.3g}" for key, value in constants.items())
        misfit = "–" if fit["misfit"] is None else f"{fit['misfit']:.1%}"
        criterion = "–" if fit["criterion"] is None else f"{fit['criterion']:.0f}"
        print(f"  {law} ({said}): {misfit}; {unseen(fit['errors'])}; {criterion}")
    for learner, found in content["learners"].items():
        left = content["lack_of_fit"].get(learner, {}).get("misfit")
        terms = " + ".join(f"{t['coefficient']:.3g} {t['term']}" for t in found["terms"])
        path, chosen = found["details"].get("path"), found["details"].get("chosen")
        criterion = "–"
        if path and chosen is not None:
            row = path[chosen]
            criterion = f"{row.get('bic_at_exact_moduli', row['bic']):.0f}"
        misfit = "–" if left is None else f"{left:.1%}"
        print(f"  {learner} ({terms}): {misfit}; {unseen(found['errors'])}; {criterion}")


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
