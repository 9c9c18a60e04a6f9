"""Calls of one compiled program side by side, each of which uses a single core."""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import cache
from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Array

Job = TypeVar("Job")
Result = TypeVar("Result")

_WORKERS = min(os.cpu_count() or 1, 4)


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the one pool of this process: to start threads takes as long as a short program."""
    return ThreadPoolExecutor(_WORKERS)


# a process made by copying this one has none of its threads
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def in_threads(
    function: Callable[[Job], Result], jobs: Iterable[Job], is_compiled: bool = False
) -> list[Result]:
    """Return what a function makes of each job, in their order.

    `function`: calls a compiled program, which leaves Python to the others. `is_compiled`: whether
    that has met jobs of this shape; if not, the first runs alone, so that it is compiled once.
    """
    waiting = list(jobs)
    done = [] if is_compiled else [function(job) for job in waiting[:1]]
    waiting = waiting[len(done) :]
    if len(waiting) < 2:
        return done + [function(job) for job in waiting]
    # what numpy was told of overflows holds in the threads too
    each = [copy_context() for _ in waiting]
    return done + list(_pool().map(lambda own, job: own.run(function, job), each, waiting))


def on_device(values: ArrayLike) -> Array:
    """Return numbers, or an array of NumPy's, as an array of JAX's; one of JAX's stays as it is.

    Told no type, `jax.numpy.asarray` compiles a copy for every new shape, some 10 ms each; told the
    one that the array has, it only copies.
    """
    if isinstance(values, jax.Array | float | int):  # a number of Python's has no type of its own
        return jnp.asarray(values)
    held = np.asarray(values)
    return jnp.asarray(held, held.dtype)
