"""Units: in column names such as ``stress_kPa``, and as instruments and users write them."""

import math
import re
import tomllib
import unicodedata
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import NamedTuple

from discover.errors import InputError

# Text from a file is never calculated: a unit is a product of words with small exponents, and the
# only number in it that is no exponent is the 1 of ``1/s``. So ``10Pa`` and ``Pa_2`` are no units,
# and ``9**9**9`` is not worked out. What a single word means is asked of pint.

_LONGEST = 40  # characters

ABSOLUTE_ZERO = -273.15
"""In °C: no temperature is lower."""


@cache
def _spellings() -> dict[str, str]:
    """Return what pint does not know under this name: the unit of each word of ``units.toml``."""
    content = tomllib.loads((files("discover.dataset.tables") / "units.toml").read_text("utf-8"))
    return {word: unit for unit, words in content.items() for word in words}


# products that are written without a sign: mNm, Pas. A millisecond is no such thing: ms
_JOINED = re.compile(r"\b([mkMGuµ]?(?:N|Pa))(m|s)\b")
_NUMBERS_PER_MINUTE = re.compile(r"\b(U|tr|rev|r|obr|ot|giri|omw)\.?/min\b")
_DIMENSIONS = ("[mass]", "[length]", "[time]")
_POWER = r"((?:[^\W\d_]|[°%])+)(?:\^?(-?[1-9]))?(?![\d^-])"  # a word with its exponent
# units without a dimension
_NUMBERS = ("radian", "degree", "turn", "percent", "ppm")


class Unit(NamedTuple):
    """A unit as its factor to SI and its dimension."""

    factor: float = 1.0
    dimension: tuple[int, int, int] = (0, 0, 0)  # exponents of kg, m and s; angles have none
    cycles: bool = False  # it counts them, as Hz does: 2π rad/s where an angle is meant


def read_heading(suffix: str) -> Unit | None:
    """Return the unit that ends a column's name, ``dyn_cm2`` being dyn/cm²; None if none."""
    words = suffix.split("_")
    plain = all(re.fullmatch(_POWER, word) for word in words[words[0] == "1" :])
    known = plain and suffix != "1" and len(suffix) <= _LONGEST
    return _product("/".join(words)) if known else None


@cache
def read_unit(text: str) -> Unit | None:
    """Return a unit as exports write it (``cm2``, ``s^-1``, ``Pa·s``), or None if it is none."""
    text = tidy_unit(text)
    if text in ("", "-", "--", "1"):
        return Unit()
    text = _JOINED.sub(r"\1*\2", _NUMBERS_PER_MINUTE.sub("turn/min", text))
    text = re.sub(r"[. ]+", "*", re.sub(r" *([/*()]) *", r"\1", text))
    text = re.sub(r"(?<=[^(/*])\(", "*(", f"1{text}" if text.startswith("/") else text)
    if len(text) > _LONGEST or not re.fullmatch(rf"(?:{_POWER}|1(?=[/*])|/(?!/)|[()*])+", text):
        return None
    return _product(text)


def tidy_unit(text: str) -> str:
    """Return a unit in plain signs, whatever its width, raised digits, minus signs and dots."""
    text = unicodedata.normalize("NFKC", text[: 4 * _LONGEST]).translate(_SIGNS).strip("$ ")
    text = re.sub(r"\^[({](-?[0-9])[)}]", r"^\1", text.replace("**", "^").replace("\\", ""))
    # Pa-s is a product, and s-1 a power
    return re.sub(r"(?<=[^\W\d_])-(?=[^\W\d_])", "*", text)


_SIGNS = str.maketrans({**dict.fromkeys("·⋅•∙・×", "*"), **dict.fromkeys("−–—‐‑", "-"), "μ": "µ"})
_OPENING = {")": "(", "]": "[", "}": "{", ">": "<"}
_AT_END = [
    re.compile(rf"(.*?)\{a}((?:[^\{a}\{b}]|\{a}[^\{a}\{b}]*\{b})*)\{b}")
    for b, a in _OPENING.items()
]  # of any kind, one more of which may stand inside
_BRACKETS = str.maketrans("（）［］｛｝＜＞【】〔〕〈〉", "()[]{}<>[][]<>")
_IN = re.compile(r"(.*\S)\s+(?:in|en|em)\s+(\S.*)")
# what stands in brackets and is no unit: Time (action), G(t), tan(delta)
_WORDS = re.compile(r"[^\W\d_]{3,}|[tωδγ]|[a-z ]{4,}")


def name_and_unit(name: str, unit: str) -> tuple[str, str]:
    """Return a name and its unit, which was given, stands in brackets, or after in: t in s."""
    name, unit = name.translate(_BRACKETS), unit.translate(_BRACKETS).strip()
    if unit and _OPENING.get(unit[-1]) == unit[0]:
        unit = unit[1:-1].strip()
    if unit:
        return name, unit
    head, inside = _last_bracket(name)
    if head and (_is_unit(inside) or not _WORDS.fullmatch(inside)):
        return head, inside
    words = _IN.fullmatch(name)
    if words and _is_unit(words[2]):
        return words[1], words[2]
    return name, ""


def _last_bracket(name: str) -> tuple[str, str]:
    """Return what stands before the bracket in which a name ends, and in it; both may be empty."""
    found = next(filter(None, (one.fullmatch(name.rstrip()) for one in _AT_END)), None)
    # G(t) is a function, and Time (t) in tons
    if found is None or found[2].strip() == "t":
        return "", ""
    return found[1].rstrip(" /,"), found[2].strip()


def _is_unit(text: str) -> bool:
    return read_unit(text) is not None or tidy_unit(text).lstrip("°") in ("C", "K", "F")


