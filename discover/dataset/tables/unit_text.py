"""Units as instruments and users write them.

Text from a file is never calculated: a unit is a product of words with small exponents, and the
only number in it that is no exponent is the 1 of ``1/s``. So ``10Pa`` and ``Pa_2`` are no units,
and ``9**9**9`` is not worked out. What a single word means is asked of pint.
"""

import re
from dataclasses import dataclass
from functools import cache

_LONGEST = 40  # characters

_SPELLINGS = {"%": "percent", "pct": "percent", "°": "degree", "rev": "turn"}
"""What pint does not know under this name."""

_JOINED = re.compile(r"\b([mkMGuµ]?(?:N|Pa))(m|s)\b")
"""Products that are written without a sign: mNm, Pas. A millisecond is no such thing: ms."""

_NUMBERS_PER_MINUTE = re.compile(r"\b(U|tr|rev)/min\b")

_DIMENSIONS = ("[mass]", "[length]", "[time]")

_NUMBERS = ("radian", "degree", "turn", "percent", "ppm")
"""Units without a dimension; pint counts constants such as pi among them."""


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
    text = _JOINED.sub(r"\1*\2", _NUMBERS_PER_MINUTE.sub("turn/min", text))
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


@cache
def _word(text: str) -> Unit | None:
    """Return a single word, such as kPa or seconds, from pint."""
    word = _SPELLINGS.get(text, text)
    # whole words may begin with a capital; of short symbols the case has a meaning
    for name in (word, word.lower()) if len(word) > 3 else (word,):
        parsed = _registry().parse_unit_name(name)
        if not parsed or _is_short_plural(name):
            continue
        unit = _registry().Unit(parsed[0][0] + parsed[0][1])
        size = _registry().Quantity(1.0, unit).to_base_units()
        found = dict(size.dimensionality)
        if set(found) <= set(_DIMENSIONS) and (found or str(unit).endswith(_NUMBERS)):
            kg, m, s = (round(float(str(found.get(key, 0)))) for key in _DIMENSIONS)
            return Unit(float(size.magnitude), (kg, m, s), "hertz" in str(unit))
    return None


def _is_short_plural(name: str) -> bool:
    """Return whether a name is a symbol with an s, as Pas, which is no plural of Pa."""
    parse, symbol = _registry().parse_unit_name, name.removesuffix("s")
    return len(name) <= 4 and symbol != name and parse(name)[:1] == parse(symbol)[:1]


@cache
def _registry():
    # pint takes a noticeable time to load; files in SI units never need it
    import pint

    return pint.UnitRegistry()
