"""Units that a file does not give.

They are told by its numbers, taken as SI where nothing else is usual, or asked for, all at once.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.names import NameTable
from discover.dataset.importing.quantities import QUANTITIES
from discover.dataset.tables.table import shown
from discover.errors import InputError
from discover.words import listed

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

    `key`: what it holds, from `QUANTITIES`. `raw`: its numbers. `get`: gives other columns of the
    block in SI units, None where it has no such column. `table`: what quantities are called: an
    angular frequency is one in rad/s, a frequency may count.
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
