"""Functions compiled once and found again by the next process, without tracing.

To trace a solver takes longer than to run it, and JAX keeps only what comes after tracing. So each
function is exported [`jax.export`] under a digest of what it was made from.
"""

import dataclasses
import functools
import gc
import importlib
import itertools
import logging
import threading
import weakref
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

import equinox as eqx
import jax
import jax.export
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from discover.programs.store import (
    OURS,
    NotDescribable,
    fingerprint,
    found_by_name,
    load_program,
    program_folder,
    save_program,
)

_PIECES = Path("/proc/self/maps")  # on Linux; other systems have no such limit
_LIMIT = Path("/proc/sys/vm/max_map_count")
_SHARE = 0.5  # of the limit: the rest is for programs that are made before the next look


def is_crowded() -> bool:
    """Return whether this process has mapped half of the pieces of memory that it may.

    Each compiled program takes some twenty. A process that goes on past the limit (65,530 by
    default, some fifteen comparisons of unlike studies) is ended by the compiler without an error.
    """
    try:
        with _PIECES.open("rb") as pieces:
            return sum(1 for _ in pieces) > _SHARE * int(_LIMIT.read_text())
    except (OSError, ValueError):
        return False


def drop_all() -> None:
    """Drop every program that this process holds; those in use stay until they end."""
    jax.clear_caches()
    gc.collect()


_PLAIN = (type(None), bool, int, float, str)


def take_apart(value: Any, leaves: list[Any]) -> Any:
    """Return the nesting of a value as JSON-able lists, and append its arrays to `leaves`.

    Raises NotDescribable unless it is made of arrays, plain values, tuples, lists, dictionaries and
    the named tuples and modules of this project.
    """
    if eqx.is_array(value):
        leaves.append(value)
        return ["array"]
    if isinstance(value, _PLAIN):
        return ["plain", value]
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return ["named", _name(type(value)), *(take_apart(part, leaves) for part in value)]
    if type(value) in (tuple, list):
        return [type(value).__name__, *(take_apart(part, leaves) for part in value)]
    if type(value) is dict and all(isinstance(key, str) for key in value):
        return ["dict", *([key, take_apart(part, leaves)] for key, part in value.items())]
    if isinstance(value, eqx.Module):
        fields = [f.name for f in dataclasses.fields(value)]  # pyright: ignore[reportArgumentType]
        parts = [[name, take_apart(vars(value)[name], leaves)] for name in fields]
        return ["module", _name(type(value)), *parts]
    raise NotDescribable(f"a result of {type(value).__name__}")


def put_together(nesting: Sequence[Any], leaves: Iterator[Any]) -> Any:
    """Return the value with this nesting and these arrays, in the order of `take_apart`."""
    kind, *parts = nesting
    if kind == "array":
        return next(leaves)
    if kind == "plain":
        return parts[0]
    if kind in ("tuple", "list"):
        values = (put_together(part, leaves) for part in parts)
        return tuple(values) if kind == "tuple" else list(values)
    if kind == "dict":
        return {key: put_together(part, leaves) for key, part in parts}
    name, *parts = parts
    made = _class(name)
    if kind == "named":
        return made(*(put_together(part, leaves) for part in parts))
    # as equinox itself rebuilds a module: without its __init__, which may compute
    module = object.__new__(made)
    for key, part in parts:
        object.__setattr__(module, key, put_together(part, leaves))
    return module


