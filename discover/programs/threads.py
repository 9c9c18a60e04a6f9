"""Calls of one compiled program side by side, each of which uses a single core."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

_WORKERS = min(os.cpu_count() or 1, 4)


def in_threads(
    function: Callable[[Job], Result], jobs: Iterable[Job], is_compiled: bool = False
) -> list[Result]:
    """Return what a function makes of each job, in their order.

    Parameters
    ----------
    function
        Calls a compiled program, which leaves Python to the others.
    jobs
        What it is called with.
    is_compiled
        Whether the program has met jobs of this shape. If not, the first runs alone, so that it is
        compiled once.
    """
    waiting = list(jobs)
    done = [] if is_compiled else [function(job) for job in waiting[:1]]
    waiting = waiting[len(done) :]
    if len(waiting) < 2:
        return done + [function(job) for job in waiting]
    with ThreadPoolExecutor(_WORKERS) as pool:
        return done + list(pool.map(function, waiting))
