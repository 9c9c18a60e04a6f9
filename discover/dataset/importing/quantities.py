"""Which column is what, and how its unit becomes SI: said, assumed, or asked for."""

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

from discover.dataset.importing.names import plain, rank_of, tables_of
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_clock
from discover.dataset.material_functions import COMPLIANCE, RELAXATION_MODULUS
from discover.dataset.tables import units
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import Quantity
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


def _quantity(key: str, given: Quantity | str) -> Quantity:
    if isinstance(given, Quantity):
        return given
    suffix = re.sub(r"[*/]", "_", given).replace("^", "")
    return Quantity(key, "_".join(filter(None, (key, suffix))), given)


QUANTITIES = {key: _quantity(key, one) for key, one in _QUANTITIES.items()}
"""What a column may hold: quantities of data folders, and in SI units those of exports alone."""

SAME_TEMPERATURE = 1.5  # °C up to which two temperatures are one
_SHORT = 3  # letters of a name that says too little without its unit


def guess_columns(block: Block, given: Mapping[str, str]) -> dict[str, int]:
    """Return the place of each quantity, `given` names first: they win.

    Of several columns of one name the first counts that would be read without it. Raises InputError
    if none of several would.
    """
    names = [name for name, _ in block.columns]
    found: dict[str, int] = {}
    for key in QUANTITIES:
        ranks = {i: name_rank(key, *column) for i, column in enumerate(block.columns)}
        places = {i: rank for i, rank in ranks.items() if rank is not None}
        at = sorted(places, key=places.__getitem__)
        if key in given:
            own = [i for i, name in enumerate(names) if name == given[key]]
            own = own or [i for i, name in enumerate(names) if plain(name) == plain(given[key])]
            at = [i for i in at if i in own] if len(own) > 1 else own
            if own and not at:
                raise InputError(
                    f"Two columns are named {given[key]!r} (block at line {block.line}). Rename "
                    "one in the file."
                )
        numbers = [i for i in at if i in block.filled]
        if key == "time" and not numbers:
            numbers = [i for i in at if any(is_clock(row[i]) for row in block.cells)]
        if numbers:
            found[key] = numbers[0]
    return found


def name_rank(key: str, name: str, unit: str) -> int | None:
    """Return how good a column is for a quantity, 0 the best; None if it is not called so."""
    rank = rank_of(key, name)
    if rank is not None:
        return rank if fits(key, name, unit) else None
    if name == QUANTITIES[key].column:
        return 0
    inside = None if unit else split_name(key, name)
    return None if inside is None else inside[0]


def split_name(key: str, name: str) -> tuple[int, str] | None:
    """Return the rank of a name that ends in a unit of the quantity, and it: ``stress_kPa``."""
    for mark in re.finditer(r"[\s_/,;]+", name):
        head, tail = name[: mark.start()], name[mark.end() :]
        rank = 0 if head == QUANTITIES[key].stem else rank_of(key, head)
        if rank is None or not re.search(r"[^\W\d_]|%", tail):
            continue
        # this project's own 1_s and rad_s, and Pa_s
        below = tail.replace("_", "/") if units.read_heading(tail) is not None else tail
        for text in (below, tail.replace("_", "*")):
            if _is_unit_of(key, text):
                return rank, text
    return None


def _is_unit_of(key: str, unit: str) -> bool:
    if key == "temperature":
        return to_celsius(0.0, unit) is not None
    known = units.read_unit(unit)
    return known is not None and units.factor_to(known, QUANTITIES[key]) is not None


def fits(key: str, name: str, unit: str) -> bool:
    """Whether a short name has a unit of the quantity; a longer one fits: a wrong unit is said."""
    if name.strip() == "T" and not unit:
        return key == "temperature"
    name = plain(name)
    if len(name) > _SHORT or any(letter > "\u2e80" for letter in name):
        return True
    if key != "temperature" and (not unit or units.read_unit(unit) is None):
        # without a unit G' is a modulus, and t is a time; D and n may be anything
        unsure = (name == "gp" and key == "shear_rate") or (len(name) == 1 and name.isascii())
        return name in ("t", "w", "f", "j") or not unsure
    return _is_unit_of(key, unit)


