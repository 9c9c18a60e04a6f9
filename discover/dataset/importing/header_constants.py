"""What the lines above a block of numbers say of the whole of it: a gap, a radius, a rate."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from discover.dataset.tables.unit_text import name_and_unit

_VALUE = r"([+-]?(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)(?:[eE][+-]?[0-9]+)?)\s*((?:1/|[^\s0-9:]).{0,19})?"
_ALONE = re.compile(_VALUE)
_UNIT = re.compile(
    r"[#%\s]*([^:=#%]{1,40}?)[\s_]+(?:units?|einheit|unité)\s*[:=]\s*(\S.{0,19})", re.I
)
_WITH_KEY = re.compile(rf"[#%\s]*([^:=#%]{{1,40}}?)\s*[:=]\s*{_VALUE}")
_DEGREES = re.compile(
    r"(?:(?<![^\s_=(\[,;@])-)?(?<![\w.,])([0-9]+(?:[.,][0-9]+)?)\s*_?"
    r"(?:°|º|˚|deg(?:rees?)?[\s_]*)?\s*([CcK]|celsius|kelvin)(?![^\W_])",
)
_KELVIN_FROM = 200.0
"""Below which a melt or a solution is frozen, in K."""

_TO = re.compile(r"[0-9]\s*(?:°?\s*C)?\s*(?:to|bis|à|-|–|\.\.)\s*$")


@dataclass(frozen=True)
class Constant:
    """A number that holds for a whole block.

    `name`: as the file writes it.
    `value`: with a decimal point; empty where the line gives a unit alone, as "Rate Unit: 1/s".
    `unit`: empty where the file gives none.
    """

    name: str
    value: str
    unit: str


def constants_of(rows: Sequence[Sequence[str]]) -> tuple[Constant, ...]:
    """Return what lines say as a name, a number and a unit; the last of a name counts."""
    found: dict[tuple[str, bool], Constant] = {}
    for row in rows:
        for constant in _constants([cell for cell in row if cell]):
            if constant.name[:1].isalpha():
                found[constant.name.lower(), bool(constant.value)] = constant
    return tuple(found.values())


def _constants(cells: Sequence[str]) -> Iterator[Constant]:
    if not 1 <= len(cells) <= 8:
        return
    value = _ALONE.fullmatch(" ".join(cells[1:3]))
    if value and len(cells) <= 3:
        yield _constant(cells[0], *value.groups())
        return
    for part in " ".join(cells).split(";"):
        if unit := _UNIT.fullmatch(part.strip()):
            yield Constant(unit[1], "", unit[2])
            continue
        match = _WITH_KEY.fullmatch(part.strip())
        if match:
            yield _constant(*match.groups())


def _constant(name: str, number: str, unit: str | None) -> Constant:
    name, unit = name_and_unit(name.strip(" :=#%"), (unit or "").strip())
    return Constant(name, number.replace(",", "."), unit)


_AS_SYMBOL = re.compile(
    r"(?<![^\W_])T(?:emp(?:erature)?)?\s*=\s*(-?[0-9]+(?:[.,][0-9]+)?)(?![\w.,%°])"
)


def temperature_in(text: str) -> Constant | None:
    """Return the temperature that a title or a file's name says; None if it says none, or several.

    In kelvin only where a melt or solution can be, since 95K may be a molar mass.
    """
    found = {}
    text = text.replace("_", " ")
    for match in _DEGREES.finditer(text):
        value = match[1].replace(",", ".")
        unit = match[2][0].upper()
        if _TO.search(text[: match.start()]):
            return None  # a ramp
        if unit == "C" or _KELVIN_FROM <= float(value) <= 700.0:
            sign = "-" if match[0].startswith("-") else ""
            found[sign + value, unit] = Constant(
                "temperature", sign + value, "°C" if unit == "C" else "K"
            )
    if not found and (match := _AS_SYMBOL.search(text)):
        value = match[1].replace(",", ".")
        if abs(float(value)) < _KELVIN_FROM:  # from there on it may be in kelvin
            return Constant("temperature", value, "°C")
    return next(iter(found.values())) if len(found) == 1 else None
