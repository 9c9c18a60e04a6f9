"""The processor as the place where commands compute, small products of matrices in one thread."""

import os
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

_CHOSEN = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "BLIS_NUM_THREADS")
_PLATFORMS = ("JAX_PLATFORMS", "JAX_PLATFORM_NAME")

_Function = TypeVar("_Function", bound=Callable[..., Any])


def in_one_thread(function: _Function) -> _Function:
    """Return a function that runs with linear algebra in the thread that calls it.

    OpenBLAS threads spin while they wait: with matrices of some hundred rows and trials side by
    side a product takes up to thirty times the processor. A number of threads chosen in the
    environment stays. OpenBLAS takes a number from the main thread only.
    """

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        if _chosen_by_user():
            return function(*args, **kwargs)
        from threadpoolctl import threadpool_limits

        with threadpool_limits(1, "blas"):
            return function(*args, **kwargs)

    return cast(_Function, limited)


def use_one_thread_from_the_start() -> None:
    """Let libraries that this process, or one begun from it, loads later take one thread."""
    if not _chosen_by_user():
        os.environ["OPENBLAS_NUM_THREADS"] = "1"


def _chosen_by_user() -> bool:
    return any(os.environ.get(name) for name in _CHOSEN)


def use_the_processor_from_the_start() -> None:
    """Let JAX, once this process or one begun from it loads it, compute on the processor.

    The loops here are thousands of steps on arrays of a few hundred numbers, and an accelerator
    begins each anew: ``discover demo`` takes 53 s on the processor beside an H100, and 143 s on
    that, for the same answers. A choice of the user's, ``JAX_PLATFORMS=cuda`` say, stays as it is.
    """
    if not any(os.environ.get(name) for name in _PLATFORMS):
        os.environ["JAX_PLATFORMS"] = "cpu"
