"""Quantities of a block in SI units: its columns, what follows from them, what its header says."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from discover.dataset.importing import quantities
from discover.dataset.importing.mapping import Geometry, Mapping
from discover.dataset.importing.names import rank_of
from discover.dataset.importing.quantities import QUANTITIES, UnsaidUnit, name_rank, to_celsius
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import Constant, is_clock, seconds, temperature_in
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import ABSOLUTE_ZERO
from discover.errors import InputError

# what the instrument itself measures, from which each follows by the geometry of the tool
INSTRUMENT = {
    "stress": "torque", "shear_rate": "angular_velocity", "strain": "angle", "N1": "normal_force",
}  # fmt: skip
# a column of strain may be called the one or the other by who gives its unit
SAME = {"strain": "strain_amplitude", "strain_amplitude": "strain"}
Values = Float[np.ndarray, " n"]

# what follows from a column and other quantities, and how
_FORMULAS: tuple[tuple[str, tuple[str, ...], Callable[..., Values]], ...] = (
    ("phase_angle", ("loss_factor",), np.arctan),
    ("Gp", ("complex_modulus", "phase_angle"), lambda size, angle: size * np.cos(angle)),
    ("Gpp", ("complex_modulus", "phase_angle"), lambda size, angle: size * np.sin(angle)),
    ("Gp", ("complex_viscosity", "omega", "phase_angle"), lambda eta, w, a: eta * w * np.cos(a)),
    ("Gpp", ("complex_viscosity", "omega", "phase_angle"), lambda eta, w, a: eta * w * np.sin(a)),
    ("Gp", ("Gpp", "phase_angle"), lambda loss, angle: loss / np.tan(angle)),
    ("Gpp", ("Gp", "phase_angle"), lambda storage, angle: storage * np.tan(angle)),
    ("strain_amplitude", ("strain",), np.asarray),
    ("strain_amplitude", ("stress_amplitude", "Gp", "Gpp"), lambda s, g, h: s / np.hypot(g, h)),
    ("stress", ("viscosity", "shear_rate"), np.multiply),
    ("tensile_stress", ("extensional_viscosity", "hencky_rate"), np.multiply),
    ("tensile_stress", ("viscosity", "hencky_rate"), np.multiply),
    ("N1", ("psi1", "shear_rate"), lambda psi, rate: psi * rate**2),
    ("N2", ("psi2", "shear_rate"), lambda psi, rate: psi * rate**2),
)


class _Column(NamedTuple):
    values: Values  # in SI units (°C)
    words: str  # name, unit and factor
    unsaid: UnsaidUnit | None = None  # its unit, where the file does not give it


@dataclass
class Readings:
    """What a block says of each quantity."""

    block: Block
    columns: dict[str, int]  # place of each quantity among the columns
    mapping: Mapping  # what the user says of units and tool
    name: str  # of the file, for messages
    geometry: Geometry | None = None  # of the tool; None where nobody says it
    begins: float = 0.0  # reading of a clock of the whole measurement, in s, when the block began
    used: dict[str, str] = field(default_factory=dict)  # whence each quantity asked for, in words
    unsaid: dict[str, UnsaidUnit] = field(default_factory=dict)  # their units that nobody gives
    note: str = ""  # a temperature that cannot be, in words
    _known: dict[str, _Column] = field(default_factory=dict)

    @classmethod
    def of(cls, block: Block, mapping: Mapping, name: str) -> "Readings":
        """Return readings of a block; InputError if a given name stands above two columns."""
        columns = quantities.guess_columns(block, mapping.columns)
        found = cls(block, columns, mapping, name, mapping.geometry)
        if found.geometry is None:
            found.geometry = found._geometry()
        return found

    def __len__(self) -> int:
        return len(self.block.cells)

    def get(self, key: str) -> Values | None:
        """Return a quantity in SI units (°C), nan where no number is; InputError on wrong units."""
        if key == "temperature":
            return self._temperature()
        if key in self.columns:
            return self._column(key)
        if (made := self._made(key)) is not None:
            return made
        constant = self._constant(key)
        return None if constant is None else np.full(len(self), constant)

    def known(self, key: str) -> Values:
        """Return a quantity that is there."""
        values = self.get(key)
        assert values is not None
        return values

    def unless_wrong(self, key: str) -> Values | None:
        """Return a quantity; None too where its unit is wrong, which is said later."""
        try:
            return self.get(key)
        except InputError:
            return None

    def has(self, *keys: str) -> bool:
        """Return whether all of these are known, as `get` finds them."""
        return all(self.get(key) is not None for key in keys)

    def alone(self, key: str) -> Values | None:
        """Return a quantity that is a column of its own; None where it follows from others."""
        return self.get(key) if key in self.columns else None

    def whole(self, *keys: str) -> np.ndarray:
        """Return the rows that have a number in each of these quantities."""
        rows = np.ones(len(self), bool)
        for values in map(self.get, keys):
            rows &= False if values is None else np.isfinite(values)
        return rows

    def named(self) -> set[str]:
        """Return the quantities of which the block has a column or its header a number."""
        also = {SAME[key] for key in self.columns if key in SAME}
        return {*self.columns, *also, *(k for k in QUANTITIES if self._find_constant(k))}

    def numbered(self) -> Iterator[str]:
        """Yield the names of columns that hold numbers, but for those that number rows."""
        passed = [self.columns.get(key) for key in ("point", "strain_wave", "stress_wave")]
        names = [name for name, _ in self.block.columns]
        yield from (names[i] for i in self.block.filled if i not in passed and names[i])

    def _unit_given(self, key: str) -> str:
        given, other = self.mapping.units, SAME.get(key, "")
        return given.get(key) or ("" if other in self.columns else given.get(other, ""))

    def _temperature(self) -> Values | None:
        """Return temperatures as the user, a column, the header, a title or the name gives them."""
        given = self.mapping.temperatures.get(self.name)
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
        self.note = (
            f"{said} is not a temperature ({ABSOLUTE_ZERO} to 2000 °C) and not used; give it, as "
            f"in --temperature {shown(self.name)}=25"
        )

    def _column(self, key: str) -> Values:
        """Return a column in SI units, which from then on counts as used."""
        if key not in self._known:
            self._known[key] = self._in_si(key)
        read = self._known[key]
        self.used[key] = read.words
        if read.unsaid is not None:
            self.unsaid[key] = read.unsaid
        return read.values

    def _in_si(self, key: str) -> _Column:
        at = self.columns[key]
        column, unit = self.block.columns[at]
        words = shown(column) + (f" [{shown(unit)}]" if unit else "")
        if key == "time" and any(is_clock(row[at]) for row in self.block.cells):
            time = seconds([row[at] for row in self.block.cells], self._unit_given(key) or unit)
            return _Column(time, f"{shown(column)} [clock, in s]")
        raw = self.block.numbers[at]
        if not (unit := self._unit_given(key) or unit):
            split = quantities.split_name(key, column)
            unit = "" if split is None else split[1]
        if key == "temperature":
            degrees = to_celsius(raw, unit or "°C")
            degrees = np.full(len(raw), math.nan) if degrees is None else degrees
            wrong = ~(_is_temperature(degrees) | np.isnan(degrees))
            if np.any(wrong):
                worst = self.block.cells[int(np.argmax(wrong))][at]
                self._no_temperature(f"{words} {shown(worst)}")
            return _Column(np.where(wrong, math.nan, degrees), words)
        unsaid = None
        if not unit:
            lines = (c for c in self.block.constants if not c.value)
            unit = next((c.unit for c in lines if rank_of(key, c.name) is not None), "")
        if not unit:
            unit, unsaid = self._unsaid(key, column)
        factor = quantities.factor_to_si(key, unit, column, self.name)
        words = shown(column) + (f" [{shown(unit)}]" if unit != "1" else "")
        return _Column(raw * factor, words + (f" × {factor:.6g}" if factor != 1.0 else ""), unsaid)

    def _unsaid(self, key: str, column: str) -> tuple[str, UnsaidUnit | None]:
        """Return the unit in which a column without one is read, and what is to be said of it."""
        own = {one.column for one in QUANTITIES.values() if one.unit}
        if column == QUANTITIES[key].column and own & {name for name, _ in self.block.columns}:
            return "1", None  # a table of this project's own
        found = quantities.unsaid_unit(key, column)
        return found.unit, found

    def _made(self, key: str) -> Values | None:
        source = INSTRUMENT.get(key)
        if source in self.columns and self.geometry is not None:
            factor = self.geometry.per_signal(key)
            return None if factor is None else self._column(source) * factor
        for made, (first, *others), formula in _FORMULAS:
            # a viscosity alone beside a Hencky rate is one of extension
            shear = first == "viscosity" and "shear_rate" in self.columns
            if made != key or first not in self.columns or (key == "tensile_stress" and shear):
                continue
            given = [self.get(one) for one in others]
            if all(values is not None for values in given):
                return formula(self._column(first), *given)
        return None

    def _constant(self, key: str) -> float | None:
        if (found := self._find_constant(key)) is None:
            return None
        value, name = float(found.value), shown(found.name)
        if not math.isfinite(value):
            raise InputError(
                f"{self.name}: the header says {name} {shown(found.value)}, more than a number can "
                "be. Correct that line."
            )
        if not (unit := self._unit_given(key) or found.unit):
            unit, unsaid = self._unsaid(key, found.name)
            if unsaid is not None:
                self.unsaid[key] = unsaid
        self.used[key] = f"{name} {found.value} {shown(unit)} of the header"
        return value * quantities.factor_to_si(key, unit, found.name, self.name)

    def _find_constant(self, key: str) -> Constant | None:
        if key in ("time", "wave_time", "point"):  # the time of the day, the number of points
            return None
        ranks = {
            constant: name_rank(key, constant.name, constant.unit)
            for constant in self.block.constants
            if constant.value and (constant.unit or len(constant.name) > 1)
        }
        known = [constant for constant, rank in ranks.items() if rank is not None]
        return min(known, key=lambda c: (not c.unit, ranks[c]), default=None)

    def _geometry(self) -> Geometry | None:
        keys = ("radius", "diameter", "gap", "cone_angle")
        try:
            radius, diameter, gap, angle = ((self._constant(key) or 0.0) for key in keys)
            size = {"radius_mm": 1e3 * (radius or 0.5 * diameter)}
            if any(key in self.unsaid for key in keys) or not size["radius_mm"] > 0.0:
                return None
            if angle > 0.0:
                return Geometry(type="cone_plate", **size, angle_deg=math.degrees(angle))
            return Geometry(type="plate_plate", **size, gap_mm=1e3 * gap) if gap > 0.0 else None
        except (InputError, ValueError):
            return None  # not a number of a tool; torque then needs --geometry


def _is_temperature(degrees):
    return (degrees >= ABSOLUTE_ZERO) & (degrees <= 2000.0)
