"""What it saves a second start to find its programs: a whole comparison, with and without them.

Each start is a process of its own, in turn, after one that fills the caches. Both find what JAX
compiled; only one finds the exported programs, the other traces every function anew.

    python benchmarks/second_start.py --starts 3
"""

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

STUDY = """
[data]
synthetic = {{ law = "giesekus", parameters = {{ alpha = 0.2 }}, noise = 0.01, samples = 21 }}
[compare]
library = {{ degree = 0 }}
high_deborah = [1.5]
learners = {learners}
"""
TRACED = (
    "from discover.programs import program_cache; program_cache.program_folder = lambda: None; "
)
RUN = "from discover.cli import main; main()"


def seconds(code: str, study: Path, cache: Path) -> float:
    """Return the wall time of one process that runs the study."""
    out = study.parent / "out"
    command = [sys.executable, "-c", code, "compare", study, "--out", out, "--overwrite", "--quiet"]
    started = time.perf_counter()
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache)}
    subprocess.run([str(part) for part in command], check=True, env=environment)
    return time.perf_counter() - started


def main() -> None:
    """Print the wall times, their medians and the ratio."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--starts", type=int, default=3)
    parser.add_argument("--learners", default="tensor_sindy,tbnn_ude")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        study = folder / "study.toml"
        study.write_text(STUDY.format(learners=options.learners.split(",")), encoding="utf-8")
        print(f"first start: {seconds(RUN, study, folder / 'cache'):.1f} s", flush=True)
        seconds(TRACED + RUN, study, folder / "cache")  # JAX compiles what is traced by itself too
        times: dict[str, list[float]] = {"traced": [], "found": []}
        for _ in range(options.starts):
            for kind, code in (("traced", TRACED + RUN), ("found", RUN)):
                times[kind].append(seconds(code, study, folder / "cache"))
                print(f"second start, programs {kind}: {times[kind][-1]:.1f} s", flush=True)
        traced, found = (statistics.median(times[kind]) for kind in ("traced", "found"))
        print(f"traced {traced:.1f} s, found {found:.1f} s, ratio {found / traced:.2f}")


if __name__ == "__main__":
    main()
