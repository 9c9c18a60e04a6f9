"""Studies on dask: workers on this machine, or a scheduler that exists."""

import logging
import multiprocessing
import os
import signal
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from discover.batch.progress import now_and_then
from discover.batch.status import StudyStatus
from discover.errors import InputError
from discover.stop_callbacks import on_stop

if TYPE_CHECKING:  # dask is optional
    from distributed import LocalCluster

_log = logging.getLogger(__name__)
_TRIES = 3  # starts of the workers; what kills them once, such as a short lack of memory, passes

Job = tuple[str, str, str, str, int | None, bool]
"""Study file, name, task, folder, seed, overwrite: what `discover.batch.run.run_one` takes."""


def run_on_cluster(
    run: Callable[..., StudyStatus],
    jobs: Sequence[Job],
    workers: int,
    scheduler: str | None,
    say: Callable[[int, str, float], None],
    end: Callable[[int, StudyStatus], None],
) -> None:
    """Run jobs side by side.

    Parameters
    ----------
    run
        What a worker calls with a job, and with a function for its progress.
    jobs
        Paths in them must mean the same in the workers as here.
    workers
        Processes to start on this machine.
    scheduler
        Address of a dask scheduler to use instead.
    say
        Called with the position of a job, what is going on in it, and the fraction done.
    end
        Called with the position of a job that has ended, and how.

    Raises
    ------
    InputError
        If dask is not installed, or no scheduler answers at the address.
    """
    try:
        from distributed import as_completed
    except ImportError:
        raise InputError(
            "Several workers need dask: install discover-rheology[batch], or leave --workers out."
        ) from None
    with _local_client(workers) if scheduler is None else _client_of(scheduler) as client:
        if client is None:
            for i, job in enumerate(jobs):
                end(i, run(*job, progress=partial(say, i)))
            return
        topic = f"discover-{uuid4()}"
        client.subscribe_topic(topic, lambda event: say(*event[1]))
        futures = {}
        for i, (path, name, task, out, seed, overwrite) in enumerate(jobs):
            arguments = (str(Path(path).resolve()), name, task, str(Path(out).resolve()))
            future = client.submit(
                _run_on_worker, run, topic, i, *arguments, seed, overwrite, pure=False
            )
            futures[future] = i
        for future in as_completed(futures):
            i = futures[future]
            end(i, _status_of(future, jobs[i]))


@contextmanager
def _client_of(scheduler: str) -> Iterator[Any]:
    from distributed import Client

    try:
        client = Client(scheduler, timeout="20s")
    except Exception as error:  # each kind of address fails in its own way
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise InputError(
            f"No dask scheduler answers at {scheduler[:100]!r} ({reason}). Give the address that "
            "it prints when it starts, such as tcp://10.0.0.1:8786, and check that it runs."
        ) from None
    with client:
        yield client


@contextmanager
def _local_client(workers: int) -> Iterator[Any]:
    """Yield a client of workers on this machine, which all end with the context.

    Yields None, with a word in the log, if no workers can be started.
    """
    import dask
    from distributed import Client

    others = set(multiprocessing.active_children())
    started: list[LocalCluster] = []

    def kill_workers() -> None:
        """End the workers at once; what they had finished is in their folders, whole."""
        logging.disable(logging.CRITICAL)  # dask has much to say of workers that die
        for nanny in (nanny for cluster in started for nanny in cluster.workers.values()):
            nanny.close_gracefully()  # or it starts another, for which nobody has work
        for process in set(multiprocessing.active_children()) - others:
            process.kill()

    # looking at every thread's stack a hundred times a second is paid for by the work
    with on_stop(kill_workers), dask.config.set({"distributed.worker.profile.enabled": False}):
        # the cluster's threads start every worker, so what they cannot hear no worker hears
        with _deaf_to_interrupts():
            cluster = _start(workers, others)
        if cluster is None:
            yield None
            return
        started.append(cluster)
        try:
            with Client(cluster) as client:
                yield client
        finally:
            # nothing is left for them to do; dask would ask them to end and wait for some seconds
            level = logging.root.manager.disable
            kill_workers()
            with suppress(Exception):
                cluster.close()
            logging.disable(level)


def _start(workers: int, others: Collection[BaseProcess]) -> "LocalCluster | None":
    """Return workers on this machine; a start in which one of them is killed is tried again."""
    from distributed import LocalCluster

    reason: Exception | None = None
    for _ in range(_TRIES):
        try:
            return LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # on this machine alone
            )
        except (RuntimeError, OSError, TimeoutError) as error:
            reason = error
            for process in set(multiprocessing.active_children()) - set(others):
                process.kill()
    _log.warning(
        "No workers could be started (%s); the studies run one after the other instead.", reason
    )
    return None


@contextmanager
def _deaf_to_interrupts() -> Iterator[None]:
    """Keep Ctrl-C from threads and processes that start within, and all that start from them.

    A terminal sends it to every process of a command. Workers that hear it end in tracebacks of
    their own; it is this process that tells them to stop.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    _start_resource_tracker()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_resource_tracker() -> None:
    """Start multiprocessing's cleaner now.

    It starts with the first process otherwise, and opens the ears of the thread that starts it. A
    command that ends at once leaves it things to clean up, of which it need not tell.
    """
    name = "PYTHONWARNINGS"
    before = os.environ.get(name)
    os.environ[name] = ",".join(filter(None, (before, "ignore:resource_tracker:UserWarning")))
    try:
        resource_tracker.ensure_running()
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before


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
