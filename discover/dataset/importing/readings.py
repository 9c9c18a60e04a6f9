"""Quantities of a block in SI units: its columns, what follows from them, what its header says."""

import math
from dataclasses import dataclass, field
from pathlib import PurePath

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.mapping import Geometry, Mapping, key_of
from discover.dataset.importing.names import NameTable, name_table
from discover.dataset.importing.quantities import (
    QUANTITIES,
    UnsaidUnit,
    factor_to_si,
    guess_columns,
    name_rank,
    to_celsius,
    unit_in_name,
    unsaid_unit,
)
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import (
    Constant,
    is_clock,
    is_number,
    seconds,
    temperature_in,
)
from discover.dataset.tables.table import shown
from discover.errors import InputError

INSTRUMENT = {
    "stress": "torque",
    "shear_rate": "angular_velocity",
    "strain": "angle",
    "N1": "normal_force",
}
"""What the instrument itself measures, from which each follows by the geometry of the tool."""

_COEFFICIENTS = {"N1": "psi1", "N2": "psi2"}
"""N1 = Ψ1 γ̇² and N2 = Ψ2 γ̇²."""

SAME = {"strain": "strain_amplitude", "strain_amplitude": "strain"}
"""A column of strain may be called the one or the other by who gives its unit."""

Values = Float[np.ndarray, " n"]


