"""Units as instruments and users write them, read by a small grammar of their own.

Text from a file is never calculated: a unit is a product of known words with small exponents, and
the only number in it that is no exponent is the 1 of ``1/s``. So ``10Pa`` and ``Pa_2`` are no
units, and ``9**9**9`` is not worked out.
"""

import math
import re
from dataclasses import dataclass

_LONGEST = 40  # characters

# Factor to SI and exponents of kg, m, s. Defined values: BIPM, The International System of Units,
# 9th ed.; others: NIST SP 811 (2008), appendix B.8
_STEMS: dict[str, tuple[float, tuple[int, int, int]]] = {
    "s": (1.0, (0, 0, 1)),
    "Pa": (1.0, (1, -1, -2)),
    "bar": (1e5, (1, -1, -2)),
    "N": (1.0, (1, 1, -2)),
    "dyn": (1e-5, (1, 1, -2)),
    "m": (1.0, (0, 1, 0)),
    "g": (1e-3, (1, 0, 0)),
    "rad": (1.0, (0, 0, 0)),
    "Hz": (1.0, (0, 0, -1)),
}
"""Words that take a prefix."""

_WORDS: dict[str, tuple[float, tuple[int, int, int]]] = {
    "min": (60.0, (0, 0, 1)),
    "h": (3600.0, (0, 0, 1)),
    "d": (86400.0, (0, 0, 1)),
    "psi": (6894.757293168361, (1, -1, -2)),
    "ksi": (6894757.293168361, (1, -1, -2)),
    "atm": (101325.0, (1, -1, -2)),
    "torr": (101325.0 / 760.0, (1, -1, -2)),
    "lbf": (4.4482216152605, (1, 1, -2)),
    "kgf": (9.80665, (1, 1, -2)),
    "gf": (9.80665e-3, (1, 1, -2)),
    "in": (0.0254, (0, 1, 0)),
    "ft": (0.3048, (0, 1, 0)),
    "deg": (math.pi / 180.0, (0, 0, 0)),
    "rev": (2.0 * math.pi, (0, 0, 0)),
    "rpm": (2.0 * math.pi / 60.0, (0, 0, -1)),
    "%": (0.01, (0, 0, 0)),
    "ppm": (1e-6, (0, 0, 0)),
}
"""Words that take none."""

_NAMES = {
    "second": "s", "sec": "s", "minute": "min", "hour": "h", "hr": "h", "day": "d", "pascal": "Pa",
    "newton": "N", "dyne": "dyn", "meter": "m", "metre": "m", "inch": "in", "foot": "ft",
    "gram": "g", "radian": "rad", "degree": "deg", "°": "deg", "hertz": "Hz", "turn": "rev",
    "revolution": "rev", "percent": "%", "pct": "%",
}  # fmt: skip
"""Other words for the same, in lower case; all that are whole words also with an s at the end."""

_PREFIXES = {
    "G": 1e9, "M": 1e6, "k": 1e3, "h": 1e2, "d": 1e-1, "c": 1e-2, "m": 1e-3, "u": 1e-6, "µ": 1e-6,
    "n": 1e-9, "p": 1e-12,
}  # fmt: skip
_LONG_PREFIXES = {
    "giga": 1e9, "mega": 1e6, "kilo": 1e3, "hecto": 1e2, "centi": 1e-2, "milli": 1e-3,
    "micro": 1e-6, "nano": 1e-9,
}  # fmt: skip


@dataclass(frozen=True)
class Unit:
    """A unit as its factor to SI and its dimension.

    Attributes
    ----------
    factor
        Of the SI unit.
    dimension
        Exponents of kg, m and s. Angles and numbers have none.
    cycles
        Whether it counts cycles, as Hz does; 1 Hz is 2π rad/s where an angle is meant.
    """

    factor: float = 1.0
    dimension: tuple[int, int, int] = (0, 0, 0)
    cycles: bool = False

    def times(self, other: "Unit", exponent: int = 1) -> "Unit":
        """Return this unit times a power of another."""
        kg, m, s = (a + exponent * b for a, b in zip(self.dimension, other.dimension, strict=True))
        factor = self.factor * other.factor**exponent
        return Unit(factor, (kg, m, s), self.cycles or other.cycles)


