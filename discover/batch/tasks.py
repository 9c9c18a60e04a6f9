"""One study from file to report."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from discover.precision import enable_x64
from discover.study.read import fingerprint, read_study
from discover.study.run_folder import RunFolder

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class TaskResult:
    """Where a task's results lie, and what they say in a few lines.

    Attributes
    ----------
    report, json_file
        The page and the JSON.
    text
        The verdict, for a terminal.
    was_complete
        Whether everything was there already.
    """

    report: Path
    json_file: Path
    text: str
    was_complete: bool


def run_compare(
    path: Path, out: Path, seed: int | None, overwrite: bool, progress: Progress
) -> TaskResult:
    """Run both learners of a study and write the comparison report.

    Parameters
    ----------
    path
        The study file.
    out
        Folder for the results; goes on there if it holds unfinished ones.
    seed
        Overrides the study's seeds.
    overwrite
        Start afresh.
    progress
        Called with what is going on and the fraction done.

    Raises
    ------
    InputError
        If the study, its data or the folder is wrong.
    """
    enable_x64()
    study = read_study(path)
    folder = RunFolder(out, fingerprint(study, "compare", seed), overwrite)
    page, data = folder.path / "report.html", folder.path / "comparison.json"
    if folder.complete and page.is_file() and data.is_file():
        kept = folder.load("verdict") or {}
        return TaskResult(page, data, kept.get("text", ""), True)
    from discover.comparison.compare import compare
    from discover.report.comparison_report import write_comparison
    from discover.report.wording import comparison_verdict

    comparison = compare(study, seed, progress, folder)
    text = "\n".join(comparison_verdict(comparison))
    write_comparison(comparison, folder, study.model.known_relaxation, path.read_text("utf-8"))
    folder.save("verdict", {"text": text})
    folder.finish()
    return TaskResult(page, data, text, False)
