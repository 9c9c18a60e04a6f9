"""Effects by name: the built-in ones, and a user's own (docs/adding-an-effect.md)."""

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from discover.effects import base, kinematic, network, signal, structure
from discover.effects.base import AbstractEffect, StateEffect
from discover.effects.library_term import library_term
from discover.errors import InputError, Problems
from discover.validation import require_new_name
from discover.words import nearest, unknown_name
from tensor_library.closed_forms import Registry
from tensor_library.library import build_library
from tensor_library.terms import parse_term

if TYPE_CHECKING:
    import pandas as pd


def _built_in() -> dict[str, base.AbstractEffect]:
    modules = (network, structure, kinematic, signal)
    found = [e for m in modules for e in vars(m).values() if isinstance(e, base.AbstractEffect)]
    return {effect.name: effect for effect in sorted(found, key=lambda e: (e.kind, e.name))}


EFFECTS: Registry[base.AbstractEffect] = Registry("effect", "discover.effects", _built_in)
"""Effects that have a name; a package's own by entry points of this group."""


def named_effects() -> Mapping[str, base.AbstractEffect]:
    """Return the effects that have a name: constitutive, kinematic, signal, then registered."""
    return EFFECTS


@cache
def built_in_effects() -> Mapping[str, base.AbstractEffect]:
    """Return the effects that a model may have without a user's own, those of the library last."""
    terms = map(library_term, build_library(degree=1).terms)
    return EFFECTS.built_in | {effect.name: effect for effect in terms}


def effects_table() -> "pd.DataFrame":
    """Return the effects known by name, one line a parameter, the amplitude first.

    `low` and `high` are in `unit` where `range_scale` is ``one``, else in that property of the
    data.

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


def register_effect(effect: base.AbstractEffect) -> base.AbstractEffect:
    """Make an effect of one's own known to studies and loops in this process.

    An installed package does so in every process: see docs/adding-an-effect.md. Raises InputError
    if it is no effect, has no parameter, or its name is taken or none.

    Examples
    --------
    >>> import discover as dc
    >>> dc.register_effect(effect)  # doctest: +SKIP
    """
    if not isinstance(effect, base.ConstitutiveEffect | base.KinematicEffect | base.SignalEffect):
        raise InputError(
            "An effect must be a ConstitutiveEffect, a KinematicEffect or a SignalEffect; got "
            f"{effect!r}. See docs/adding-an-effect.md."
        )
    require_new_name(effect.name, list(EFFECTS.present), "effect")
    if not effect.parameters:
        raise InputError(f"The effect {effect.name!r} needs a parameter: its amplitude, first.")
    EFFECTS[effect.name] = effect
    return effect


def make_effect(name: str) -> base.AbstractEffect:
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


def parameters_of(name: str) -> dict[str, base.EffectParameter]:
    """Return the parameters of an effect by name; none of one that was given as an object."""
    try:
        return {one.name: one for one in make_effect(name).parameters}
    except InputError:
        return {}


@dataclass(frozen=True)
class Spelled:
    """Equation of an effect, the letters of its parameters by name, and of its states, in LaTeX."""

    equation: str
    symbols: dict[str, str]
    states: tuple[str, ...] = ()


def spelled_on_a_page(names: Iterable[str]) -> dict[str, Spelled]:
    """Return equations and letters of effects with a name, each letter for one constant."""
    found = []
    for name in dict.fromkeys(names):
        with suppress(InputError):
            found.append(make_effect(name))
    return spelled_distinctly(found)


Written = Any
"""As a study has them: effect → parameter → value or ``"fit"``; ``"fit"`` alone fits them all."""


@dataclass(frozen=True)
class KnownEffect:
    """Effect that is part of the declared model."""

    effect: base.AbstractEffect
    values: tuple[float | None, ...]  # of its parameters, in their units; None of one to be fitted

    @property
    def name(self) -> str:
        """Name of the effect."""
        return self.effect.name

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that are to be fitted."""
        pairs = zip(self.effect.parameters, self.values, strict=True)
        return tuple(parameter.name for parameter, value in pairs if value is None)

    @property
    def text(self) -> str:
        """The effect with its values, in words."""
        pairs = zip(self.effect.parameters, self.values, strict=True)
        parts = [
            f"{p.name} to be fitted"
            if value is None
            else f"{p.name} = {value:.4g} {p.unit}".strip()
            for p, value in pairs
        ]
        return f"{self.name.replace('_', ' ')} ({', '.join(parts)})"


