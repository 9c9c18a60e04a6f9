"""Functions compiled by JAX with options for loops of small steps."""

import functools
import gc
import itertools
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.core import Tracer

_LOGGER = logging.getLogger(__name__)

P = ParamSpec("P")
R = TypeVar("R")

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
