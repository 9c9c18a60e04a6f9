"""Every contestant of `field/contestants` on every fluid, and the table of `docs/field.md`.

    python benchmarks/field_table.py --out FOLDER
    python benchmarks/field_table.py --out FOLDER --contestants classical_fits --fluids Giesekus

Each case is a process of its own, ended at the time limit, and leaves one JSON in the folder; what
is there is not run again.
"""

import argparse
import importlib
import json
import pkgutil
import subprocess
import sys
from pathlib import Path

from field import contestants
from field.cases import FLUIDS
from field.judge import judged, tables

NAMES = sorted(module.name for module in pkgutil.iter_modules(contestants.__path__))


def main() -> None:
    """Run what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of results")
    parser.add_argument("--contestants", nargs="*", choices=NAMES, default=NAMES)
    parser.add_argument("--fluids", nargs="*", choices=[*FLUIDS], default=[*FLUIDS])
    parser.add_argument("--limit", type=float, default=300.0, help="seconds for one case")
    parser.add_argument("--seed", type=int, default=1, help="of the noise and the contestants")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in asked.contestants:
        for fluid in asked.fluids:
            if asked.here:
                run_here(name, fluid, asked.seed, kept(asked.out, name, fluid))
            elif not kept(asked.out, name, fluid).is_file():
                run_apart(name, fluid, asked)
    if not asked.here:
        print(tables(read(asked.out), {name: title(name) for name in NAMES}))


def kept(folder: Path, name: str, fluid: str) -> Path:
    """Return the file of one case."""
    return folder / f"{name}-{list(FLUIDS).index(fluid)}.json"


def run_here(name: str, fluid: str, seed: int, file: Path) -> None:
    """Run one case in this process and keep its result.

    A package that is not installed leaves no file: installed, the case is run the next time.
    """
    from discover.compilation_cache import enable_compilation_cache
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    try:
        result = judged(importlib.import_module(f"field.contestants.{name}"), fluid, seed)
    except ModuleNotFoundError as error:
        sys.exit(f"Skipped: {error.name} is not installed; pip install -e '.[field]'.")
    file.write_text(json.dumps(result), encoding="utf-8")


def run_apart(name: str, fluid: str, asked: argparse.Namespace) -> None:
    """Run one case in a process of its own; what fails or takes too long is kept as that."""
    file = kept(asked.out, name, fluid)
    command = [sys.executable, __file__, "--here", "--out", str(asked.out), "--seed"]
    command += [str(asked.seed), "--contestants", name, "--fluids", fluid]
    try:
        ended = subprocess.run(
            command, timeout=asked.limit, capture_output=True, text=True, check=False
        )
        said = (ended.stderr.strip().splitlines() or ["no message"])[-1]
        if ended.returncode and not said.startswith("Skipped: "):
            file.write_text(json.dumps({"failed": said}), encoding="utf-8")
    except subprocess.TimeoutExpired:
        said = f"not done in {asked.limit:g} s"
        file.write_text(json.dumps({"failed": said}), encoding="utf-8")
    if file.is_file():
        result = json.loads(file.read_text("utf-8"))
        said = result.get("failed") or f"{result['seconds']:.0f} s  {result['words'][:90]}"
    print(f"{name:24} {fluid:18} {said}", file=sys.stderr, flush=True)


def read(folder: Path) -> dict[tuple[str, str], dict]:
    """Return the results of a folder by contestant and fluid."""
    files = {(name, fluid): kept(folder, name, fluid) for name in NAMES for fluid in FLUIDS}
    return {key: json.loads(f.read_text("utf-8")) for key, f in files.items() if f.is_file()}


def title(name: str) -> str:
    """Return the title of a contestant."""
    return importlib.import_module(f"field.contestants.{name}").TITLE


if __name__ == "__main__":
    main()