def known_effects(written: Written, where: str = "effects") -> tuple[KnownEffect, ...]:
    """Return the effects that a study or a program names.

    `written`: effect → parameter → value or ``"fit"``. `where`: the place, for messages. Raises
    InputError if a name is unknown, a parameter missing, or a value outside its range.
    """
    if not isinstance(written, Mapping):
        raise InputError(
            f"{where} must name effects with their values, such as "
            f'{{"rate_rise_time": {{"tau": 0.02}}}}; got {written!r}.'
        )
    found, problems = [], Problems()
    for name, asked in written.items():
        with problems.collected():
            found.append(_known_effect(name, asked, where))
    problems.require_none()
    return tuple(found)


def _known_effect(name: str, asked: object, where: str) -> KnownEffect:
    try:
        effect = make_effect(name)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    parameters = {parameter.name: parameter for parameter in effect.parameters}
    if asked == "fit":
        asked = dict.fromkeys(parameters, "fit")
    if not isinstance(asked, Mapping):
        raise InputError(
            f'{where}: {name} must be "fit", or give its parameters: {", ".join(parameters)}; '
            f"got {asked!r}."
        )
    problems, values = Problems(), []
    unknown = [key for key in asked if key not in parameters]
    for key in unknown:
        said = unknown_name("parameter", key, parameters, f"the effect {name}")
        problems.add(f"{where}: {said}")
    meant = {nearest(key, parameters) for key in unknown}
    for key, parameter in parameters.items():
        if key in asked:
            with problems.collected():
                values.append(_value(asked[key], parameter, f"{where}: {name}"))
        elif key not in meant:
            problems.add(
                f'{where}: the effect {name} needs {key} too. Write a number, or {key} = "fit".'
            )
    problems.require_none()
    return KnownEffect(effect, tuple(values))


def _value(asked: object, parameter: base.EffectParameter, where: str) -> float | None:
    if asked == "fit":
        return None
    if isinstance(asked, bool) or not isinstance(asked, int | float):
        raise InputError(f'{where}.{parameter.name} must be a number or "fit"; got {asked!r}.')
    low, high = float(parameter.low), float(parameter.high)
    # a range in a property of the data is known only beside the data
    if parameter.range_scale == "one" and not low <= asked <= high:
        unit = f" {parameter.unit}" if parameter.unit else ""
        raise InputError(
            f"{where}.{parameter.name} must lie between {low:g} and {high:g}{unit}; got {asked:g}."
        )
    return float(asked)


def spelled_distinctly(effects: Iterable[AbstractEffect]) -> dict[str, Spelled]:
    r"""Return equations and letters of effects that stand together, by name of the effect.

    A letter that an earlier effect has gets a prime, in an order of names, so that equation and
    table agree; states first, so that a law with them alone is spelled as it is beside an
    instrument's.
    """
    taken: set[str] = set()
    found = {}
    for effect in sorted(effects, key=lambda one: (not isinstance(one, StateEffect), one.name)):
        equation, symbols = effect.equation, {}
        own = {one.name: one.symbol for one in effect.parameters}
        letters = dict.fromkeys(symbol.removeprefix("1/") for symbol in own.values())
        for letter in [*letters, *_states(effect)]:
            new = letter
            while new in taken:
                new += "'"
            taken.add(new)
            letters[letter] = new
            equation = _replaced(equation, letter, new)
        for name, symbol in own.items():
            letter = symbol.removeprefix("1/")
            symbols[name] = symbol.removesuffix(letter) + str(letters[letter])
        states = tuple(str(letters[state]) for state in _states(effect))
        found[effect.name] = Spelled(equation, symbols, states)
    return found


def _states(effect: AbstractEffect) -> list[str]:
    """Return the letters of what an effect integrates with the fluid."""
    if not isinstance(effect, StateEffect):
        return []
    changing = re.findall(r"\\frac\{d(\\?[A-Za-z]+)", effect.equation)
    return list(dict.fromkeys(changing))


def _replaced(latex: str, letter: str, new: str) -> str:
    """Return a formula with another letter; not where it is an index or part of a word."""
    if letter == new:
        return latex
    # dX begins a derivative; a command of LaTeX ends where its letters do
    before = "" if letter.startswith("\\") else r"(?:(?<![A-Za-z\\_])(?<!mathrm\{)|(?<=\{d))"
    pattern = rf"(\^)?{before}{re.escape(letter)}(?![A-Za-z])"
    return re.sub(pattern, lambda found: f"^{{{new}}}" if found[1] else new, latex)
