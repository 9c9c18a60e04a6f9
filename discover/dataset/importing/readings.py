"""Quantities of a block in SI units: its columns, what follows from them, what its header says."""

import math
from dataclasses import dataclass, field
from pathlib import PurePath

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.header_constants import Constant, temperature_in
from discover.dataset.importing.mapping import Geometry, Mapping, key_of
from discover.dataset.importing.names import NAMES, plain
from discover.dataset.importing.quantities import (
    QUANTITIES,
    factor_to_si,
    fits,
    guess_columns,
    to_celsius,
)
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables.table import shown
from discover.errors import InputError

INSTRUMENT = {
    "stress": "torque",
    "shear_rate": "angular_velocity",
    "strain": "angle",
    "N1": "normal_force",
}
"""What the instrument itself measures, from which each follows by the geometry of the tool."""

Values = Float[np.ndarray, " n"]


@dataclass
class Readings:
    """What a block says of each quantity.

    Attributes
    ----------
    columns
        Place of each quantity among its columns.
    mapping
        What the user says of units and tool.
    name
        Of the file, for messages.
    geometry
        Of the tool, from the mapping or the header; None where neither has it.
    begins
        Reading of a clock of the whole measurement, in s, when the block before ended; else 0.
    used
        In words, where each quantity that was asked for comes from.
    notes
        In words, what it says that cannot be.
    """

    block: Block
    columns: dict[str, int]
    mapping: Mapping
    name: str
    geometry: Geometry | None = None
    begins: float = 0.0
    used: dict[str, str] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)

    @classmethod
    def of(cls, block: Block, mapping: Mapping, name: str) -> "Readings":
        """Return the readings of a block.

        Raises
        ------
        InputError
            If a name that the user gave stands above two columns.
        """
        given = {str(key): column for key, column in mapping.columns.items()}
        found = cls(block, guess_columns(block, given), mapping, name, mapping.geometry)
        if found.geometry is None:
            found.geometry = found._geometry()
        return found

    def __len__(self) -> int:
        return len(self.block.cells)

    def get(self, key: str) -> Values | None:
        """Return a quantity in SI units (temperature in °C), nan where the block has no number.

        Raises
        ------
        InputError
            If a unit is missing, unknown or one of something else.
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
        unit = str(self.mapping.units.get(key, unit))  # type: ignore[call-overload]
        cells = [row[at] for row in self.block.cells]
        raw = np.array([float(cell) if is_number(cell) else math.nan for cell in cells])
        self.used[key] = shown(column) + (f" [{shown(unit)}]" if unit else "")
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
        factor = factor_to_si(key, unit, column, self.name)
        if factor != 1.0:
            self.used[key] += f" × {factor:.6g}"
        return raw * factor

    def _made(self, key: str) -> Values | None:
        """Return a quantity that follows from others of the same row."""
        source = INSTRUMENT.get(key)
        if source in self.columns and self.geometry is not None:
            factor = _per_signal(self.geometry, key)
            return None if factor is None else self._column(source) * factor
        if key == "stress" and "viscosity" in self.columns:
            rate = self.get("shear_rate")
            return None if rate is None else self._column("viscosity") * rate
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
        unit = str(self.mapping.units.get(key, found.unit))  # type: ignore[call-overload]
        self.used[key] = f"{shown(found.name)} {found.value} {shown(unit)} of the header".strip()
        if not math.isfinite(float(found.value)):
            raise InputError(
                f"{self.name}: the header says {shown(found.name)} {shown(found.value)}, more than "
                "a number can be. Correct that line."
            )
        return float(found.value) * factor_to_si(key, unit, found.name, self.name)

    def _find_constant(self, key: str) -> Constant | None:
        names = (*NAMES[key], plain(QUANTITIES[key].column))
        of = {plain(constant.name): constant for constant in self.block.constants}
        return next(
            (of[n] for n in names if n in of and of[n].unit and fits(key, n, of[n].unit)),
            next((of[n] for n in names if n in of and len(n) > 1 and not of[n].unit), None),
        )

    def _geometry(self) -> Geometry | None:
        """Return the tool that the header describes; None if it does not, wholly."""
        try:
            radius, diameter, gap, angle = (
                (self._constant(key) or 0.0) for key in ("radius", "diameter", "gap", "cone_angle")
            )
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
