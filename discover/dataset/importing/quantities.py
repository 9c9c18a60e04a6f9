"""Which column is what, and how its unit becomes SI."""

import re
from collections.abc import Mapping

from discover.dataset import units
from discover.dataset.importing.text_export import Block
from discover.dataset.table import shown
from discover.dataset.unit_text import read_unit
from discover.dataset.units import Quantity
from discover.errors import InputError

QUANTITIES: dict[str, Quantity] = {
    "time": units.TIME,
    "shear_rate": units.SHEAR_RATE,
    "stress": units.SHEAR_STRESS,
    "strain": units.STRAIN,
    "N1": units.FIRST_NORMAL_STRESS_DIFFERENCE,
    "N2": units.SECOND_NORMAL_STRESS_DIFFERENCE,
    "torque": Quantity("torque", "torque_N_m", "N*m"),
    "angular_velocity": Quantity("angular_velocity", "angular_velocity_rad_s", "rad/s"),
    "angle": Quantity("angle", "angle_rad", "rad"),
    "normal_force": Quantity("normal_force", "normal_force_N", "N"),
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


def factor_to_si(key: str, unit: str, column: str, name: str) -> float:
    """Return the factor from a column's unit to SI.

    Parameters
    ----------
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
            return own[1]
        if not quantity.unit:
            return 1.0
        raise InputError(
            f"{name} gives no unit for {shown(column)}. Give it, as in --unit {key}="
            f"{quantity.column.removeprefix(quantity.stem + '_').replace('_', '/')}."
        )
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