def read_heading(suffix: str) -> Unit | None:
    """Return the unit at the end of a column's name, or None if it is none.

    The first word stands above the fraction line, the others below it: ``1_min``, ``rad_s``,
    ``dyn_cm2``.

    Parameters
    ----------
    suffix
        What follows the name and its underscore.
    """
    first, *below = suffix.split("_")
    if len(suffix) > _LONGEST or (first == "1" and not below):
        return None
    found = Unit() if first == "1" else _power(first)
    for word in below:
        unit = _power(word)
        if found is None or unit is None:
            return None
        found = found.times(unit, -1)
    return found


def read_unit(text: str) -> Unit | None:
    """Return a unit as exports write it, or None if it is none.

    Products are written with ``.``, ``*``, ``·`` or a space, exponents as ``cm2``, ``s-1``,
    ``s^-1``, ``s**-1`` or ``s⁻¹``. Empty, ``-`` and ``1`` mean a pure number.

    Parameters
    ----------
    text
        Such as ``kPa``, ``1/s``, ``N.m`` or ``dyn/cm²``.
    """
    text = text.strip()
    if text in ("", "-", "—", "1"):
        return Unit()
    if len(text) > _LONGEST:
        return None
    plain = {"·": "*", "⋅": "*", "⁻": "-", "¹": "1", "²": "2", "³": "3", "μ": "µ"}
    text = "".join(plain.get(c, c) for c in text).replace("**", "^")
    tokens = re.findall(r"[A-Za-zµ°%]++(?:\^?-?[0-9]++)?|[0-9]++|[()/*.]|\S", text)
    found, rest = _product(tokens)
    return None if rest else found


def _product(tokens: list[str]) -> tuple[Unit | None, list[str]]:
    """Return the unit that the tokens begin with, and the tokens after it."""
    found, sign = Unit(), 1
    expected = True  # a word, not an operator
    while tokens and tokens[0] != ")":
        token, tokens = tokens[0], tokens[1:]
        if token in "/*." and not expected:
            sign, expected = (-1 if token == "/" else 1), True
            continue
        if token == "(":
            inner, tokens = _product(tokens)
            if inner is None or not tokens:
                return None, tokens
            tokens = tokens[1:]
        else:
            inner = Unit() if token == "1" else _power(token)
        if inner is None:
            return None, tokens
        found = found.times(inner, sign)
        sign, expected = 1, False
    return (None if expected else found), tokens


def _power(text: str) -> Unit | None:
    """Return a word with its exponent, such as cm2 or s^-1."""
    match = re.fullmatch(r"([A-Za-zµ°%]+)\^?(-?[1-9])?", text)
    if match is None:
        return None
    word = _word(match.group(1))
    return None if word is None else Unit().times(word, int(match.group(2) or 1))


def _word(text: str) -> Unit | None:
    if text in _WORDS:
        return Unit(*_WORDS[text])
    for prefix, factor in (("", 1.0), *_PREFIXES.items()):
        stem = text.removeprefix(prefix)
        if text.startswith(prefix) and stem in _STEMS:
            size, dimension = _STEMS[stem]
            return Unit(factor * size, dimension, stem == "Hz")
    name = text.lower()
    if name not in _NAMES and len(name) > 4:
        name = name.removesuffix("s")
    for prefix, factor in (("", 1.0), *_LONG_PREFIXES.items()):
        symbol = _NAMES.get(name.removeprefix(prefix), "") if name.startswith(prefix) else ""
        if symbol and (not prefix or symbol in _STEMS):
            unit = _word(symbol)
            return None if unit is None else Unit(factor, cycles=unit.cycles).times(unit)
    return None
