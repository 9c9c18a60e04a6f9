"""Which column is what, and how its unit becomes SI."""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.names import NameTable, plain
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_clock, is_number
from discover.dataset.material_functions import COMPLIANCE, RELAXATION_MODULUS
from discover.dataset.tables import units
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import Quantity, read_heading, read_unit, tidy_unit
from discover.errors import InputError
from discover.words import listed

_QUANTITIES: dict[str, Quantity | str] = {
    "time": units.TIME, "shear_rate": units.SHEAR_RATE, "stress": units.SHEAR_STRESS,
    "strain": units.STRAIN, "N1": units.FIRST_NORMAL_STRESS_DIFFERENCE,
    "N2": units.SECOND_NORMAL_STRESS_DIFFERENCE, "psi1": "Pa*s^2", "psi2": "Pa*s^2",
    "torque": "N*m", "angular_velocity": "rad/s", "angle": "rad", "normal_force": "N",
    "omega": units.ANGULAR_FREQUENCY, "Gp": units.STORAGE_MODULUS, "Gpp": units.LOSS_MODULUS,
    "hencky_rate": units.HENCKY_RATE, "tensile_stress": units.TENSILE_STRESS,
    "hencky_strain": units.HENCKY_STRAIN, "extensional_viscosity": "Pa*s",
    "relaxation_modulus": RELAXATION_MODULUS, "compliance": COMPLIANCE, "viscosity": "Pa*s",
    "strain_amplitude": "", "stress_amplitude": "Pa", "complex_modulus": "Pa",
    "complex_viscosity": "Pa*s", "phase_angle": "rad", "loss_factor": "",
    "temperature": Quantity("temperature", "temperature_C", ""),
    "radius": "m", "diameter": "m", "gap": "m", "cone_angle": "rad", "strain_wave": "",
    "stress_wave": "Pa", "wave_time": "s", "point": "",
}  # fmt: skip
"""What a column may hold: a quantity of data folders, or the SI unit of one of exports alone."""


def _quantity(key: str, unit: str) -> Quantity:
    suffix = re.sub(r"[*/]", "_", unit).replace("^", "")
    return Quantity(key, "_".join(filter(None, (key, suffix))), unit)


QUANTITIES: dict[str, Quantity] = {
    key: _quantity(key, one) if isinstance(one, str) else one for key, one in _QUANTITIES.items()
}


def guess_columns(block: Block, given: Mapping[str, str], table: NameTable) -> dict[str, int]:
    """Return the place of each quantity among the columns of a block.

    Columns without a single number are passed over; a clock is a time only if no number is.

    `given`: names of columns that the user gave; they win over guesses. Raises InputError if a name
    that was given stands above two columns.
    """
    count = range(len(block.columns))
    numbers = [any(is_number(row[i]) for row in block.cells) for i in count]
    clocks = [not numbers[i] and any(is_clock(row[i]) for row in block.cells) for i in count]
    found: dict[str, int] = {}
    for key in QUANTITIES:
        if key in given:
            at = [i for i in count if block.columns[i][0] == given[key]]
            at = at or [i for i in count if plain(block.columns[i][0]) == plain(given[key])]
            if len(at) > 1:
                raise InputError(
                    f"Two columns are named {given[key]!r} (block at line {block.line}). Rename "
                    "one in the file."
                )
        else:
            ranks = {i: name_rank(key, *block.columns[i], table) for i in count}
            places = {i: rank for i, rank in ranks.items() if rank is not None}
            at = sorted(places, key=places.__getitem__)
        at = [i for i in at if numbers[i]] + [i for i in at if clocks[i] and key == "time"]
        if at:
            found[key] = at[0]
    return found


def name_rank(key: str, name: str, unit: str, table: NameTable) -> int | None:
    """Return how good a column is for a quantity, 0 the best; None if it is not called so."""
    rank = table.rank(key, name)
    if rank is not None:
        return rank if fits(key, name, unit) else None
    if name == QUANTITIES[key].column:
        return 0
    inside = None if unit else _split(key, name, table)
    return None if inside is None else inside[0]


def unit_in_name(key: str, name: str, table: NameTable) -> str:
    """Return the unit at the end of a column's name, as in ``stress_kPa`` or ``τ/Pa``; or empty.

    It has to be a unit of the quantity, and what stands before it a name of that.
    """
    inside = _split(key, name, table)
    return "" if inside is None else inside[1]


def _split(key: str, name: str, table: NameTable) -> tuple[int, str] | None:
    """Return the rank of a name that ends in a unit, and that unit."""
    for mark in re.finditer(r"[\s_/,;]+", name):
        head, tail = name[: mark.start()], name[mark.end() :]
        rank = 0 if head == QUANTITIES[key].stem else table.rank(key, head)
        if rank is None or not re.search(r"[^\W\d_]|%", tail):
            continue
        # this project's own 1_s and rad_s, and Pa_s
        below = tail.replace("_", "/") if read_heading(tail) is not None else tail
        for text in (below, tail.replace("_", "*")):
            if _is_unit_of(key, text):
                return rank, text
    return None


