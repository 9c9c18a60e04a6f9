"""Every named law, fitted to every measured set: error fitted and held out, before any effect.

    DISCOVER_DATA=... python benchmarks/laws_on_measured.py [STUDY...] [--out DIR]

Takes each study (by default those of `studies/`) with its split, modes and known effects, and lets
the loop choose among all laws, by the fitted runs alone. A star marks what these runs do not tell
from the law that was taken; a constant at an end of its range stands in brackets.
"""

import argparse
import json
import tempfile
import time
import tomllib
from pathlib import Path

from independent.folders import write_study

from discover.batch.tasks import run_close_loop

STUDIES = Path(__file__).parents[1] / "studies"
DEFAULT = (
    "polyisoprene-startup", "ldpe-shear", "ldpe-shear-and-extension", "gel-laos", "blood-steps",
    "polymer-flow-curve",
)  # fmt: skip


def choosing(study: Path) -> dict:
    """Return the sections of a study that chooses among all laws and adds nothing."""
    sections = tomllib.loads(study.read_text(encoding="utf-8"))
    model = {
        key: value
        for key, value in sections.get("model", {}).items()
        if key not in ("parameters", "by_mode", "known_relaxation")
    }
    loop = sections.get("loop", {}) | {"max_effects": 0, "explanations": 1}
    return {"data": sections["data"], "model": model | {"law": "any"}, "loop": loop}


def percent(value: float | None) -> str:
    """Return a share in percent; a dash where a law runs away."""
    return "–" if value is None else f"{100 * value:.3g}"


def main() -> None:
    """Print the table of each study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("studies", nargs="*", type=Path)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    out = given.out or Path(tempfile.mkdtemp())
    out.mkdir(parents=True, exist_ok=True)
    for study in given.studies or [STUDIES / f"{name}.toml" for name in DEFAULT]:
        made = write_study(out / f"{study.stem}.toml", choosing(study))
        started = time.perf_counter()
        run_close_loop(made, out / study.stem, None, True, lambda *_: None)
        seconds = time.perf_counter() - started
        found = json.loads((out / study.stem / "loop.json").read_text(encoding="utf-8"))
        print(f"\n{study.stem}: {found['verdict']}, {seconds:.0f} s for all laws")
        print("law | fitted, % | held out, % | criterion above the best")
        for one in found["laws"]:
            values = ", ".join(
                f"({name} = {value:.3g})" if name in one["at_end"] else f"{name} = {value:.3g}"
                for name, value in one["parameters"].items()
            )
            error = one["error"] or {"fit": None, "held_out": None}
            behind = "–" if one["behind"] is None else f"{one['behind']:.3g}"
            star = "" if one["is_told_apart"] else " *"
            title = f"{one['title']} {values}".strip() + star
            print(f"{title} | {percent(error['fit'])} | {percent(error['held_out'])} | {behind}")


if __name__ == "__main__":
    main()