@dataclass
class Readings:
    """What a block says of each quantity.

    `columns`: place of each quantity among its columns.
    `mapping`: what the user says of units and tool.
    `name`: of the file, for messages.
    `geometry`: of the tool, from the mapping or the header; None where neither has it.
    `begins`: reading of a clock of the whole measurement, in s, when the block before ended; else
        0.
    `used` in words, where each quantity that was asked for comes from.
    `unsaid`: units of those quantities that the file does not give.
    `notes` in words, what it says that cannot be.
    """

    block: Block
    columns: dict[str, int]
    mapping: Mapping
    name: str
    geometry: Geometry | None = None
    begins: float = 0.0
    used: dict[str, str] = field(default_factory=dict)
    unsaid: dict[str, UnsaidUnit] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, block: Block, mapping: Mapping, name: str) -> "Readings":
        """Return the readings of a block.

        Raises InputError if a name that the user gave stands above two columns.
        """
        given = {str(key): column for key, column in mapping.columns.items()}
        table = name_table(mapping.names)
        found = cls(block, guess_columns(block, given, table), mapping, name, mapping.geometry)
        if found.geometry is None:
            found.geometry = found._geometry()
        return found

    def __len__(self) -> int:
        return len(self.block.cells)

    def get(self, key: str) -> Values | None:
        """Return a quantity in SI units (temperature in °C), nan where the block has no number.

        Raises InputError if a unit is missing, unknown or one of something else.
        """
        if key == "temperature":
            return self._temperature()
        if key in self.columns:
            return self._column(key)
        made = self._made(key)
        if made is not None:
            return made
        constant = self._constant(key)
        return None if constant is None else np.full(len(self), constant)

    def has(self, *keys: str) -> bool:
        """Return whether all of these are known, as `get` finds them."""
        return all(self.get(key) is not None for key in keys)

    def alone(self, key: str) -> bool:
        """Return whether a quantity is a column of its own, not one that follows from others."""
        return key in self.columns

    @property
    def names(self) -> NameTable:
        """What quantities are called."""
        return name_table(self.mapping.names)

    def named(self) -> set[str]:
        """Return the quantities of which the block has a column or its header a number."""
        also = {SAME[key] for key in self.columns if key in SAME}
        return {*self.columns, *also, *(k for k in QUANTITIES if self._find_constant(k))}

    def _unit_given(self, key: str) -> str:
        """Return the unit that the user says; of a strain also by the name of its amplitude."""
        given = {str(name): unit for name, unit in self.mapping.units.items()}
        other = SAME.get(key, "")
        return given.get(key) or ("" if other in self.columns else given.get(other, ""))

    def _temperature(self) -> Values | None:
        """Return temperatures as the user, a column, the header, a title or the name gives them."""
        given = self.mapping.temperatures.get(key_of(self.name))
        if given is not None:
            self.used["temperature"] = f"{given:g} °C as given"
            return np.full(len(self), given)
        if "temperature" in self.columns:
            return self._column("temperature")
        for found, where in (
            (self._find_constant("temperature"), "the header"),
            (temperature_in(self.block.name), "the title"),
            (temperature_in(PurePath(self.name).stem), "the file's name"),
            (temperature_in("; ".join(map(" ".join, self.block.above))), "the lines above"),
        ):
            if found is None:
                continue
            unit = str(self.mapping.units.get("temperature", found.unit)) or "°C"
            said = f"{shown(found.name)} {found.value} {shown(unit)} of {where}"
            degrees = to_celsius(float(found.value), unit)
            if degrees is not None and _is_temperature(degrees):
                self.used["temperature"] = said
                return np.full(len(self), degrees)
            self._no_temperature(said)
        return None

    def _no_temperature(self, said: str) -> None:
        self.notes["temperature"] = (
            f"{said} is no temperature (-273.15 to 2000 °C) and not used; give it, as in "
            f"--temperature {shown(self.name)}=25"
        )

    def _column(self, key: str) -> Values:
        at = self.columns[key]
        column, unit = self.block.columns[at]
        cells = [row[at] for row in self.block.cells]
        self.used[key] = shown(column) + (f" [{shown(unit)}]" if unit else "")
        if key == "time" and any(map(is_clock, cells)):
            self.used[key] = f"{shown(column)} [clock, in s]"
            return seconds(cells, self._unit_given(key) or unit)
        raw = np.array([float(cell) if is_number(cell) else math.nan for cell in cells])
        unit = self._unit_given(key) or unit or unit_in_name(key, column, self.names)
        if key == "temperature":
            kelvin = to_celsius(0.0, unit or "°C")
            if kelvin is None:
                return np.full(len(raw), math.nan)
            degrees = np.array([to_celsius(value, unit or "°C") for value in raw], dtype=float)
            real = _is_temperature(degrees)
            if not np.all(real | np.isnan(degrees)):
                worst = cells[int(np.argmin(real | np.isnan(degrees)))]
                self._no_temperature(f"{self.used[key]} {shown(worst)}")
            return np.where(real, degrees, math.nan)
        if not unit:
            said = next((c.unit for c in self.block.constants if self._is_unit_line(c, key)), "")
            unit = said or self._unsaid(key, column, raw)
        factor = factor_to_si(key, unit, column, self.name)
        self.used[key] = shown(column) + (f" [{shown(unit)}]" if unit != "1" else "")
        if key in self.unsaid and self.unsaid[key].how == "told":
            self.used[key] += f", since {self.unsaid[key].why},"
        if factor != 1.0:
            self.used[key] += f" × {factor:.6g}"
        return raw * factor

    def _unsaid(self, key: str, column: str, raw: Values) -> str:
        """Return the unit in which a column without one is read, and keep it in `unsaid`."""
        own = {QUANTITIES[k].column for k in QUANTITIES if QUANTITIES[k].unit}
        if column == QUANTITIES[key].column and own & {name for name, _ in self.block.columns}:
            return "1"  # a table of this project's own
        if key not in self.unsaid:
            used, unsaid = dict(self.used), dict(self.unsaid)
            alone = {k: self._column for k in self.columns if k != key}
            found = unsaid_unit(
                key, column, raw, lambda k: alone[k](k) if k in alone else None, self.names
            )
            # what tells a unit is not thereby part of the test
            self.used, self.unsaid = used, {**unsaid, key: found}
        return self.unsaid[key].unit

    def _is_unit_line(self, constant: Constant, key: str) -> bool:
        return not constant.value and self.names.rank(key, constant.name) is not None

    def _made(self, key: str) -> Values | None:
        """Return a quantity that follows from others of the same row."""
        source = INSTRUMENT.get(key)
        if source in self.columns and self.geometry is not None:
            factor = _per_signal(self.geometry, key)
            return None if factor is None else self._column(source) * factor
        if key == "stress" and "viscosity" in self.columns:
            rate = self.get("shear_rate")
            return None if rate is None else self._column("viscosity") * rate
        if key == "tensile_stress" and (grows := self._of_extension()) in self.columns:
            rate = self.get("hencky_rate")
            return None if rate is None else self._column(grows) * rate
        if key in _COEFFICIENTS and _COEFFICIENTS[key] in self.columns:
            rate = self.get("shear_rate")
            return None if rate is None else self._column(_COEFFICIENTS[key]) * rate**2
        if key in ("Gp", "Gpp"):
            return self._moduli()[key == "Gpp"]
        if key == "strain_amplitude":
            if "strain" in self.columns:
                return self._column("strain")
            size = self.get("stress_amplitude")
            storage, loss = self.get("Gp"), self.get("Gpp")
            if size is not None and storage is not None and loss is not None:
                return size / np.hypot(storage, loss)
        return None

    def _of_extension(self) -> str:
        """Return which viscosity is one of extension: one alone beside a Hencky rate is."""
        alone = "hencky_rate" in self.columns and "shear_rate" not in self.columns
        named = "extensional_viscosity" in self.columns
        return "viscosity" if alone and not named else "extensional_viscosity"

    def _moduli(self) -> tuple[Values | None, Values | None]:
        if "phase_angle" in self.columns:
            angle = self._column("phase_angle")
        elif "loss_factor" in self.columns:
            angle = np.arctan(self._column("loss_factor"))
        else:
            return None, None
        if "complex_modulus" in self.columns:
            size = self._column("complex_modulus")
        elif "complex_viscosity" in self.columns and (omega := self.get("omega")) is not None:
            size = self._column("complex_viscosity") * omega
        else:
            return None, None
        return size * np.cos(angle), size * np.sin(angle)

    def _constant(self, key: str) -> float | None:
        """Return what the header says of the whole block, in SI units; None if nothing."""
        found = self._find_constant(key)
        if found is None:
            return None
        if not math.isfinite(float(found.value)):
            raise InputError(
                f"{self.name}: the header says {shown(found.name)} {shown(found.value)}, more than "
                "a number can be. Correct that line."
            )
        unit = self._unit_given(key) or found.unit
        if not unit:
            unit = self._unsaid(key, found.name, np.array([float(found.value)]))
        self.used[key] = f"{shown(found.name)} {found.value} {shown(unit)} of the header"
        return float(found.value) * factor_to_si(key, unit, found.name, self.name)

    def _find_constant(self, key: str) -> Constant | None:
        if key in ("time", "wave_time", "point"):  # the time of the day, the number of points
            return None
        ranks = {
            constant: name_rank(key, constant.name, constant.unit, self.names)
            for constant in self.block.constants
            if constant.value and (constant.unit or len(constant.name) > 1)
        }
        known = [constant for constant, rank in ranks.items() if rank is not None]
        return min(known, key=lambda c: (not c.unit, ranks[c]), default=None)

    def _geometry(self) -> Geometry | None:
        """Return the tool that the header describes; None if it does not, wholly."""
        try:
            keys = ("radius", "diameter", "gap", "cone_angle")
            radius, diameter, gap, angle = ((self._constant(key) or 0.0) for key in keys)
            if any(key in self.unsaid for key in keys):
                return None
            radius = radius or 0.5 * diameter
            if radius > 0.0 and angle > 0.0:
                return Geometry(
                    type="cone_plate", radius_mm=1e3 * radius, angle_deg=math.degrees(angle)
                )
            if radius > 0.0 and gap > 0.0:
                return Geometry(type="plate_plate", radius_mm=1e3 * radius, gap_mm=1e3 * gap)
        except (InputError, ValueError):
            pass  # not a number of a tool; torque then needs --geometry
        return None


def _per_signal(geometry: Geometry, key: str) -> float | None:
    if key == "stress":
        return geometry.stress_per_torque
    return geometry.normal_stress_per_force if key == "N1" else geometry.strain_per_angle


def _is_temperature(degrees):
    """Return whether numbers in °C can be temperatures, as a `Mapping` takes them."""
    return (degrees >= -273.15) & (degrees <= 2000.0)
