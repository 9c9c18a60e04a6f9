"""What is set up when something that computes is first used: double precision, kept programs.

Importing this module does it; whatever needs JAX imports it before JAX, so that it holds in every
process, also a worker that unpickles an estimator. ``import discover`` alone does not.
"""

import inspect
import os
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any

from discover.compilation_cache import enable_compilation_cache
from discover.errors import InputError


def enable_x64() -> None:
    """Make JAX compute in float64, which sparse regression and reference solutions need."""
    import jax

    jax.config.update("jax_enable_x64", True)


_SINGLE = ("float32", "complex64")


def set_up() -> None:
    """Turn on double precision and keep compiled programs, unless the user has chosen.

    Raises InputError if JAX holds arrays of single precision that were made before.
    """
    import jax

    if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        _require_no_single_arrays(jax)
        enable_x64()
    require_double()
    _keep_developers_messages(jax)
    enable_compilation_cache()


def _keep_developers_messages(jax) -> None:
    """Keep developers' messages of XLA and JAX from standard error by default."""
    by_jax = jax.config.jax_logging_level not in (None, "NOTSET")
    # JAX itself sets the level of XLA to 1 where nobody did
    if not by_jax and os.environ.get("TF_CPP_MIN_LOG_LEVEL", "1") == "1":
        jax.config.update("jax_logging_level", "CRITICAL")


def require_double() -> None:
    """Check that JAX computes in double precision here and now."""
    import jax

    if not jax.config.jax_enable_x64:  # pyright: ignore[reportAttributeAccessIssue]
        raise InputError(
            "JAX computes in single precision here, in which no law can be told from another. "
            "Leave the block that turned double precision off, or turn it on again with "
            "jax.config.update('jax_enable_x64', True)."
        )


def _require_no_single_arrays(jax) -> None:
    if not _has_started():
        return  # asking for arrays would start JAX, which is for the user to do
    count = sum(str(array.dtype) in _SINGLE for array in jax.live_arrays())
    if count:
        raise InputError(
            f"JAX holds {count} array{'s' if count > 1 else ''} of single precision, made before "
            "discover was used, which computes in double precision. Begin the program with "
            "jax.config.update('jax_enable_x64', True), or call that now if these arrays are not "
            "for discover."
        )


def _has_started() -> bool:
    """Return whether JAX has a device, without which there is no array."""
    bridge = sys.modules.get("jax._src.xla_bridge")  # JAX has no public name for it
    started = getattr(bridge, "backends_are_initialized", None)
    return True if started is None else bool(started())


def answer_calls(package: str, answer: Callable[..., Any]) -> None:
    """Let a package be called: ``discover.laws()`` and ``discover.laws.Giesekus`` share a name.

    `package`: its full name. `answer`: what a call calls.
    """

    class CallablePackage(ModuleType):
        def __call__(self, *args: Any, **options: Any) -> Any:
            return answer(*args, **options)

    module = sys.modules[package]
    module.__class__ = CallablePackage
    module.__doc__ = f"{inspect.getdoc(answer)}\n\n{inspect.getdoc(module)}"
    module.__signature__ = inspect.signature(answer)  # type: ignore[attr-defined]


set_up()
