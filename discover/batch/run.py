"""Many studies, one after the other, side by side, or on a dask cluster."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from time import perf_counter

from discover.batch.status import STATES, SUMMARY_FILES, BatchResult, StudyStatus, Summary
from discover.batch.workers import run_in_workers, run_on_cluster
from discover.compilation_cache import enable_compilation_cache
from discover.errors import InputError, plain_os_error
from discover.first_use import enable_x64
from discover.progress import FollowedBy, Progress, on_stop, resumable
from discover.study.atomic import make_folder, require_free
from discover.study.data import fingerprint, read_study
from discover.study.run_folder import RunFolder
from discover.study.schema import Study, Verdict
from discover.validation import validated

_DRAWING, _DRAWING_RUN = {"compare": 1.6, "close-loop": 0.65}, 0.08
"""Seconds in which the pictures of a page are drawn, by task, on a machine of its own; those of a
loop further ones for each run."""

_DEMO_LOOP = 1.4
"""Seconds that the loop of the demonstration takes after its comparison, likewise."""

_PAGE = "report.html"
_JSON_FILES = {"compare": "comparison.json", "close-loop": "loop.json"}


@dataclass(frozen=True)
class TaskResult:
    """Where a task's results lie, and what they say in a few lines."""

    report: Path  # the page
    json_file: Path
    text: str  # the verdict, for a terminal
    was_complete: bool  # whether everything was there already


def _compare(study: Study, seed: int | None, folder: RunFolder, part: FollowedBy) -> Sequence[str]:
    from discover.comparison.run_comparison import compare
    from discover.report.comparison.report import write_comparison

    comparison = compare(study, seed, part, folder)
    part("drawing", 1.0)
    write_comparison(comparison, folder, study.model.known_relaxation, study.text)
    return comparison.answer.lines


def _close_loop(
    study: Study, seed: int | None, folder: RunFolder, part: FollowedBy
) -> Sequence[str]:
    """Close the loop on a study and write its report; a seed only changes synthetic noise."""
    from discover.dataset.run_table import material_and_temperature
    from discover.loop.loop import run_study
    from discover.report.loop import write_loop
    from discover.study.data import load_study_data
    from discover.study.declared_model import declared_model

    part("loading data", 0.0)
    data = load_study_data(study, seed)
    part.expect(_DRAWING["close-loop"] + _DRAWING_RUN * len(data.dataset))
    declared = declared_model(study, data.dataset)
    result = run_study(study, data, declared, part)
    part("drawing", 1.0)
    conditions = material_and_temperature(data.dataset, study.data.material, data.dataset.name)
    write_loop(result, folder, study.name, result.described, study.text, conditions=conditions)
    return result.answer.lines


def _run(
    task: str, path: Path, out: Path, seed: int | None, overwrite: bool, progress: Progress,
    tolerance: float | None = None,
) -> TaskResult:  # fmt: skip
    """Run or go on with a task on a study; InputError if the study, its data or folder is wrong."""
    enable_x64()
    enable_compilation_cache()
    study = read_study(path)
    if tolerance is not None:
        verdict = validated(Verdict, {"tolerance": tolerance}, "--tolerance")
        study = study.model_copy(update={"verdict": verdict})
    folder = RunFolder(out, fingerprint(study, task, seed), overwrite)
    there = folder.complete and folder.holds(_PAGE, _JSON_FILES[task])
    if there:
        text = (folder.load("verdict") or {}).get("text", "")
    else:
        work = _compare if task == "compare" else _close_loop
        text = "\n".join(work(study, seed, folder, FollowedBy(progress, _DRAWING[task])))
        folder.save("verdict", {"text": text})
        folder.finish()
        progress("done", 1.0)
    return TaskResult(folder.path / _PAGE, folder.path / _JSON_FILES[task], text, there)


run_compare, run_close_loop = partial(_run, "compare"), partial(_run, "close-loop")
_TASKS = {"compare": run_compare, "close-loop": run_close_loop}


