"""Which column is what, and how its unit becomes SI."""

from collections.abc import Mapping

from discover.dataset.importing.names import NAMES, plain
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.material_functions import COMPLIANCE, RELAXATION_MODULUS
from discover.dataset.tables import units
from discover.dataset.tables.table import shown
from discover.dataset.tables.unit_text import read_heading, read_unit
from discover.dataset.tables.units import Quantity
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
    "hencky_rate": units.HENCKY_RATE,
    "tensile_stress": units.TENSILE_STRESS,
    "hencky_strain": units.HENCKY_STRAIN,
    "relaxation_modulus": RELAXATION_MODULUS,
    "compliance": COMPLIANCE,
    "viscosity": Quantity("viscosity", "viscosity_Pa_s", "Pa*s"),
    "strain_amplitude": Quantity("strain_amplitude", "strain_amplitude", ""),
    "stress_amplitude": Quantity("stress_amplitude", "stress_amplitude_Pa", "Pa"),
    "complex_modulus": Quantity("complex_modulus", "complex_modulus_Pa", "Pa"),
    "complex_viscosity": Quantity("complex_viscosity", "complex_viscosity_Pa_s", "Pa*s"),
    "phase_angle": Quantity("phase_angle", "phase_angle_rad", "rad"),
    "loss_factor": Quantity("loss_factor", "loss_factor", ""),
    "temperature": Quantity("temperature", "temperature_C", ""),
    "radius": Quantity("radius", "radius_m", "m"),
    "diameter": Quantity("diameter", "diameter_m", "m"),
    "gap": Quantity("gap", "gap_m", "m"),
    "cone_angle": Quantity("cone_angle", "cone_angle_rad", "rad"),
    "strain_wave": Quantity("strain_wave", "strain_wave", ""),
    "stress_wave": Quantity("stress_wave", "stress_wave_Pa", "Pa"),
    "wave_time": Quantity("wave_time", "wave_time_s", "s"),
    "point": Quantity("point", "point", ""),
}


def guess_columns(block: Block, given: Mapping[str, str]) -> dict[str, int]:
    """Return the place of each quantity among the columns of a block.

    Columns without a single number are passed over.

    Parameters
    ----------
    given
        Names of columns that the user gave; they win over guesses.

    Raises
    ------
    InputError
        If a name that was given stands above two columns.
    """
    filled = [any(is_number(row[i]) for row in block.cells) for i in range(len(block.columns))]
    names = [plain(name) for name, _ in block.columns]
    found: dict[str, int] = {}
    for key in QUANTITIES:
        if key in given:
            exact = [i for i, (name, _) in enumerate(block.columns) if name == given[key]]
            at = exact or [i for i, name in enumerate(names) if name == plain(given[key])]
            if len(at) > 1:
                raise InputError(
                    f"Two columns are named {given[key]!r} (block at line {block.line}). Rename "
                    "one in the file."
                )
        else:
            at = [
                i
                for wanted in (*NAMES.get(key, ()), plain(QUANTITIES[key].column))
                for i, name in enumerate(names)
                if name == wanted and fits(key, name, block.columns[i][1])
            ]
            # a column of this project's own may carry another unit in its name
            at += [i for i, (name, _) in enumerate(block.columns) if _is_own(name, key)]
        at = [i for i in at if filled[i]]
        if at:
            found[key] = at[0]
    return found


def _is_own(name: str, key: str) -> bool:
    quantity = QUANTITIES[key]
    if not name.startswith(f"{quantity.stem}_"):
        return False
    unit = read_heading(name.removeprefix(f"{quantity.stem}_"))
    return unit is not None and units.factor_to(unit, quantity) is not None


def fits(key: str, name: str, unit: str) -> bool:
    """Return whether a short name, which may mean several things, has a unit of the quantity.

    Parameters
    ----------
    key
        From `QUANTITIES`.
    name, unit
        Of the column; a longer name fits whatever its unit is, so that a wrong one is said.
    """
    if len(name) > _SHORT:
        return True
    if key == "temperature":
        return to_celsius(0.0, unit) is not None
    known = read_unit(unit) if unit else None
    if known is None:
        # without a unit G' is a modulus, and t is a time
        return not (key == "shear_rate" and name == "gp")
    return units.factor_to(known, QUANTITIES[key]) is not None


_SHORT = 3
"""Letters of a name that says too little without its unit."""


def to_celsius(value: float, unit: str) -> float | None:
    """Return a temperature in °C, or None if the unit is none of temperature."""
    scale = unit.replace("º", "°").replace("°", "").replace("deg", "").strip().upper()
    if scale in ("C", "CELSIUS"):
        return value
    if scale in ("K", "KELVIN"):
        return value - 273.15
    if scale in ("F", "FAHRENHEIT"):
        return (value - 32.0) / 1.8
    return None


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
    if key == "angular_velocity" and unit in ("1/min", "min-1", "min⁻¹", "min^-1"):
        unit = "turn/min"
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
