"""Functions compiled by JAX with options for loops of small steps, and called side by side."""

import functools
import gc
import itertools
import logging
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jax.typing import ArrayLike
from jaxtyping import Array

_LOGGER = logging.getLogger(__name__)

P = ParamSpec("P")
R = TypeVar("R")
Job = TypeVar("Job")

_PIECES = Path("/proc/self/maps")  # on Linux; other systems have no such limit
_LIMIT = Path("/proc/sys/vm/max_map_count")
_SHARE = 0.5  # of the limit: the rest is for programs that are made before the next look

_calls = itertools.count(1)
_LOOK_EVERY = 500  # calls, each of which may be of a new program: to count takes some 10 ms


def compiled(function: Callable[P, R], runs_long: bool = False) -> Callable[P, R]:
    """Compile a function as `equinox.filter_jit` does, with options of the compiler.

    Arrays are traced, everything else is part of the program. `runs_long`: whether to let the
    compiler take its time.
    """
    inside = eqx.filter_jit(function)

    @functools.cache
    def alone() -> Any:
        options = _whole_loops() | ({} if runs_long else _compiled_soon())
        # its signature does not name what it hands on to jax.jit
        return eqx.filter_jit(function, compiler_options=options or None)  # pyright: ignore

    @functools.wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((args, kwargs))):
            return inside(*args, **kwargs)
        if next(_calls) % _LOOK_EVERY == 0 and _is_crowded():
            _LOGGER.debug("programs are dropped to make room for others")
            jax.clear_caches()  # those in use stay until they end
            gc.collect()
        return alone()(*args, **kwargs)

    return call


def _is_crowded() -> bool:
    """Return whether this process has mapped half of the pieces of memory that it may.

    Each compiled program takes some twenty. A process that goes on past the limit (65,530 by
    default, some fifteen comparisons of unlike studies) is ended by the compiler without an error.
    """
    try:
        with _PIECES.open("rb") as pieces:
            return sum(1 for _ in pieces) > _SHARE * int(_LIMIT.read_text())
    except (OSError, ValueError):
        return False


@functools.cache
def _compiled_soon() -> dict[str, Any]:
    """Return options that make XLA compile sooner, none where its version knows none of them.

    Its older emitters take two thirds of the time, and what they make is as fast but for large
    matrices.
    """
    return _if_known({"xla_cpu_use_fusion_emitters": False})


@functools.cache
def _whole_loops() -> dict[str, Any]:
    """Return options that keep sums inside the loop that they stand in.

    Newer versions of XLA hand sums of more than some thousand numbers to a library, and a loop with
    such a call is started piece by piece at every step (`discover.compilation_cache`): four times
    the work for eight runs of fourteen modes.
    """
    return _if_known({"xla_cpu_experimental_ynn_fusion_type": ""})


def _if_known(options: dict[str, Any]) -> dict[str, Any]:
    try:
        jax.jit(jnp.negative, compiler_options=options).lower(0.0).compile()
    except jax.errors.JaxRuntimeError:
        return {}
    return options


_WORKERS = min(os.cpu_count() or 1, 4)


@functools.cache
def _pool() -> ThreadPoolExecutor:
    """Return the one pool of this process: to start threads takes as long as a short program."""
    return ThreadPoolExecutor(_WORKERS)


# a process made by copying this one has none of its threads
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def in_threads(
    function: Callable[[Job], R], jobs: Iterable[Job], is_compiled: bool = False
) -> list[R]:
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
