"""All effects by name. A new file in one of the three folders is a new effect; nothing else."""

import importlib
import pkgutil
from collections.abc import Mapping
from functools import cache

from discover.effects import constitutive, kinematic, signal
from discover.effects.base import AbstractEffect
from discover.effects.library_term import library_term
from discover.errors import InputError
from tensor_library.terms import parse_term


@cache
def named_effects() -> Mapping[str, AbstractEffect]:
    """Return the effects that have a name, in the order constitutive, kinematic, signal."""
    effects = {}
    for package in (constitutive, kinematic, signal):
        for module in pkgutil.iter_modules(package.__path__):
            effect = importlib.import_module(f"{package.__name__}.{module.name}").EFFECT
            effects[effect.name] = effect
    return effects


def make_effect(name: str) -> AbstractEffect:
    """Return the effect of this name, or the effect that adds the library term so spelled.

    Raises
    ------
    InputError
        If it is neither.
    """
    effects = named_effects()
    if name in effects:
        return effects[name]
    try:
        return library_term(parse_term(name))
    except ValueError as error:
        raise InputError(
            f"Unknown effect {name!r}; write a term of the library, such as 'tr(sigma)*sigma', or "
            f"one of {', '.join(effects)}."
        ) from error
