"""Effects that are known beside the declared law: with their values, or to be fitted along."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from discover.effects.base import AbstractEffect, EffectParameter
from discover.effects.registry import make_effect
from discover.errors import InputError, Problems
from discover.words import nearest, unknown_name

Written = Any
"""As a study has them: effect → parameter → value or ``"fit"``; ``"fit"`` alone fits them all."""


@dataclass(frozen=True)
class KnownEffect:
    """An effect that is part of the declared model.

    `values`: of its parameters, in their units and order; None where one is to be fitted.
    """

    effect: AbstractEffect
    values: tuple[float | None, ...]

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

    `written`: by name of the effect: values of its parameters, ``"fit"`` for those to be fitted
    along. `where`: the place, for messages. Raises InputError if an effect or a parameter is
    unknown, one is missing, or a value is outside its range.
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


def _value(asked: object, parameter: EffectParameter, where: str) -> float | None:
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