def _name(kind: type) -> str:
    if kind.__module__.partition(".")[0] not in OURS or "." in kind.__qualname__:
        raise NotDescribable(f"a result of {kind.__name__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def _class(name: str) -> Any:
    module, _, kind = name.partition(":")
    if module.partition(".")[0] not in OURS:
        raise NotDescribable(f"a class of {module}")
    found = getattr(importlib.import_module(module), kind)
    if not (isinstance(found, type) and issubclass(found, (tuple, eqx.Module))):
        raise NotDescribable(f"{name} is no result")
    return found


P = ParamSpec("P")
R = TypeVar("R")

_LOGGER = logging.getLogger(__name__)

# JAX promises for these calls only that the same version knows them; the stamp names the version
_UNPROMISED = [jax.export.DisabledSafetyCheck.custom_call("lapack_dormqr_ffi")]

_ALL: weakref.WeakSet = weakref.WeakSet()

_ARRAYS = (jax.Array, np.ndarray, np.generic)

# bytes as exported; those of a loop with all candidates are larger, and from there on the newer
# emitters compile them sooner
_LARGE = 200_000

_made_so_far = itertools.count(1)
_LOOK_EVERY = 50  # programs: to count what is mapped takes some 10 ms


def compiled(
    function: Callable[P, R], made_from: Any = None, runs_long: bool = False
) -> "Compiled[P, R]":
    """Compile a function as `equinox.filter_jit` does, and keep its program for the next start.

    Arrays are traced, everything else, what it encloses too, is part of the program. Inside of a
    transformation, without a cache folder, or with arguments that no digest describes (a law from a
    notebook, say), it is `equinox.filter_jit` and no more.

    `made_from`: what tells a function made inside of another from others made there, in place of
    everything that it encloses. `runs_long`: whether to let the compiler take its time.
    """
    return Compiled(function, made_from, runs_long)


def forget_programs() -> None:
    """Let this process start anew, without a program; files stay."""
    for one in list(_ALL):
        one.forget()
    drop_all()


class Compiled(Generic[P, R]):
    """A function with its programs, one for each kind of arguments. See `compiled`."""

    def __init__(self, function: Callable[P, R], made_from: Any, runs_long: bool):
        functools.update_wrapper(self, function)
        self._function: Any = function
        self._made_from = made_from
        self._runs_long = runs_long
        self._traced: Any = eqx.filter_jit(function)
        self._programs: dict[Any, Callable[[Any, Any, Sequence[Any]], R]] = {}
        self._lock = threading.RLock()
        _ALL.add(self)

    def __reduce__(self) -> str:
        # by name, as a function: another process makes programs of its own
        return self._function.__qualname__

    def forget(self) -> None:
        """Drop what this process holds."""
        self._programs.clear()

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """Return what the function returns."""
        leaves, tree = jax.tree.flatten((args, kwargs))
        arrays, rest, kinds = [], [], []
        for leaf in leaves:
            if not isinstance(leaf, _ARRAYS):
                rest.append(leaf)
                continue
            if isinstance(leaf, Tracer):
                return self._traced(*args, **kwargs)
            arrays.append(leaf)
            rest.append(None)
            kinds.append((leaf.shape, leaf.dtype, _weak(leaf)))
        key = (tree, tuple(rest), tuple(kinds), program_folder())
        try:
            program = self._programs.get(key)
        except TypeError:  # of something without a hash: left to equinox, which says so
            return self._traced(*args, **kwargs)
        if program is None:
            with self._lock:
                program = self._programs.get(key) or self._made(args, kwargs, arrays, key[-1])
                self._programs[key] = program
        return program(args, kwargs, arrays)

    def _made(self, args, kwargs, arrays, folder):
        """Return the program for such arguments: found, or exported and kept, or traced."""
        soon = {} if self._runs_long else _compiled_soon()
        always = _whole_loops() or None
        options = {**soon, **(always or {})} or None
        # its signature does not name what it hands on to jax.jit
        alone = eqx.filter_jit(self._function, compiler_options=options)  # pyright: ignore

        def traced(args, kwargs, arrays):
            # a program apart, also where another function is being traced: JAX takes no options for
            # one inside of another
            with jax.ensure_compile_time_eval():
                return alone(*args, **kwargs)

        if next(_made_so_far) % _LOOK_EVERY == 0 and is_crowded():
            _LOGGER.debug("programs are dropped to make room for others")
            forget_programs()
        if folder is None:
            return traced
        try:
            file = folder / (self._identity() + fingerprint((args, kwargs), False)).hex()
            kept = load_program(file)
            if kept is None:
                kept = self._export(args, kwargs, arrays)
                save_program(file, *kept)
            nesting, data = kept
            options = options if len(data) < _LARGE else always
            exported = jax.export.deserialize(bytearray(data))
        except (NotDescribable, NotImplementedError, ValueError, TypeError) as reason:
            _LOGGER.debug("%s is traced at every start: %s", self._function.__qualname__, reason)
            return traced

        def run(*arrays):
            return exported.call(*arrays)

        run.__name__ = self._function.__name__  # by which JAX files it
        # what an exported program returns is bound to its device, and JAX compiles once more for
        # bound arguments than for others, unless it is told beforehand where all of them are
        call = jax.jit(run, in_shardings=_where(), compiler_options=options)

        def found(args, kwargs, arrays):
            with jax.ensure_compile_time_eval():  # as above
                return put_together(nesting, iter(call(*arrays)))

        return found

    def _identity(self) -> bytes:
        """Return a digest of the function, which its name is only where it is found by it.

        One made by another, such as ``jax.vmap(method)``, may bear the name of what it was made of.
        """
        name = f"{self._function.__module__}:{self._function.__qualname__}"
        if self._made_from is None and found_by_name(self) is not None:
            return fingerprint(name, True)
        made_from = self._function if self._made_from is None else self._made_from
        return fingerprint((name, made_from), True)

    def _export(self, args, kwargs, arrays) -> tuple[Any, bytes]:
        leaves, tree = jax.tree.flatten((args, kwargs))
        nesting: list[Any] = []

        def flat(*arrays):
            numbers = iter(arrays)
            filled = [next(numbers) if eqx.is_array(leaf) else leaf for leaf in leaves]
            args, kwargs = jax.tree.unflatten(tree, filled)
            results: list[Any] = []
            nesting[:] = [take_apart(self._function(*args, **kwargs), results)]
            return results

        shapes = [jax.ShapeDtypeStruct(a.shape, a.dtype, weak_type=_weak(a)) for a in arrays]
        exported = jax.export.export(jax.jit(flat), disabled_checks=_UNPROMISED)(*shapes)
        return nesting[0], bytes(exported.serialize())


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


def _where() -> jax.sharding.Sharding:
    """Return the place where JAX computes unless it is told otherwise."""
    with jax.ensure_compile_time_eval():  # also when a function is being traced
        return jax.device_put(np.zeros(())).sharding


def _weak(array: Any) -> bool:
    return bool(getattr(array, "weak_type", False))
