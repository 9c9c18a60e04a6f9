"""Which column is what, and how its unit becomes SI."""

import re
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from discover.dataset import units
from discover.dataset.importing.text_export import Block
from discover.dataset.table import shown
from discover.dataset.units import Quantity
from discover.errors import InputError

QUANTITIES: dict[str, Quantity] = {
    "time": units.TIME,
    "shear_rate": units.SHEAR_RATE,
    "stress": units.SHEAR_STRESS,
    "strain": units.STRAIN,
    "N1": units.FIRST_NORMAL_STRESS_DIFFERENCE,
    "N2": units.SECOND_NORMAL_STRESS_DIFFERENCE,
    "torque": Quantity("torque", "torque_N_m", "newton*meter"),
    "angular_velocity": Quantity("angular_velocity", "angular_velocity_rad_s", "radian/second"),
    "angle": Quantity("angle", "angle_rad", "radian"),
    "normal_force": Quantity("normal_force", "normal_force_N", "newton"),
    "omega": units.ANGULAR_FREQUENCY,
    "Gp": units.STORAGE_MODULUS,
    "Gpp": units.LOSS_MODULUS,
}

# Names that exports give, the best first: a step's own clock before that of the whole test
_NAMES: dict[str, tuple[str, ...]] = {
    "time": ("step time", "interval time", "time", "t", "test time"),
    "shear_rate": ("shear rate", "rate", "gammadot"),
    "stress": ("shear stress", "stress", "tau", "sigma"),
    "strain": ("shear strain", "strain", "gamma"),
    "N1": ("n1", "first normal stress difference", "1st normal stress difference",
           "normal stress difference"),
    "N2": ("n2", "second normal stress difference"),
    "torque": ("torque",),
    "angular_velocity": ("angular velocity", "velocity", "rotational speed", "speed"),
    "angle": ("displacement", "angular displacement", "deflection angle", "rotation angle"),
    "normal_force": ("normal force", "axial force"),
    "omega": ("angular frequency", "omega", "frequency"),
    "Gp": ("storage modulus", "g'", "gp"),
    "Gpp": ("loss modulus", "g''", 'g"', "gpp"),
}  # fmt: skip

_SWEEP = ("omega", "Gp", "Gpp")


def guess_columns(block: Block, given: Mapping[str, str], sweep: bool) -> dict[str, int]:
    """Return the place of each quantity among the columns of a block.

    Parameters
    ----------
    block
        The block.
    given
        Names of columns that the user gave; they win over guesses.
    sweep
        Whether a linear sweep is wanted, or a run.

    Raises
    ------
    InputError
        If a name that was given stands above two columns.
    """
    names = [name for name, _ in block.columns]
    plain = [_plain(name) for name in names]
    found: dict[str, int] = {}
    for key in QUANTITIES:
        if (key in _SWEEP) is not sweep:
            continue
        if key in given:
            at = [i for i, name in enumerate(names) if name == given[key]]
            at = at or [i for i, name in enumerate(plain) if name == _plain(given[key])]
            if len(at) > 1:
                raise InputError(
                    f"Two columns are named {given[key]!r} (block at line {block.line}). Rename "
                    "one in the file."
                )
            if at:
                found[key] = at[0]
            continue
        for wanted in (*_NAMES[key], _plain(QUANTITIES[key].column)):
            if wanted in plain:
                found[key] = plain.index(wanted)
                break
    return found


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name).strip(" :").lower()


def to_si(
    values: Float[np.ndarray, " n"], key: str, unit: str, column: str, name: str
) -> Float[np.ndarray, " n"]:
    """Return values in SI units.

    Parameters
    ----------
    values
        As in the file.
    key
        What they are, from `QUANTITIES`.
    unit
        Their unit as the export or the user writes it; empty if unknown. A column of this
        project's own, such as ``stress_kPa``, carries it in its name.
    column, name
        Column and file, for messages.

    Raises
    ------
    InputError
        If the unit is unknown or a unit of something else.
    """
    quantity = QUANTITIES[key]
    if not unit:
        own = units.find_column([column], quantity)
        if own is not None:
            return values * own[1]
        if not quantity.unit:
            return values
        raise InputError(
            f"{name} gives no unit for {shown(column)}. Give it, as in --unit {key}="
            f"{quantity.column.removeprefix(quantity.stem + '_').replace('_', '/')}."
        )
    registry = units._registry()
    text = _pint_spelling(unit)
    try:
        if not re.fullmatch(r"[\w*/%.()µμΩ°^ -]{1,40}", text):
            raise ValueError(unit)
        parsed = registry.Quantity(1.0, registry.parse_units(text))
    except Exception as error:  # pint raises many kinds for what is no unit
        raise InputError(
            f"{name}: the unit {shown(unit)!r} of {shown(column)} is not known. Give it in "
            f"another way, as in --unit {key}={quantity.unit or '%'}."
        ) from error
    # pint counts a cycle and a radian alike as one
    cycles = 2.0 * np.pi if key in ("omega", "angular_velocity") and "hertz" in str(parsed) else 1.0
    try:
        factor = parsed.to(quantity.unit).magnitude
    except Exception as error:
        raise InputError(
            f"{name}: {shown(column)} is in {shown(unit)}, which is no unit of {key}. Name "
            f"another column for {key}, or correct the unit with --unit {key}=…."
        ) from error
    return values * (cycles * float(factor))


def _pint_spelling(unit: str) -> str:
    text = unit.strip()
    if text in ("", "-", "1", "—"):
        return "dimensionless"
    for mark, plain in (("·", "*"), ("⋅", "*"), ("⁻¹", "**-1"), ("²", "**2"), ("³", "**3"),
                        ("%", "percent"), ("°C", "degC"), ("°", "degree"), ("μ", "µ")):  # fmt: skip
        text = text.replace(mark, plain)
    text = re.sub(r"(?<=[A-Za-z])\.(?=[A-Za-z])", "*", text)  # N.m
    return re.sub(r"(?<=[A-Za-z])(-?\d)", r"**\1", text)  # cm2, s-1