def _is_unit_of(key: str, unit: str) -> bool:
    if key == "temperature":
        return to_celsius(0.0, unit) is not None
    known = read_unit(unit)
    return known is not None and units.factor_to(known, QUANTITIES[key]) is not None


def fits(key: str, name: str, unit: str) -> bool:
    """Return whether a short name, which may mean several things, has a unit of the quantity.

    `name`, `unit`: of the column; a longer name fits whatever its unit is, so that a wrong one is
    said.
    """
    if name.strip() == "T" and not unit:
        return key == "temperature"
    name = plain(name)
    if len(name) > _SHORT or any(letter > "\u2e80" for letter in name):
        return True
    if key == "temperature":
        return to_celsius(0.0, unit) is not None
    if not unit or read_unit(unit) is None:
        # without a unit G' is a modulus, and t is a time; D and n may be anything
        return name in ("t", "w", "f", "j") or not (
            (name == "gp" and key == "shear_rate") or (len(name) == 1 and name.isascii())
        )
    return _is_unit_of(key, unit)


_SHORT = 3
"""Letters of a name that says too little without its unit."""


def to_celsius(value: float, unit: str) -> float | None:
    """Return a temperature in °C, or None if the unit is none of temperature."""
    scale = tidy_unit(unit).replace("º", "°").replace("°", "").removeprefix("deg").strip()
    scale = scale.upper().translate({0x421: "C", 0x41A: "K"})  # as a Russian keyboard writes them
    if scale in ("", "-", "1") and "°" not in unit and "deg" not in unit:
        return None if not unit else value  # a program's table says a pure number
    if scale in ("C", "CELSIUS"):
        return value
    if scale in ("K", "KELVIN"):
        return value - 273.15
    if scale in ("F", "FAHRENHEIT"):
        return (value - 32.0) / 1.8
    return None


def factor_to_si(key: str, unit: str, column: str, name: str) -> float:
    """Return the factor from a column's unit to SI.

    `unit`: their unit as the export or the user writes it. Raises InputError if the unit is unknown
    or a unit of something else.
    """
    quantity = QUANTITIES[key]
    if key == "angular_velocity" and tidy_unit(unit) in ("1/min", "min-1", "min^-1"):
        unit = "turn/min"
    if key.endswith("viscosity") and unit.lower() == "cps":  # centipoise, not counts
        unit = "cP"
    found = read_unit(unit)
    if found is None:
        raise InputError(
            f"{name}: the unit {shown(unit)!r} of {shown(column)} is not known. Give it in "
            f"another way, as in --unit {key}={quantity.unit or '%'}."
        )
    factor = units.factor_to(found, quantity)
    if factor is None:
        raise InputError(
            f"{name}: {shown(column)} is in {shown(unit)}, which is no unit of {key}. Name "
            f"another column for {key}, or correct the unit with --unit {key}=…."
        )
    return factor


# They are told by its numbers, taken as SI where nothing else is usual, or asked for, all at once.

Values = Float[np.ndarray, " n"]
Get = Callable[[str], Values | None]

_CHOICES = {
    "strain": ("%", "1"),
    "strain_amplitude": ("%", "1"),
    "strain_wave": ("%", "1"),
    "omega": ("Hz", "rad/s"),
    "phase_angle": ("deg", "rad"),
    "viscosity": ("mPa*s", "Pa*s"),
    "complex_viscosity": ("mPa*s", "Pa*s"),
    "torque": ("mN*m", "N*m"),
    "angular_velocity": ("1/min", "rad/s"),
    "angle": ("deg", "rad"),
    "radius": ("mm", "m"),
    "diameter": ("mm", "m"),
    "gap": ("mm", "m"),
    "cone_angle": ("deg", "rad"),
}
"""Units of which either is usual; the last is that of SI."""

_SHARE = 0.05
"""Error of a ratio of columns up to which it is that of two units: they differ by 6 at least."""


@dataclass(frozen=True)
class UnsaidUnit:
    """A unit in which a column is read although the file does not give it.

    `how`: told by the numbers, assumed, or to be asked for: until then `unit` stands in for it.
    `why`: what tells it.
    """

    column: str
    unit: str
    how: Literal["told", "assumed", "asked"]
    why: str = ""


def unsaid_unit(key: str, column: str, raw: Values, get: Get, table: NameTable) -> UnsaidUnit:
    """Return the unit of a column without one.

    `get`: gives other columns of the block in SI units, None where it has no such column. `table`:
    what quantities are called: an angular frequency is one in rad/s, a frequency may count.
    """
    choices = _CHOICES.get(key)
    if key == "omega" and "frequency" not in table.find(column):
        choices = None
    if choices is None:
        return UnsaidUnit(column, QUANTITIES[key].unit or "1", "assumed")
    told = _told(key, raw, get)
    if told is not None:
        return UnsaidUnit(column, told[0], "told", told[1])
    return UnsaidUnit(column, choices[-1], "asked")