@cache
def _name(word: str) -> str:
    """Return pint's name of a single word, such as kPa or seconds; ``?`` if it is no unit."""
    word, parse = _spellings().get(word, word), _registry().parse_unit_name
    # whole words may begin with a capital; of short symbols the case has a meaning
    for name in (word, word.lower()) if len(word) > 2 else (word,):
        parsed, symbol = parse(name), name.removesuffix("s")
        # a symbol with an s, as Pas, is no plural of Pa
        plural = len(name) <= 4 and symbol != name and parsed[:1] == parse(symbol)[:1]
        if not parsed or plural:
            continue
        unit = parsed[0][0] + parsed[0][1]
        # pint counts constants such as pi among units without a dimension
        if unit.endswith(_NUMBERS) or not _registry().Unit(unit).dimensionless:
            return unit
    return "?"


def _product(text: str) -> Unit | None:
    """Return the unit of words with ``*``, ``/`` and brackets; None if none of kg, m and s."""
    text = re.sub(_POWER, lambda m: f"{_name(m[1])}**{m[2] or 1}", text)
    if "?" in text:
        return None
    try:
        unit = _registry().parse_units(text)
    except Exception:  # each wrong order of signs fails in its own way
        return None
    size = _registry().Quantity(1.0, unit).to_base_units()
    found = dict(size.dimensionality)
    if not set(found) <= set(_DIMENSIONS):
        return None
    kg, m, s = (round(float(str(found.get(key, 0)))) for key in _DIMENSIONS)
    return Unit(float(size.magnitude), (kg, m, s), "hertz" in text)


@cache
def _registry():
    # pint takes a noticeable time to load; files in SI units never need it
    import pint

    return pint.UnitRegistry()


class Quantity(NamedTuple):
    """A column that the software knows."""

    stem: str  # beginning of its name, before the unit
    column: str  # its name in SI units
    unit: str  # that unit; empty for a pure number


TIME = Quantity("time", "time_s", "s")
SHEAR_RATE = Quantity("shear_rate", "shear_rate_1_s", "1/s")
SHEAR_STRESS = Quantity("stress", "stress_Pa", "Pa")
FIRST_NORMAL_STRESS_DIFFERENCE = Quantity("N1", "N1_Pa", "Pa")
SECOND_NORMAL_STRESS_DIFFERENCE = Quantity("N2", "N2_Pa", "Pa")
NORMAL_STRESS_DIFFERENCES = FIRST_NORMAL_STRESS_DIFFERENCE, SECOND_NORMAL_STRESS_DIFFERENCE
STRAIN = Quantity("strain", "strain", "")
HENCKY_RATE = Quantity("hencky_rate", "hencky_rate_1_s", "1/s")
TENSILE_STRESS = Quantity("tensile_stress", "tensile_stress_Pa", "Pa")
HENCKY_STRAIN = Quantity("hencky_strain", "hencky_strain", "")
ANGULAR_FREQUENCY = Quantity("omega", "omega_rad_s", "rad/s")
STORAGE_MODULUS = Quantity("Gp", "Gp_Pa", "Pa")
LOSS_MODULUS = Quantity("Gpp", "Gpp_Pa", "Pa")


def factor_to(unit: Unit, quantity: Quantity) -> float | None:
    """Return the factor from a unit to the SI unit of a quantity, or None if it is another's."""
    wanted = read_unit(quantity.unit)
    if wanted is None or wanted.dimension != unit.dimension:
        return None
    cycles = 2.0 * math.pi if unit.cycles and "rad" in quantity.unit else 1.0
    return cycles * unit.factor / wanted.factor


def heading_factor(column: str, quantity: Quantity) -> float:
    """Factor to SI by the longest ending that is a unit, 1 without; InputError if another's."""
    words, own = column.split("_"), quantity.column.removeprefix(f"{quantity.stem}_")
    for stem in ("_".join(words[:i]) for i in range(1, len(words))):
        found = find_column([column], Quantity(stem, f"{stem}_{own}", quantity.unit))
        if found is not None:
            return found[1]
    return 1.0


def conversion_note(column: str, factor: float, quantity: Quantity) -> str:
    """Say in words how a column becomes SI; empty if it is in SI units already."""
    stem, unit = quantity.stem, quantity.unit
    if factor != 1.0:
        return f"{column} is read as {stem}, times {factor:.6g}" + (f" to {unit}" if unit else "")
    if "rad" not in unit or "rad" in column:
        return ""
    return f"{column} is read as {stem} in {unit}; if it counts cycles, name it {stem}_Hz"


def find_column(names: Sequence[str], quantity: Quantity) -> tuple[str, float] | None:
    """Column of a quantity and its factor to SI, or None; InputError on two, or a wrong unit."""
    found = [(name, 1.0) for name in names if name == quantity.column]
    for name in names:
        suffix = name.removeprefix(f"{quantity.stem}_")
        unit = None if name in (suffix, quantity.column) else read_heading(suffix)
        if unit is None:
            continue
        factor = factor_to(unit, quantity)
        if factor is None:
            raise InputError(
                f"The column {name} has the unit {suffix.replace('_', '/')}, which is not a "
                f"unit of {quantity.stem}. Name the column {quantity.column}, or give another "
                f"unit of {quantity.unit or 'a pure number'} after the underscore."
            )
        found.append((name, factor))
    if len(found) > 1:
        first, second = sorted((name for name, _ in found[:2]), key=list(names).index)
        raise InputError(f"Both {first} and {second} hold {quantity.stem}. Keep one of them.")
    return found[0] if found else None
