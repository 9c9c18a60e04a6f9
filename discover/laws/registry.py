"""Named laws, as study files and the command line spell them.

A file in this folder that says ``NAMED = {...}`` is a law that can be asked for; nothing else has
to be edited.
"""

import importlib
import math
import pkgutil
import sys
from collections.abc import Mapping

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.named import NamedLaw

_CLASSICAL = ("maxwell", "johnson_segalman", "giesekus", "phan_thien_tanner", "fene_p")
"""Files whose laws come first in lists, in the order of textbooks."""


def _named_laws() -> dict[str, NamedLaw]:
    package = sys.modules[__name__.rpartition(".")[0]]
    files = [module.name for module in pkgutil.iter_modules(package.__path__)]
    laws: dict[str, NamedLaw] = {}
    for file in dict.fromkeys([*_CLASSICAL, *files]):
        if file != "registry":
            laws |= getattr(importlib.import_module(f"discover.laws.{file}"), "NAMED", {})
    return laws


LAWS: Mapping[str, NamedLaw] = _named_laws()
"""Named laws by the name in study files."""


def make_law(name: str, parameters: Mapping[str, float] | None = None) -> AbstractConstitutiveLaw:
    """Return the named law with these parameters.

    Parameters
    ----------
    name
        Key of `LAWS`.
    parameters
        Every parameter of the law, by the contract's name.

    Raises
    ------
    InputError
        If the law is unknown, or a parameter is missing, unknown or outside its range.
    """
    parameters = dict(parameters or {})
    if name not in LAWS:
        raise InputError(f"Unknown law {name!r}; write one of {', '.join(LAWS)}.")
    entry = LAWS[name]
    unknown = [key for key in parameters if key not in entry.parameters]
    if unknown:
        wanted = ", ".join(entry.parameters) or "none"
        raise InputError(
            f"The law {name!r} has no parameter {unknown[0]!r}. Write one of its parameters: "
            f"{wanted}."
        )
    values = []
    for key, (low, high) in entry.parameters.items():
        if key not in parameters:
            raise InputError(
                f"The law {name!r} needs its parameter {key!r}. Give it, from {low:g} to {high:g}."
            )
        value = parameters[key]
        if (
            not isinstance(value, int | float)
            or not math.isfinite(value)
            or not low <= value <= high
        ):
            raise InputError(
                f"The parameter {key!r} of the law {name!r} must be a number from {low:g} to "
                f"{high:g}; got {value!r}."
            )
        values.append(float(value))
    return entry.build(*values)
