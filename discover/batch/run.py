"""Many studies, one after the other, side by side, or on a dask cluster."""

from collections import Counter
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import perf_counter

from discover.batch.cluster import run_on_cluster
from discover.batch.status import BatchProgress, BatchResult, StudyStatus
from discover.batch.summary import STATES, SUMMARY_FILES, Summary
from discover.batch.tasks import Note, nothing_to_note, run_close_loop, run_compare
from discover.batch.workers import run_in_workers
from discover.errors import InputError, plain_os_error
from discover.progress import Progress
from discover.stop_callbacks import on_stop
from discover.study.atomic import make_folder, require_ours
from discover.study.read import read_study

_TASKS = {"compare": run_compare, "close-loop": run_close_loop}


def run_batch(
    paths: Sequence[Path],
    out: Path,
    workers: int = 1,
    scheduler: str | None = None,
    seed: int | None = None,
    overwrite: bool = False,
    progress: Progress = lambda label, fraction: None,
    note: Note = nothing_to_note,
) -> BatchResult:
    """Run studies into folders of their own; one that fails does not stop the others.

    A study with a ``[loop]`` section closes the loop, one with ``[compare]`` or neither compares,
    one with both does both.

    `workers`: processes on this machine; with 1, everything happens in this one. `scheduler`:
    address of a dask scheduler to use instead; see `discover.batch.cluster`. `progress`: called
    with what is going on and the fraction done. `note`: called with every study that can be read,
    before the first runs. Raises InputError if two studies would write to one folder, or `out`
    cannot be written to.
    """
    make_folder(out)
    if not overwrite:
        require_ours(out, SUMMARY_FILES, STATES)
    jobs = [
        (str(path), name, task, str(out / name), seed, overwrite)
        for path, name in zip(paths, folder_names(paths), strict=True)
        for name, task in _tasks_of(path, name, note)
    ]
    _require_different([job[1] for job in jobs])
    summary = Summary(out, [(job[1], job[2]) for job in jobs])
    so_far = BatchProgress([job[1] for job in jobs], progress)

    def end(position: int, status: StudyStatus) -> None:
        summary.add(position, status)
        so_far.end(position, status)

    try:
        with on_stop(summary.write_ended):
            if workers == 1 and scheduler is None:
                for i, job in enumerate(jobs):
                    end(i, run_one(*job, progress=partial(so_far.say, i)))
            else:
                summary.write_soon()  # once it was written, it takes no time on Ctrl-C
                if scheduler is None:
                    run_in_workers(run_one, jobs, min(workers, len(jobs)), so_far.say, end)
                else:
                    run_on_cluster(run_one, jobs, scheduler, so_far.say, end)
    finally:
        result = summary.write()  # what had ended before Ctrl-C is on the page too
    return result


def folder_names(paths: Sequence[Path]) -> list[str]:
    """Return a folder name for every study: its stem, with its folder's name where stems repeat.

    Names that differ by upper and lower case alone are one name: on many disks they are. A study
    that has the name of one of the batch's own files gets ``study-`` before it.

    Raises InputError if two studies still have one name.
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
    path: str,
    name: str,
    task: str,
    out: str,
    seed: int | None,
    overwrite: bool,
    progress: Progress = lambda label, fraction: None,
) -> StudyStatus:
    """Run one study and say how it ended; never raises for a failure of the study."""
    started = perf_counter()
    try:
        result = _TASKS[task](Path(path), Path(out), seed, overwrite, progress)
    except InputError as error:
        return StudyStatus(name, task, "failed", str(error), True, perf_counter() - started)
    except OSError as error:
        reason = plain_os_error(error)
        return StudyStatus(name, task, "failed", reason, False, perf_counter() - started)
    except Exception as error:
        reason = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
        return StudyStatus(name, task, "failed", reason, False, perf_counter() - started)
    status = "complete" if result.was_complete else "done"
    return StudyStatus(name, task, status, result.text, False, perf_counter() - started)


def _tasks_of(path: Path, name: str, note: Note) -> list[tuple[str, str]]:
    try:
        study = read_study(path)
    except InputError:
        return [(name, "compare")]  # fails again when it runs, and is listed with the reason
    note(study)
    sections = study.model_fields_set
    if "loop" not in sections:
        return [(name, "compare")]
    if "compare" not in sections:
        return [(name, "close-loop")]
    return [(name, "compare"), (f"{name}-loop", "close-loop")]
