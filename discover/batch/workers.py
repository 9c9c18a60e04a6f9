"""Studies side by side in processes of this machine, each tied to this one by two pipes."""

import json
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Lock
from typing import Any
from uuid import uuid4

from discover.batch.status import StudyStatus, now_and_then
from discover.errors import InputError
from discover.progress import Progress, on_stop

# without -P a jax.py in the working directory would be run, in a worker's own children too
_COMMAND = [sys.executable, "-P", "-m", "discover.batch.worker"]
_DEATHS = 3  # workers that one study may kill
_DIED = "Several workers died while they ran it; look at their memory and time limits."
_KEPT = "What was finished is kept; run again to go on."

Job = tuple[str, str, str, str, int | None, bool]
"""Study file, name, task, folder, seed, overwrite: what `discover.batch.run.run_one` takes."""


def run_in_workers(
    jobs: Sequence[Job],
    workers: int,
    say: Callable[[int, str, float], None],
    end: Callable[[int, StudyStatus], None],
) -> None:
    """Run jobs side by side; one whose worker dies goes to another, and on from its last part.

    `say`: called with the position of a job, what is going on in it, and the fraction done. `end`:
    with the position, and how it ended.
    """
    team = _Team()
    with on_stop(team.stop), ThreadPoolExecutor(workers) as threads:
        try:
            waiting = {
                threads.submit(team.run, job, partial(say, i)): i for i, job in enumerate(jobs)
            }
            for done in as_completed(waiting):
                end(waiting[done], done.result())
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
            team.stop()


class _Team:
    """The workers of a batch. Each serves one study at a time, and then waits for the next."""

    def __init__(self):
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        self._all: list[_Worker] = []
        self._lock = Lock()
        self._stopped = False

    def stop(self) -> None:
        """End the workers at once; what they had finished is in their folders, whole."""
        with self._lock:
            self._stopped = True
            for worker in self._all:
                worker.kill()

    def run(self, job: Job, progress: Progress) -> StudyStatus:
        """Return how a study ended; called from a thread of its own for each worker."""
        _, name, task, *_ = job
        for _ in range(_DEATHS):
            worker = self._worker()
            if worker is None:
                break
            status = worker.run(job, progress)
            if status is not None:
                self._idle.put(worker)
                return status
            worker.kill()
        return StudyStatus(name, task, "failed", f"{_DIED} {_KEPT}")

    def _worker(self) -> "_Worker | None":
        """Return a worker that waits, or a new one; None if all were stopped."""
        with suppress(Empty):
            return self._idle.get_nowait()
        with self._lock:
            if self._stopped:
                return None
            self._all.append(_Worker())
            return self._all[-1]


class _Worker:
    def __init__(self):
        # in a session of its own: a terminal sends Ctrl-C to every process of a command, and it is
        # this one that tells workers to stop
        self._process = subprocess.Popen(
            _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )

    def run(self, job: Job, progress: Progress) -> StudyStatus | None:
        """Run a job and return how it ended; None if the worker died."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            self._process.stdin.write(json.dumps(job).encode("ascii") + b"\n")
            self._process.stdin.flush()
        except OSError:
            return None
        # a word cut short is none
        while (line := self._process.stdout.readline()).endswith(b"\n"):
            word = json.loads(line)
            if "status" in word:
                return StudyStatus(**word["status"])
            progress(*word["progress"])
        return None

    def kill(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


def run_on_cluster(
    run: Callable[..., StudyStatus], jobs: Sequence[Job], scheduler: str,
    say: Callable[[int, str, float], None], end: Callable[[int, StudyStatus], None],
) -> None:  # fmt: skip
    """Run jobs side by side on a dask cluster, whose workers know files by the same paths.

    `say`, `end`: as in `run_in_workers`. Raises InputError if dask is not installed, or no
    scheduler answers at the address.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise InputError(
            "--scheduler needs dask: install discover-rheology[batch], or use --workers."
        ) from None
    try:
        client = Client(scheduler, timeout="20s")
    except Exception as error:  # each kind of address fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        if scheduler.startswith("tls://"):
            reason += "; its certificates are those of dask's settings distributed.comm.tls"
        raise InputError(
            f"No dask scheduler answers at {scheduler[:100]!r} ({reason}). Give the address that "
            "it prints when it starts, such as tcp://10.0.0.1:8786, and check that it runs."
        ) from None
    with client:
        topic = f"discover-{uuid4()}"
        client.subscribe_topic(topic, lambda event: say(*event[1]))
        futures = {}
        for i, (path, name, task, out, *rest) in enumerate(jobs):
            places = (str(Path(path).resolve()), name, task, str(Path(out).resolve()))
            future = client.submit(_run_on_worker, run, topic, i, *places, *rest, pure=False)
            futures[future] = i
        for future in as_completed(futures):
            i = futures[future]
            end(i, _status_of(future, jobs[i]))


def _run_on_worker(
    run: Callable[..., StudyStatus], topic: str, position: int, *job: Any
) -> StudyStatus:
    """Run one study in a dask worker, and send the scheduler word of how far it is."""
    from distributed import get_worker

    worker = get_worker()
    send = now_and_then(lambda text, f: worker.log_event(topic, (position, text, float(f))))
    return run(*job, progress=send)


def _status_of(future: Any, job: Job) -> StudyStatus:
    _, name, task, out, *_ = job
    error = future.exception()
    if error is not None:
        from distributed import KilledWorker

        # dask's own words hold keys and addresses, which no two runs share
        reason = f"{type(error).__name__}: {(str(error).splitlines() or [''])[0]}."
        reason = _DIED if isinstance(error, KilledWorker) else reason
        return StudyStatus(name, task, "failed", f"{reason} {_KEPT}")
    status: StudyStatus = future.result()
    if status.status != "failed" and not (Path(out) / "report.html").is_file():
        text = (
            f"The worker wrote its results, but {out} is empty here. Workers and this machine need "
            "one file system with the same paths."
        )
        return StudyStatus(name, task, "failed", text, True, status.seconds)
    return status
