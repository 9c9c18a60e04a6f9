"""Units in column names: ``stress_kPa`` is read as stress and converted to Pa."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from discover.dataset.tables.unit_text import Unit, read_heading, read_unit
from discover.errors import InputError


@dataclass(frozen=True)
class Quantity:
    """A column that the software knows.

    `stem`: beginning of the column's name, before the unit.
    `column`: name of the column in SI units.
    `unit`: that unit; empty for a pure number.
    """

    stem: str
    column: str
    unit: str


TIME = Quantity("time", "time_s", "s")
SHEAR_RATE = Quantity("shear_rate", "shear_rate_1_s", "1/s")
SHEAR_STRESS = Quantity("stress", "stress_Pa", "Pa")
FIRST_NORMAL_STRESS_DIFFERENCE = Quantity("N1", "N1_Pa", "Pa")
SECOND_NORMAL_STRESS_DIFFERENCE = Quantity("N2", "N2_Pa", "Pa")
STRAIN = Quantity("strain", "strain", "")
HENCKY_RATE = Quantity("hencky_rate", "hencky_rate_1_s", "1/s")
TENSILE_STRESS = Quantity("tensile_stress", "tensile_stress_Pa", "Pa")
HENCKY_STRAIN = Quantity("hencky_strain", "hencky_strain", "")
ANGULAR_FREQUENCY = Quantity("omega", "omega_rad_s", "rad/s")
STORAGE_MODULUS = Quantity("Gp", "Gp_Pa", "Pa")
LOSS_MODULUS = Quantity("Gpp", "Gpp_Pa", "Pa")


def conversion_factor(suffix: str, quantity: Quantity) -> float | None:
    """Return the factor from the unit of a column's suffix to SI, or None if it is no unit.

    `suffix`: what follows the stem in the column's name, such as ``kPa``, ``1_min``, ``rad_s``,
    ``dyn_cm2`` or ``percent``. `quantity`: what the column holds. Raises InputError if the suffix
    is a unit of something else.
    """
    unit = read_heading(suffix)
    if unit is None:
        return None
    factor = factor_to(unit, quantity)
    if factor is None:
        raise InputError(
            f"The column {quantity.stem}_{suffix} has the unit {suffix.replace('_', '/')}, which "
            f"is not a unit of {quantity.stem}. Name the column {quantity.column}, or give another "
            f"unit of {quantity.unit or 'a pure number'} after the underscore."
        )
    return factor


def factor_to(unit: Unit, quantity: Quantity) -> float | None:
    """Return the factor from a unit to the SI unit of a quantity, or None if it is another's."""
    wanted = read_unit(quantity.unit)
    if wanted is None or wanted.dimension != unit.dimension:
        return None
    cycles = 2.0 * math.pi if unit.cycles and "rad" in quantity.unit else 1.0
    return cycles * unit.factor / wanted.factor


def heading_factor(column: str, quantity: Quantity) -> float:
    """Return the factor to SI of a column whose name is the user's; one where it names no unit.

    `column`: its name, such as ``rate_before_1_min``: the longest ending that is a unit counts.
    `quantity`: what it holds. Raises InputError if the name ends in a unit of something else.
    """
    words = column.split("_")
    endings = ["_".join(words[i:]) for i in range(1, len(words))]
    if quantity.column.removeprefix(f"{quantity.stem}_") in endings:
        return 1.0
    for ending in endings:
        unit = read_heading(ending)
        factor = None if unit is None else factor_to(unit, quantity)
        if factor is not None:
            return factor
        if unit is not None:
            raise InputError(
                f"The column {column} has the unit {ending.replace('_', '/')}, which is not a unit "
                f"of {quantity.stem}. End its name with one of {quantity.unit}, as in {column[:40]}"
                f"_{quantity.column.removeprefix(quantity.stem + '_')}."
            )
    return 1.0


def conversion_note(column: str, factor: float, quantity: Quantity) -> str:
    """Say in words how a column becomes SI; empty if it is in SI units already."""
    if factor == 1.0:
        if "rad" in quantity.unit and "rad" not in column:
            return (
                f"{column} is read as {quantity.stem} in {quantity.unit}; if it counts cycles, "
                f"name it {quantity.stem}_Hz"
            )
        return ""
    return f"{column} is read as {quantity.stem}, times {factor:.6g}" + (
        f" to {quantity.unit}" if quantity.unit else ""
    )


def find_column(names: Sequence[str], quantity: Quantity) -> tuple[str, float] | None:
    """Return the column that holds a quantity and its factor to SI, or None if there is none.

    Raises InputError if two columns hold it, or its unit is wrong.
    """
    found = []
    for name in names:
        if name == quantity.column:
            found.append((name, 1.0))
        elif name.startswith(quantity.stem + "_"):
            factor = conversion_factor(name[len(quantity.stem) + 1 :], quantity)
            if factor is not None:
                found.append((name, factor))
    if len(found) > 1:
        raise InputError(
            f"Both {found[0][0]} and {found[1][0]} hold {quantity.stem}. Keep one of them."
        )
    return found[0] if found else None
