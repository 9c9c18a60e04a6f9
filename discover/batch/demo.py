"""The demonstration: a small comparison and a small closed loop, on data made on the spot."""

from importlib.resources import as_file, files
from pathlib import Path

from discover.batch.tasks import run_close_loop, run_compare
from discover.progress import Progress, by_shares


def run_demo(
    out: Path, seed: int | None, overwrite: bool, progress: Progress | None
) -> dict[str, Path]:
    """Run the demonstration and return its pages by title.

    `out`: folder for the results; the comparison in it, the loop in its folder ``loop``.
    """
    part = by_shares(progress, {"comparison": 0.9, "loop": 0.1})
    studies = files("discover.batch") / "demo_studies"
    with as_file(studies / "comparison.toml") as comparison, as_file(studies / "loop.toml") as loop:
        first = run_compare(comparison, out, seed, overwrite, part("comparison"))
        second = run_close_loop(loop, out / "loop", seed, overwrite, part("loop"))
    return {"Comparison of two learners": first.report, "Closed loop": second.report}
