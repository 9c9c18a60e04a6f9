"""Shapes checked on the first calls of every function in each file of tests, and no more.

The decorator that `jaxtyping`'s hook puts on every function builds its checks at once, so importing
the packages under it takes six times as long; and a function of a loop is called some hundred
thousand times with the same shapes. Here checks are built at a function's first call, and made on
its first calls in each file.
"""

import functools
import inspect
import re
from collections.abc import Callable
from types import CodeType

import jaxtyping

CALLS = 5
"""How many calls of a function are checked in each file."""

_SHAPE = re.compile(r"\b(Float|Int|Bool|Shaped|Num)\[")

# by code, whose hash takes as long as a short call: it is looked up once for each function
_seen: dict[CodeType, list[int]] = {}


def begin_file() -> None:
    """Check the first calls again."""
    for calls in _seen.values():
        calls[0] = 0


def install() -> None:
    """Let the hook of `jaxtyping` decorate functions so. Call it before what it decorates."""
    every_call = jaxtyping.jaxtyped

    def jaxtyped(*, typechecker: Callable) -> Callable:
        return functools.partial(_decorated, check=every_call(typechecker=typechecker))

    jaxtyping.jaxtyped = jaxtyped  # pyright: ignore


def _decorated(what, check: Callable):
    if inspect.isclass(what):
        init = vars(what).get("__init__")
        if hasattr(what, "__dataclass_fields__") and inspect.isfunction(init):
            what.__init__ = _decorated(init, check)
        return what
    if not inspect.isfunction(what):
        return check(what)
    # one inside another is a new one at every call of that, and those of lanes, which write code
    # number by number, are called a million times
    if "<locals>" in what.__qualname__ or what.__module__.startswith("discover.programs.lanes"):
        return what if not _has_shapes(what) else check(what)
    calls, built = _seen.setdefault(what.__code__, [0]), []

    @functools.wraps(what)
    def on_first_calls(*args, **kwargs):
        if calls[0] >= CALLS or jaxtyping.config.jaxtyping_disable:
            return what(*args, **kwargs)
        calls[0] += 1
        if not built:
            built.append(check(what))
        return built[0](*args, **kwargs)

    return on_first_calls


def _has_shapes(what: Callable) -> bool:
    return any(_SHAPE.search(str(annotation)) for annotation in what.__annotations__.values())