def to_celsius(value: Any, unit: str) -> Any:
    """Return a temperature, or an array of them, in °C; None if the unit is none of temperature."""
    scale = units.tidy_unit(unit).replace("º", "°").replace("°", "").removeprefix("deg").strip()
    scale = scale.upper().translate({0x421: "C", 0x41A: "K"})  # as a Russian keyboard writes them
    if scale in ("", "-", "1") and "°" not in unit and "deg" not in unit:
        return None if not unit else value  # a program's table says a pure number
    if scale in ("C", "CELSIUS"):
        return value
    if scale in ("K", "KELVIN"):
        return value + units.ABSOLUTE_ZERO
    return (value - 32.0) / 1.8 if scale in ("F", "FAHRENHEIT") else None


def factor_to_si(key: str, unit: str, column: str, name: str) -> float:
    """Factor to SI of a unit as it was written; InputError where it is no unit of the quantity."""
    quantity = QUANTITIES[key]
    if key == "angular_velocity" and units.tidy_unit(unit) in ("1/min", "min-1", "min^-1"):
        unit = "turn/min"
    if key.endswith("viscosity") and unit.lower() == "cps":  # centipoise, not counts
        unit = "cP"
    found = units.read_unit(unit)
    if found is None:
        raise InputError(
            f"{name}: the unit {shown(unit)!r} of {shown(column)} is not known. Give it in "
            f"another way, as in --unit {key}={quantity.unit or '%'}."
        )
    factor = units.factor_to(found, quantity)
    if factor is None:
        raise InputError(
            f"{name}: {shown(column)} is in {shown(unit)}, which is not a unit of {key}. Name "
            f"another column for {key}, or correct the unit with --unit {key}=…."
        )
    return factor


# units of which either is usual; the last is that of SI
_CHOICES = {
    **dict.fromkeys(("strain", "strain_amplitude", "strain_wave"), ("%", "1")),
    **dict.fromkeys(("phase_angle", "angle", "cone_angle"), ("deg", "rad")),
    **dict.fromkeys(("viscosity", "complex_viscosity"), ("mPa*s", "Pa*s")),
    **dict.fromkeys(("radius", "diameter", "gap"), ("mm", "m")),
    "omega": ("Hz", "rad/s"), "torque": ("mN*m", "N*m"), "angular_velocity": ("1/min", "rad/s"),
}  # fmt: skip


class UnsaidUnit(NamedTuple):
    """A unit in which a column is read although the file does not give it."""

    column: str
    unit: str  # stands in for it until it is said
    asked: bool  # whether the user has to say it, as another is as usual


def unsaid_unit(key: str, column: str) -> UnsaidUnit:
    """Return the unit of a column without one."""
    choices = _CHOICES.get(key)
    if choices is None or (key == "omega" and "frequency" not in tables_of(column)):
        return UnsaidUnit(column, QUANTITIES[key].unit or "1", asked=False)
    return UnsaidUnit(column, choices[-1], asked=True)


UnsaidUnits = dict[tuple[str, str], tuple[str, UnsaidUnit]]
"""The first file that does not give the unit, by quantity and column."""


def require_units(found: UnsaidUnits) -> None:
    """Raise InputError if there are units that only the user knows; asks for all of them."""
    asked = {key: pair for (key, _), pair in found.items() if pair[1].asked}
    if asked:
        options = "; ".join(
            f"{shown(one.column)}: " + " or ".join(f"--unit {key}={u}" for u in _CHOICES[key])
            for key, (_, one) in asked.items()
        )
        files = listed(list(dict.fromkeys(file for file, _ in asked.values())))
        what = "a unit" if len(asked) == 1 else "the units"
        names = listed([shown(one.column) for _, one in asked.values()])
        raise InputError(f"{files} does not give {what} of {names}. Say which: {options}.")


def units_taken_as_si(found: UnsaidUnits) -> list[str]:
    """Return the sentence on what is taken as SI, if anything is."""
    assumed = [(*pair, key) for (key, _), pair in found.items() if not pair[1].asked]
    if not any(QUANTITIES[key].unit for *_, key in assumed):
        return []
    files = listed(list(dict.fromkeys(file for file, *_ in assumed)))
    with_units = [(one, key) for _, one, key in assumed if QUANTITIES[key].unit]
    read = listed([f"{shown(one.column)} in {one.unit}" for one, _ in with_units])
    one, key = with_units[-1]
    other = {"s": "min", "1/s": "1/min", "rad/s": "Hz"}.get(one.unit, f"m{one.unit}")
    return [
        f"warning: {files} gives no units here, so SI is taken: {read}. If one "
        f"is another, say so, as in --unit {key}={other}."
    ]
