"""All effects by name.

An effect that a module of the dictionary holds is built in. Effects of a user's own are registered,
by a program or by an installed package (see docs/adding-an-effect.md).
"""

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

from discover.effects import kinematic, memory, network, signal, structure
from discover.effects.base import AbstractEffect, ConstitutiveEffect, KinematicEffect, SignalEffect
from discover.effects.library_term import library_effects, library_term
from discover.errors import InputError
from discover.new_names import require_new_name
from discover.words import unknown_name
from tensor_library.registry import Registry
from tensor_library.terms import parse_term

if TYPE_CHECKING:
    import pandas as pd


def _built_in() -> dict[str, AbstractEffect]:
    modules = (network, memory, structure, kinematic, signal)
    found = [e for m in modules for e in vars(m).values() if isinstance(e, AbstractEffect)]
    return {effect.name: effect for effect in sorted(found, key=lambda e: (e.kind, e.name))}


EFFECTS: Registry[AbstractEffect] = Registry("effect", "discover.effects", _built_in)
"""Effects that have a name; a package's own by entry points of this group."""


def named_effects() -> Mapping[str, AbstractEffect]:
    """Return the effects that have a name: constitutive, kinematic, signal, then registered."""
    return EFFECTS


@cache
def built_in_effects() -> Mapping[str, AbstractEffect]:
    """Return the effects that a model may have without a user's own, those of the library last."""
    nameless = library_effects()
    return EFFECTS.built_in | {effect.name: effect for effect in nameless}


def effects_table() -> "pd.DataFrame":
    """Return the effects that are known by name, one line for each parameter, the amplitude first.

    An amplitude of zero is no effect. `low` and `high` are in `unit` where `range_scale` is
    ``one``, and else multiples of that property of the data.

    Examples
    --------
    >>> import discover as dc
    >>> "wall_slip" in dc.effects().index.get_level_values(0)
    True
    """
    import pandas as pd

    lines = [
        {"effect": effect.name, "kind": effect.kind, "parameter": p.name, "unit": p.unit or "1",
         "low": p.low, "high": p.high, "range_scale": p.range_scale,
         "visible": effect.visible, "source": effect.source}
        for effect in named_effects().values()
        for p in effect.parameters
    ]  # fmt: skip
    return pd.DataFrame(lines).set_index("effect")


def register_effect(effect: AbstractEffect) -> AbstractEffect:
    """Make an effect of one's own known by name, to studies and loops in this process.

    An installed package does so in every process: see docs/adding-an-effect.md.

    Parameters
    ----------
    effect
        Made as docs/adding-an-effect.md shows.

    Returns
    -------
    The effect.

    Raises
    ------
    InputError
        If it is no effect, has no parameter, or its name is taken or is none.

    Examples
    --------
    >>> import discover as dc
    >>> dc.register_effect(effect)  # doctest: +SKIP
    """
    if not isinstance(effect, ConstitutiveEffect | KinematicEffect | SignalEffect):
        raise InputError(
            "An effect must be a ConstitutiveEffect, a KinematicEffect or a SignalEffect; got "
            f"{effect!r}. See docs/adding-an-effect.md."
        )
    require_new_name(effect.name, list(EFFECTS.present), "effect")
    if not effect.parameters:
        raise InputError(f"The effect {effect.name!r} needs a parameter: its amplitude, first.")
    EFFECTS[effect.name] = effect
    return effect


def make_effect(name: str) -> AbstractEffect:
    """Return the effect of this name, or the effect that adds the library term so spelled."""
    effects = named_effects()
    if name in effects:
        return effects[name]
    try:
        return library_term(parse_term(name))
    except ValueError as error:
        raise InputError(
            f"{unknown_name('effect', name, effects)} A term of the library is an effect too, such "
            "as 'tr(sigma)*sigma'."
        ) from error
