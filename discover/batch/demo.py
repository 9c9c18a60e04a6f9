"""The demonstration: a small comparison and a small closed loop, on data made on the spot."""

from importlib.resources import as_file, files
from pathlib import Path

from discover.batch.tasks import run_close_loop, run_compare
from discover.progress import Progress


def run_demo(
    out: Path, seed: int | None, overwrite: bool, progress: Progress | None
) -> dict[str, Path]:
    """Run the demonstration and return its pages by title.

    Parameters
    ----------
    out
        Folder for the results; the comparison in it, the loop in its folder ``loop``.
    seed, overwrite, progress
        As in `discover.batch.tasks.run_compare`.
    """
    report = progress or (lambda label, fraction: None)
    studies = files("discover.batch") / "demo_studies"
    with as_file(studies / "comparison.toml") as comparison, as_file(studies / "loop.toml") as loop:
        first = run_compare(
            comparison, out, seed, overwrite, lambda text, f: report(text, 0.75 * f)
        )
        second = run_close_loop(
            loop, out / "loop", seed, overwrite, lambda text, f: report(text, 0.75 + 0.25 * f)
        )
    return {"Comparison of two learners": first.report, "Closed loop": second.report}
