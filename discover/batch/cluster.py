"""Studies on a dask scheduler that exists."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from ipaddress import ip_address
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

from discover.batch.status import StudyStatus, now_and_then
from discover.batch.workers import Job
from discover.errors import InputError


def run_on_cluster(
    run: Callable[..., StudyStatus],
    jobs: Sequence[Job],
    scheduler: str,
    say: Callable[[int, str, float], None],
    end: Callable[[int, StudyStatus], None],
) -> None:
    """Run jobs side by side.

    `run`: what a worker calls with a job, and with a function for its progress. `jobs`: paths in
    them must mean the same in the workers as here. `scheduler`: address of the scheduler. For
    ``tls://`` the certificates are those that dask's own settings name, ``distributed.comm.tls``.
    `say`: called with the position of a job, what is going on in it, and the fraction done. `end`:
    called with the position of a job that has ended, and how. Raises InputError if dask is not
    installed, or no scheduler answers at the address.
    """
    try:
        from distributed import as_completed
    except ImportError:
        raise InputError(
            "--scheduler needs dask: install discover-rheology[batch], or use --workers."
        ) from None
    if not _is_protected(scheduler):
        warnings.warn(
            f"The connection to {scheduler[:100]} is not encrypted, and whoever can reach it can "
            "run programs under your name. Start the scheduler with TLS and give its tls:// "
            "address.",
            stacklevel=2,
        )
    with _client_of(scheduler) as client:
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


def _is_protected(scheduler: str) -> bool:
    """Return whether others are kept from a connection: by TLS, or as it never leaves here.

    On a loopback address other users of the machine are not; but whoever started a scheduler there
    has let them in already, and no certificate here keeps them out.
    """
    address = urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}")
    if address.scheme in ("tls", "wss", "inproc"):
        return True
    host = address.hostname or ""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@contextmanager
def _client_of(scheduler: str) -> Iterator[Any]:
    from distributed import Client

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
        yield client


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
