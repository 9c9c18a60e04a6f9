"""Many studies, one after the other, side by side, or on a dask cluster."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from time import perf_counter

import numpy as np

from discover.batch.status import (
    STATES,
    SUMMARY_FILES,
    BatchProgress,
    BatchResult,
    StudyStatus,
    Summary,
)
from discover.batch.workers import run_in_workers, run_on_cluster
from discover.compilation_cache import enable_compilation_cache
from discover.errors import InputError, plain_os_error
from discover.first_use import enable_x64
from discover.progress import FollowedBy, Progress, by_shares, on_stop
from discover.study.atomic import make_folder, require_ours
from discover.study.data import fingerprint, read_study
from discover.study.run_folder import RunFolder
from discover.study.schema import Study, Verdict
from discover.validation import validated
from discover.words import counted

_DRAWING = 2.5
"""Seconds in which the pictures of a page are drawn."""

_DEMO_SHARES = {"comparison": 0.86, "loop": 0.14}

Note = Callable[[Study], None]
"""Called with a study that was read, before anything is done with it."""

_PAGE = "report.html"
_JSON_FILES = {"compare": "comparison.json", "close-loop": "loop.json"}


def nothing_to_note(study: Study) -> None:
    """Take no note of a study."""


@dataclass(frozen=True)
class TaskResult:
    """Where a task's results lie, and what they say in a few lines.

    `report`, `json_file`: the page and the JSON.
    """

    report: Path
    json_file: Path
    text: str  # the verdict, for a terminal
    was_complete: bool  # whether everything was there already


def _begin(
    task: str,
    path: Path,
    out: Path,
    seed: int | None,
    overwrite: bool,
    note: Note,
    tolerance: float | None,
) -> tuple[Study, RunFolder, TaskResult | None]:
    """Read a study and open its folder; the last is what the folder holds if that is complete."""
    enable_x64()
    enable_compilation_cache()
    study = read_study(path)
    if tolerance is not None:
        verdict = validated(Verdict, {"tolerance": tolerance}, "--tolerance")
        study = study.model_copy(update={"verdict": verdict})
    note(study)
    folder = RunFolder(out, fingerprint(study, task, seed), overwrite)
    if not (folder.complete and folder.holds(_PAGE, _JSON_FILES[task])):
        return study, folder, None
    text = (folder.load("verdict") or {}).get("text", "")
    return study, folder, _result(task, folder, text, was_complete=True)


def _end(task: str, folder: RunFolder, verdict: Sequence[str]) -> TaskResult:
    """Keep the verdict next to the report, which was written, and close the folder."""
    text = "\n".join(verdict)
    folder.save("verdict", {"text": text})
    folder.finish()
    return _result(task, folder, text, was_complete=False)


def _result(task: str, folder: RunFolder, text: str, was_complete: bool) -> TaskResult:
    return TaskResult(folder.path / _PAGE, folder.path / _JSON_FILES[task], text, was_complete)


def run_compare(
    path: Path,
    out: Path,
    seed: int | None,
    overwrite: bool,
    progress: Progress,
    note: Note = nothing_to_note,
    tolerance: float | None = None,
) -> TaskResult:
    """Run both learners of a study and write the comparison report.

    `out`: folder for the results; goes on there if it holds unfinished ones. `seed`: overrides the
    study's seeds. `overwrite`: start afresh. `progress`: called with what is going on and the
    fraction done. `note`: called with the study once it was read. `tolerance`: overrides the
    relative discrepancy that the study calls good enough. Raises InputError if the study, its data
    or the folder is wrong.
    """
    study, folder, there = _begin("compare", path, out, seed, overwrite, note, tolerance)
    if there is not None:
        return there
    part = FollowedBy(progress, _DRAWING)
    from discover.comparison.run_comparison import compare
    from discover.report.comparison.report import write_comparison
    from discover.report.overlay import comparison_overlays, read_overlays
    from discover.study.data import load_study_data
    from discover.study.declared_model import declared_model

    sources = read_overlays(study)
    comparison = compare(study, seed, part, folder)
    part("drawing", 1.0)
    overlays = ()
    if sources:
        model = declared_model(study, load_study_data(study, seed).dataset)
        fluid = model.fluid
        if comparison.known is not None:
            modes = np.array(comparison.known.modulus), np.array(comparison.known.relaxation_time)
            fluid = replace(model, modulus=modes[0], relaxation_time=modes[1]).fluid
        overlays = comparison_overlays(sources, comparison.flows, fluid)
    relaxes = study.model.known_relaxation
    write_comparison(comparison, folder, relaxes, study.text, overlays=overlays)
    ended = _end("compare", folder, comparison.answer.lines)
    progress("done", 1.0)
    return ended


def run_close_loop(
    path: Path,
    out: Path,
    seed: int | None,
    overwrite: bool,
    progress: Progress,
    note: Note = nothing_to_note,
    tolerance: float | None = None,
) -> TaskResult:
    """Close the loop on a study and write its report.

    Parameters and errors as in `run_compare`; a seed only changes synthetic noise.
    """
    study, folder, there = _begin("close-loop", path, out, seed, overwrite, note, tolerance)
    if there is not None:
        return there
    part = FollowedBy(progress, _DRAWING)
    from discover.dataset.run_table import material_and_temperature
    from discover.loop.loop import run_loop_on
    from discover.report.loop.report import write_loop
    from discover.report.overlay import loop_overlays, read_overlays
    from discover.study.data import load_study_data
    from discover.study.declared_model import declared_model, forward_model

    part("loading data", 0.0)
    sources = read_overlays(study)
    data_of_study = load_study_data(study, seed)
    model = declared_model(study, data_of_study.dataset)
    declared = forward_model(model)
    asked = dict(study.loop)
    result = run_loop_on(data_of_study, declared, part, laws=model.choice, **asked)
    result = replace(result, tolerance=study.verdict.tolerance)
    each = data_of_study.each
    part("drawing", 1.0)
    window = "" if study.loop.strain is None else f", strain {study.loop.strain[0]:g} to "
    window += "" if study.loop.strain is None else f"{study.loop.strain[1]:g}"
    summary = (
        f"Data: {data_of_study.dataset.name}, {counted(len(data_of_study.fit), 'run')} fitted, "
        f"{'each' if each else len(data_of_study.held_out)} held out"
        f"{' in turn' if each else ''}{window}. "
        f"Declared model: {_chosen(result) or model.described}, {model.modes_in_words}"
        f"{_beside(model)}. "
        f"{f'{model.source} ' if model.source else ''}"
        f"{data_of_study.dataset.left_out} {data_of_study.dataset.thinned}"
    ).strip()
    conditions = material_and_temperature(data_of_study.dataset, study.data.material)
    overlays = loop_overlays(sources, result.records, data_of_study.dataset, model.fluid)
    write_loop(
        result, folder, study.name, summary, study.text, conditions=conditions, overlays=overlays
    )
    ended = _end("close-loop", folder, result.answer.lines)
    progress("done", 1.0)
    return ended


def _chosen(result) -> str:
    """Return the law that the runs asked for, of several."""
    return f"{result.laws[0].title}, chosen of {len(result.laws)} laws" if result.laws else ""


def _beside(model) -> str:
    """Return the effects of the declared model, in words."""
    return f"; known effects: {', '.join(e.text for e in model.effects)}" if model.effects else ""


def run_demo(
    out: Path, seed: int | None, overwrite: bool, progress: Progress | None
) -> dict[str, Path]:
    """Run the demonstration and return its pages by title.

    `out`: folder for the results; the comparison in it, the loop in its folder ``loop``.
    """
    part = by_shares(progress, _DEMO_SHARES)
    studies = files("discover.batch") / "demo_studies"
    with as_file(studies / "comparison.toml") as comparison, as_file(studies / "loop.toml") as loop:
        first = run_compare(comparison, out, seed, overwrite, part("comparison"))
        second = run_close_loop(loop, out / "loop", seed, overwrite, part("loop"))
    return {"Comparison of two learners": first.report, "Closed loop": second.report}


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
    address of a dask scheduler to use instead; see `discover.batch.workers`. `progress`: called
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