def run_demo(
    out: Path, seed: int | None, overwrite: bool, progress: Progress | None
) -> dict[str, Path]:
    """Run the demonstration into a folder, the loop in its ``loop``; return the pages by title."""
    whole = FollowedBy(progress, _DEMO_LOOP)
    studies = files("discover.batch") / "demo_studies"
    with as_file(studies / "comparison.toml") as comparison, as_file(studies / "loop.toml") as loop:
        first = run_compare(comparison, out, seed, overwrite, whole)
        whole.expect(0.0)
        second = run_close_loop(loop, out / "loop", seed, overwrite, whole)
    return {"Comparison of two learners": first.report, "Closed loop": second.report}


def run_batch(
    paths: Sequence[Path], out: Path, workers: int = 1, scheduler: str | None = None,
    seed: int | None = None, overwrite: bool = False,
    progress: Progress = lambda label, fraction: None,
) -> BatchResult:  # fmt: skip
    """Run studies into folders of their own; one that fails does not stop the others.

    A study with ``[loop]`` closes the loop, one with ``[compare]`` or neither compares. With one of
    `workers` everything happens in this process. Raises InputError if two studies would write to
    one folder, or `out` cannot be written to.
    """
    make_folder(out)
    resumable.set()
    if not overwrite:
        require_free(out, SUMMARY_FILES, STATES)
    jobs = [
        (str(path), name, task, str(out / name), seed, overwrite)
        for path, name in zip(paths, folder_names(paths), strict=True)
        for name, task in _tasks_of(path, name)
    ]
    _require_different([job[1] for job in jobs])
    summary = Summary(out, [(job[1], job[2]) for job in jobs], progress)
    try:
        with on_stop(summary.write):
            if workers == 1 and scheduler is None:
                for i, job in enumerate(jobs):
                    summary.end(i, run_one(*job, progress=partial(summary.say, i)))
            else:
                summary.write()  # once it was written, it takes no time on Ctrl-C
                if scheduler is None:
                    run_in_workers(jobs, min(workers, len(jobs)), summary.say, summary.end)
                else:
                    run_on_cluster(run_one, jobs, scheduler, summary.say, summary.end)
    finally:
        result = summary.write()  # what had ended before Ctrl-C is on the page too
    return result


def folder_names(paths: Sequence[Path]) -> list[str]:
    """Return folder names of studies: stems, with folders where these repeat; or InputError.

    Capitals make no difference; names of the batch's own files get ``study-`` before them.
    """
    stems = [path.stem.strip(".") or "study" for path in paths]  # "...toml" is no way out
    times = Counter(stem.casefold() for stem in stems)
    names = [
        stem if times[stem.casefold()] == 1 else f"{path.resolve().parent.name}-{stem}"
        for path, stem in zip(paths, stems, strict=True)
    ]
    names = [f"study-{name}" if name.casefold() in SUMMARY_FILES else name for name in names]
    _require_different(names)
    return names


def _require_different(names: Sequence[str]) -> None:
    taken = Counter(name.casefold() for name in names)
    for name in names:
        if taken[name.casefold()] > 1:
            raise InputError(
                f"Two studies would write to the folder {name!r}. Rename one of the files, or give "
                "each only once."
            )


def run_one(
    path: str, name: str, task: str, out: str, seed: int | None, overwrite: bool,
    progress: Progress = lambda label, fraction: None,
) -> StudyStatus:  # fmt: skip
    """Run one study and say how it ended; never raises for a failure of the study."""
    started = perf_counter()

    def ended(status: str, text: str, input_error: bool = False) -> StudyStatus:
        return StudyStatus(name, task, status, text, input_error, perf_counter() - started)

    try:
        result = _TASKS[task](Path(path), Path(out), seed, overwrite, progress)
    except InputError as error:
        return ended("failed", str(error), True)
    except OSError as error:
        return ended("failed", plain_os_error(error))
    except Exception as error:
        first = (str(error).splitlines() or [""])[0]
        return ended("failed", f"{type(error).__name__}: {first}")
    return ended("complete" if result.was_complete else "done", result.text)


def _tasks_of(path: Path, name: str) -> list[tuple[str, str]]:
    try:
        study = read_study(path)
    except InputError:
        return [(name, "compare")]  # fails again when it runs, and is listed with the reason
    sections = study.model_fields_set
    if "loop" not in sections:
        return [(name, "compare")]
    if "compare" not in sections:
        return [(name, "close-loop")]
    return [(name, "compare"), (f"{name}-loop", "close-loop")]