def _told(key: str, raw: Values, get: Get) -> tuple[str, str] | None:
    """Return the unit that other columns leave as the only one, and how they do."""
    if key == "phase_angle":
        # between 0 and a right angle, with some noise beyond
        far = bool(np.nanmax(np.abs(raw)) > 1.05 * np.pi / 2.0) if np.isfinite(raw).any() else False
        return ("deg", "no angle of loss is that many radians") if far else None
    size = _modulus(get)
    if key == "omega":
        viscosity = get("complex_viscosity")
        if size is None or viscosity is None:
            return None
        factors = {"rad/s": 1.0, "Hz": 2.0 * np.pi}
        return _of_ratio(size / viscosity, raw, factors, "|G*| is |η*| times it")
    if not key.startswith("strain"):
        return None
    factors = {"1": 1.0, "%": 0.01}
    stress = next((get(k) for k in ("stress_amplitude", "stress") if get(k) is not None), None)
    time, rate = get("time"), get("shear_rate")
    ways = []
    if stress is not None and size is not None:
        ways.append((stress / size, "the stress is |G*| times it"))
    if stress is not None and (modulus := get("relaxation_modulus")) is not None:
        ways.append((stress / modulus, "the stress is G(t) times it"))
    if stress is not None and (compliance := get("compliance")) is not None:
        ways.append((stress * compliance, "it is J(t) times the stress"))
    for made, why in ways:
        told = _of_ratio(made, raw, factors, why)
        if told is not None:
            return told
    if time is not None and rate is not None and len(time) > 2:
        steps = 0.5 * (rate[1:] + rate[:-1]) * np.diff(time)
        return _of_ratio(steps, np.diff(raw), factors, "it grows as the rate says")
    return None


def _modulus(get: Get) -> Values | None:
    size, storage, loss = get("complex_modulus"), get("Gp"), get("Gpp")
    if size is None and storage is not None and loss is not None:
        size = np.hypot(storage, loss)
    return size


def _of_ratio(made: Values, raw: Values, factors: dict[str, float], why: str):
    """Return the unit whose factor turns a column into what others make of it, in most rows."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = made / raw
    ratio = ratio[np.isfinite(ratio)]
    if len(ratio) < 3:
        return None
    # the middle alone is taken: a start, a rest and noise leave single rows far off
    middle = np.percentile(ratio, [30.0, 50.0, 70.0])
    for unit, factor in factors.items():
        if np.all(np.abs(middle / factor - 1.0) < _SHARE):
            return unit, why
    return None


@dataclass
class UnsaidUnits:
    """Units of all files of an import that none of them gives."""

    found: dict[tuple[str, str], tuple[str, UnsaidUnit]] = field(default_factory=dict)

    def add(self, file: str, units: Iterable[tuple[str, UnsaidUnit]]) -> None:
        """Add the units of a test that is imported, by quantity."""
        for key, unit in units:
            self.found.setdefault((key, unit.column), (file, unit))

    def require(self) -> None:
        """Raise InputError if there are units that only the user knows; asks for all of them."""
        asked = {key: one for (key, _), (_, one) in self.found.items() if one.how == "asked"}
        if not asked:
            return
        files = dict.fromkeys(file for file, one in self.found.values() if one.how == "asked")
        options = "; ".join(
            f"{shown(one.column)}: " + " or ".join(f"--unit {key}={u}" for u in _CHOICES[key])
            for key, one in asked.items()
        )
        what = "a unit" if len(asked) == 1 else "the units"
        names = listed([shown(one.column) for one in asked.values()])
        raise InputError(
            f"{listed(list(files))} does not give {what} of {names}, and the numbers do not tell. "
            f"Say which: {options}."
        )

    def warning(self) -> list[str]:
        """Return the sentence on what is taken as SI, if anything is."""
        assumed = [(key, one) for (key, _), (_, one) in self.found.items() if one.how == "assumed"]
        assumed = [(key, one) for key, one in assumed if QUANTITIES[key].unit]
        if not assumed:
            return []
        files = dict.fromkeys(file for file, one in self.found.values() if one.how == "assumed")
        read = listed([f"{shown(one.column)} in {one.unit}" for _, one in assumed])
        key, one = assumed[-1]
        other = {"s": "min", "1/s": "1/min", "rad/s": "Hz"}.get(one.unit, f"m{one.unit}")
        return [
            f"warning: {listed(list(files))} gives no units here, so SI is taken: {read}. If one "
            f"is another, say so, as in --unit {key}={other}."
        ]
