"""Studies side by side in processes of this machine, each tied to this one by two pipes."""

import json
import logging
import subprocess
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock
from typing import Any

from discover.batch.status import StudyStatus
from discover.progress import Progress
from discover.python_child import python_command
from discover.stop_callbacks import on_stop

_log = logging.getLogger(__name__)
_COMMAND = python_command("-m", "discover.batch.worker")
_STARTS = 3  # of a worker; what kills it as it starts, such as a short lack of memory, passes
_DEATHS = 3  # workers that one study may kill

Job = tuple[str, str, str, str, int | None, bool]
"""Study file, name, task, folder, seed, overwrite: what `discover.batch.run.run_one` takes."""


def run_in_workers(
    run: Callable[..., StudyStatus],
    jobs: Sequence[Job],
    workers: int,
    say: Callable[[int, str, float], None],
    end: Callable[[int, StudyStatus], None],
) -> None:
    """Run jobs side by side.

    A study whose worker dies goes to another, where it continues from its last finished part.
    Where no worker can be started, the studies run in this process, one after the other.

    `say`: called with the position of a job, what is going on in it, and the fraction done. `end`:
    called with the position of a job that has ended, and how.
    """
    team = _Team(run)
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

    def __init__(self, run: Callable[..., StudyStatus]):
        self._run = run
        self._idle: SimpleQueue[_Worker] = SimpleQueue()
        self._all: list[_Worker] = []
        self._lock = Lock()
        self._alone = Lock()
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
                if self._stopped:
                    break
                with self._alone:
                    return self._run(*job, progress=progress)
            status = worker.run(job, progress)
            if status is not None:
                self._idle.put(worker)
                return status
            worker.kill()
        text = (
            "Several workers died while they ran it; look at their memory and time limits. What "
            "was finished is kept; run again to go on."
        )
        return StudyStatus(name, task, "failed", text)

    def _worker(self) -> "_Worker | None":
        """Return a worker that waits, or a new one; None if none can be started."""
        with suppress(Empty):
            return self._idle.get_nowait()
        reason = ""
        for _ in range(_STARTS):
            with self._lock:
                if self._stopped:
                    return None
                try:
                    worker = _Worker()
                except OSError as error:
                    reason = str(error)
                    continue
                self._all.append(worker)
            if worker.is_ready():
                return worker
            reason = f"exit code {worker.kill()}"
        if not self._stopped:
            _log.warning(
                "No worker could be started (%s); studies run one after the other instead.", reason
            )
        return None


class _Worker:
    """A process that runs `discover.batch.worker`."""

    def __init__(self):
        # in a session of its own: a terminal sends Ctrl-C to every process of a command, and it is
        # this one that tells workers to stop
        self._process = subprocess.Popen(
            _COMMAND, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
        )

    def is_ready(self) -> bool:
        """Wait until it has started, and return whether it has."""
        return self._next() is not None

    def run(self, job: Job, progress: Progress) -> StudyStatus | None:
        """Run a job and return how it ended; None if the worker died."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(job).encode("ascii") + b"\n")
            self._process.stdin.flush()
        except OSError:
            return None
        while (word := self._next()) is not None:
            if "status" in word:
                return StudyStatus(**word["status"])
            progress(*word["progress"])
        return None

    def _next(self) -> dict[str, Any] | None:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        return json.loads(line) if line.endswith(b"\n") else None  # a word cut short is none

    def kill(self) -> int:
        """End the process and return its exit code."""
        self._process.kill()
        return self._process.wait()
