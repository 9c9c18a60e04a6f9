"""Many studies, one after the other or on a dask cluster."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from uuid import uuid4

from discover.batch.progress import BatchProgress, now_and_then
from discover.batch.status import BatchResult, StudyStatus
from discover.batch.summary import Summary
from discover.batch.tasks import Progress, run_close_loop, run_compare
from discover.errors import InputError
from discover.study.atomic import make_folder
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
) -> BatchResult:
    """Run studies into folders of their own; one that fails does not stop the others.

    A study with a ``[loop]`` section closes the loop, one with ``[compare]`` or neither compares,
    one with both does both.

    Parameters
    ----------
    paths
        Study files.
    out
        Folder of the batch.
    workers
        Processes on this machine; with 1, everything happens in this one.
    scheduler
        Address of a dask scheduler to use instead.
    seed, overwrite
        As in `discover.batch.tasks.run_compare`.
    progress
        Called with what is going on and the fraction done.
    """
    make_folder(out)
    jobs = [
        (str(path), name, task, str(out / name), seed, overwrite)
        for path, name in zip(paths, folder_names(paths), strict=True)
        for name, task in _tasks_of(path, name)
    ]
    summary = Summary(out, [(job[1], job[2]) for job in jobs])
    so_far = BatchProgress([job[1] for job in jobs], progress)
    try:
        if workers == 1 and scheduler is None:
            for i, job in enumerate(jobs):
                status = run_one(*job, progress=partial(so_far.say, i))
                summary.add(i, status)
                so_far.end(i, status)
        else:
            _run_on_cluster(jobs, workers, scheduler, summary, so_far)
    finally:
        result = summary.write()  # what had ended before Ctrl-C is on the page too
    return result


def folder_names(paths: Sequence[Path]) -> list[str]:
    """Return a folder name for every study: its stem, with its folder's name where stems repeat.

    Raises
    ------
    InputError
        If two studies still have one name.
    """
    stems = [path.stem.strip(".") or "study" for path in paths]  # "...toml" is no way out
    names = [
        stem if stems.count(stem) == 1 else f"{path.resolve().parent.name}-{stem}"
        for path, stem in zip(paths, stems, strict=True)
    ]
    for name in names:
        if names.count(name) > 1:
            raise InputError(
                f"Two studies would write to the folder {name!r}. Rename one of the files, or give "
                "each only once."
            )
    return names


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
    except Exception as error:
        reason = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}"
        return StudyStatus(name, task, "failed", reason, False, perf_counter() - started)
    status = "complete" if result.was_complete else "done"
    return StudyStatus(name, task, status, result.text, False, perf_counter() - started)


def _tasks_of(path: Path, name: str) -> list[tuple[str, str]]:
    try:
        sections = read_study(path).model_fields_set
    except InputError:
        return [(name, "compare")]  # fails again when it runs, and is listed with the reason
    if "loop" not in sections:
        return [(name, "compare")]
    if "compare" not in sections:
        return [(name, "close-loop")]
    return [(name, "compare"), (f"{name}-loop", "close-loop")]


def _run_on_cluster(
    jobs: list,
    workers: int,
    scheduler: str | None,
    summary: Summary,
    so_far: BatchProgress,
) -> None:
    try:
        import dask
        from distributed import Client, LocalCluster, as_completed
    except ImportError:
        raise InputError(
            "Several workers need dask: install discover-rheology[batch], or leave --workers out."
        ) from None
    if scheduler is not None:
        try:
            client, cluster = Client(scheduler, timeout="20s"), None
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(f"No dask scheduler answers at {scheduler!r} ({error}).") from None
    else:
        # looking at every thread's stack a hundred times a second is paid for by the work
        with dask.config.set({"distributed.worker.profile.enabled": False}):
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1"
            )
        client = Client(cluster)
    try:
        topic = f"discover-{uuid4()}"
        client.subscribe_topic(topic, lambda event: so_far.say(*event[1]))
        # paths must mean the same in the workers as here
        futures = {}
        for i, (path, name, task, out, seed, overwrite) in enumerate(jobs):
            arguments = (str(Path(path).resolve()), name, task, str(Path(out).resolve()))
            future = client.submit(
                _run_on_worker, topic, i, *arguments, seed, overwrite, pure=False
            )
            futures[future] = i
        for future in as_completed(futures):
            i = futures[future]
            status = _status_of(future, jobs[i])
            summary.add(i, status)
            so_far.end(i, status)
    finally:
        client.close()
        if cluster is not None:
            cluster.close()


def _run_on_worker(topic: str, position: int, *job) -> StudyStatus:
    """Run one study in a dask worker, and send the scheduler word of how far it is."""
    from distributed import get_worker

    worker = get_worker()
    send = now_and_then(lambda text, f: worker.log_event(topic, (position, text, float(f))))
    return run_one(*job, progress=send)


def _status_of(future, job: tuple) -> StudyStatus:
    _, name, task, out, *_ = job
    error = future.exception()
    if error is not None:
        from distributed import KilledWorker

        # dask's own words hold keys and addresses, which no two runs share
        reason = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}."
        if isinstance(error, KilledWorker):
            reason = "Several workers died while they ran it; look at their memory and time limits."
        text = f"{reason} What was finished is kept; run again to go on."
        return StudyStatus(name, task, "failed", text)
    status: StudyStatus = future.result()
    if status.status != "failed" and not (Path(out) / "report.html").is_file():
        text = (
            f"The worker wrote its results, but {out} is empty here. Workers and this machine need "
            "one file system with the same paths."
        )
        return StudyStatus(name, task, "failed", text, True, status.seconds)
    return status
