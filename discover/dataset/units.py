"""Units in column names: ``stress_kPa`` is read as stress and converted to Pa."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from discover.errors import InputError


@dataclass(frozen=True)
class Quantity:
    """A column that the software knows.

    Attributes
    ----------
    stem
        Beginning of the column's name, before the unit.
    column
        Name of the column in SI units.
    unit
        That unit, as pint writes it; empty for a pure number.
    """

    stem: str
    column: str
    unit: str


TIME = Quantity("time", "time_s", "second")
SHEAR_RATE = Quantity("shear_rate", "shear_rate_1_s", "1/second")
SHEAR_STRESS = Quantity("stress", "stress_Pa", "pascal")
FIRST_NORMAL_STRESS_DIFFERENCE = Quantity("N1", "N1_Pa", "pascal")
SECOND_NORMAL_STRESS_DIFFERENCE = Quantity("N2", "N2_Pa", "pascal")
STRAIN = Quantity("strain", "strain", "")
ANGULAR_FREQUENCY = Quantity("omega", "omega_rad_s", "radian/second")
STORAGE_MODULUS = Quantity("Gp", "Gp_Pa", "pascal")
LOSS_MODULUS = Quantity("Gpp", "Gpp_Pa", "pascal")


@cache
def _registry():
    # pint takes a noticeable time to load; files in SI units never need it
    import pint

    return pint.UnitRegistry()


@cache
def conversion_factor(suffix: str, quantity: Quantity) -> float | None:
    """Return the factor from the unit of a column's suffix to SI, or None if it is no unit.

    Parameters
    ----------
    suffix
        What follows the stem in the column's name, such as ``kPa``, ``1_min``, ``rad_s``,
        ``dyn_cm2`` or ``percent``.
    quantity
        What the column holds.

    Raises
    ------
    InputError
        If the suffix is a unit of something else.
    """
    if not re.fullmatch(r"[A-Za-z0-9_]{1,30}", suffix):
        return None
    words = [re.sub(r"(?<=[A-Za-z])(\d)$", r"**\1", word) for word in suffix.split("_") if word]
    registry = _registry()
    try:
        unit = registry.parse_expression("/".join(words))
        unit = registry.Quantity(unit)
    except Exception:  # pint raises many kinds for a word that is no unit
        return None
    # pint counts a cycle and a radian alike as one; a rheologist's Hz is 2π rad/s
    cycles = 2.0 * math.pi if quantity is ANGULAR_FREQUENCY and "hertz" in str(unit) else 1.0
    try:
        return cycles * float(unit.to(quantity.unit).magnitude)
    except Exception as error:
        raise InputError(
            f"The column {quantity.stem}_{suffix} has the unit {unit.units:~}, which is not a unit "
            f"of {quantity.stem}. Name the column {quantity.column}, or give another unit of "
            f"{quantity.unit or 'a pure number'} after the underscore."
        ) from error


def find_column(names: Sequence[str], quantity: Quantity) -> tuple[str, float] | None:
    """Return the column that holds a quantity and its factor to SI, or None if there is none.

    Parameters
    ----------
    names
        Columns of the file.
    quantity
        What is looked for.

    Raises
    ------
    InputError
        If two columns hold it, or its unit is wrong.
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
