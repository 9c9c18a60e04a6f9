"""Packages that answer a call: ``discover.laws()`` beside ``discover.laws.Giesekus``."""

import inspect
import sys
from collections.abc import Callable
from types import ModuleType
from typing import Any


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
