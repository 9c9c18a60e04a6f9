"""A constant of modes or instrument that is fitted along with a learner."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Constant:
    """A constant that was fitted along with a learner.

    Attributes
    ----------
    name
        As the study spells it; parameters of effects as ``effect.parameter``.
    value, unit
        The value and its unit; of several modes only a common factor is fitted, without unit.
    ci95
        95 % interval, joint with the coefficients of the law; None where the law cannot give way.
    raw
        As the forward model has it: factors as logarithms.
    """

    name: str
    value: float
    unit: str
    ci95: tuple[float, float] | None
    raw: float


def in_words(name: str, one_mode: bool) -> str:
    """Return the name of a constant in words.

    Parameters
    ----------
    name
        As of a `Constant`.
    one_mode
        Whether the fluid has one mode; of several a common factor is fitted.
    """
    if "." in name:
        effect, parameter = name.split(".", 1)
        own, whose = (text.replace("_", " ") for text in (parameter, effect))
        return f"{whose} ({own})"
    words = {
        "modulus_Pa": ("modulus", "factor on all moduli"),
        "relaxation_time_s": ("relaxation time", "factor on all relaxation times"),
    }
    one, factor = words.get(name, (name, name))
    return one if one_mode else factor
