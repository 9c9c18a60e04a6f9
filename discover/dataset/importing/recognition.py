"""Which test a block of numbers is, by what it holds, before any of it is used."""

import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from discover.dataset.importing.in_time import APART, Course, kind_of_course, up_and_down
from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.oscillations import alternates
from discover.dataset.importing.quantities import SAME_TEMPERATURE
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Said, said_of
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import SHEAR_RATE, TIME, Quantity, factor_to, read_unit
from discover.words import percent_of

_SAME_FREQUENCY = 1.02
_SAME_AMPLITUDE = 1.2
_FEWEST = 3
_OF_TENSION = {
    "stress": "tensile_stress", "shear_rate": "hencky_rate", "strain": "hencky_strain",
}  # fmt: skip
_SHEAR = re.compile(r"shear|scher|schub|cisaill|cizall|cortante|taglio|xy|12", re.IGNORECASE)

Rows = Bool[np.ndarray, " n"]


class Recognised(NamedTuple):
    """What some rows of a block are taken for."""

    kind: TestName
    rows: Rows
    why: str  # what in the block says so


def recognise(readings: Readings) -> Recognised:
    """Which test a block holds, the tests of one table being apart; InputError on wrong units."""
    said = said_of(readings.block, readings.name)
    _find_time(readings)
    _as_extension(readings, said)
    rows = np.ones(len(readings), bool)
    in_time, has = "time" in readings.columns, readings.has
    kind, why = "none", ""
    if has("omega", "Gp", "Gpp"):
        # samples of a waveform have no frequency, and are no points that lack something; before
        # the tool moves instruments write zeros
        rows = _of(readings, "omega", rows) > 0.0
        kind, why = _oscillatory(readings, rows & readings.whole("omega", "Gp", "Gpp"))
    elif in_time and has("tensile_stress"):
        flow = said.test if said is not None and said.test in ("planar", "biaxial") else "uniaxial"
        kind, why = "run", f"an extension, {flow}: a tensile stress over time"
    elif has("Gp", "Gpp") and not has("omega") and "strain" in readings.columns:
        kind, why = "amplitude_sweep", "moduli against strain, without a frequency"
    elif in_time and has("stress") and (has("shear_rate") or has("strain")):
        # rows that lack a number are counted when the rest is taken
        kind, why = _in_time(readings, said)
    elif in_time and has("relaxation_modulus"):
        kind, why = "relaxation", "it has a relaxation modulus over time"
    elif in_time and has("compliance"):
        kind, why = "creep", "it has a compliance over time"
    elif has("stress", "shear_rate"):
        kind, why = _without_time(readings)
    return Recognised(kind, rows, why)


def _oscillatory(readings: Readings, rows: Rows) -> tuple[TestName, str]:
    if np.sum(rows) < _FEWEST:
        return "none", f"an oscillation of {int(np.sum(rows))} points"
    omega = _of(readings, "omega", rows)
    amplitude = readings.get("strain_amplitude")
    size = np.empty(0) if amplitude is None else amplitude[rows & np.isfinite(amplitude)]
    several = len(size) > 0 and _ratio(size) > _SAME_AMPLITUDE
    low, high = (f"{100 * size.min():.2g}", percent_of(size.max())) if several else ("", "")
    if _ratio(omega) > _SAME_FREQUENCY:
        different = len(np.unique(np.round(np.log(omega) / np.log(_SAME_FREQUENCY))))
        if several and 2 * different <= len(omega):
            return "amplitude_sweep", f"the strain goes from row to row, at {different} frequencies"
        why = f"{different} frequencies, {omega.min():.3g} to {omega.max():.3g} rad/s"
        if several:
            why += f"; the strain is not one but {low} to {high}, taken as small"
        elif not len(size):
            why += "; nothing says how large the strain was, it is taken as small"
        return "frequency_sweep", why
    at_one = f"one frequency, {omega[0]:.3g} rad/s"
    if several:
        return "amplitude_sweep", f"{at_one}, and strains from {low} to {high}"
    temperature = readings.get("temperature")
    if temperature is not None and np.ptp(temperature[rows]) > SAME_TEMPERATURE:
        return "none", f"a temperature sweep: {at_one}, and temperature varies"
    return "none", f"a time sweep: {at_one}, and no strain that varies"


def _ratio(values: Float[np.ndarray, " n"]) -> float:
    low, high = np.min(np.abs(values)), np.max(np.abs(values))
    return float(high / low) if low > 0.0 else np.inf


def _of(readings: Readings, key: str, rows: Rows) -> Float[np.ndarray, " m"]:
    values = readings.get(key)
    assert values is not None
    return values[rows]


def _in_time(readings: Readings, said: Said | None) -> tuple[TestName, str]:
    moved = [key for key in ("shear_rate", "strain") if readings.has(key)]
    kept = readings.whole("time", "stress", moved[0])
    if np.sum(kept) < _FEWEST:
        return "run", "a transient"
    strain = _of(readings, "strain", kept) if "strain" in moved else None
    if strain is not None and not np.all(np.isfinite(strain)):
        strain = None
    rate = _of(readings, "shear_rate", kept) if moved[0] == "shear_rate" else None
    time, stress = (_of(readings, key, kept) for key in ("time", "stress"))
    return kind_of_course(Course(time, stress, rate, strain), said)


def _without_time(readings: Readings) -> tuple[TestName, str]:
    """Return a flow curve, or why stresses and rates without a time are none."""
    rows = readings.whole("stress", "shear_rate")
    found: tuple[TestName, str] = "flow_curve", "it has stress and rate, and no time"
    if np.sum(rows) < _FEWEST:
        return found
    rate, stress = _of(readings, "shear_rate", rows), _of(readings, "stress", rows)
    ways = up_and_down(rate, stress)
    if alternates(rate) or alternates(stress):
        why = "an oscillation, as rate or stress swing to and fro"
    elif not np.any(rate) or np.ptp(np.percentile(rate, [5.0, 95.0])) < 0.1 * np.max(np.abs(rate)):
        why = "samples at one rate, not a flow curve"
    elif _waits(rate, stress):
        why = "steps of the rate held in turn, not a flow curve"
    elif ways is not None and ways.apart:
        why = f"a loop whose ways up and down are {ways.described} at the same rates, so no flow "
        why += "curve of steady states"
    else:
        return found
    known, columns = readings.columns.values(), readings.block.columns
    unread = [shown(name) for i, (name, _) in enumerate(columns) if name and i not in known]
    remedy = "Export it with its time, or add a column of it"
    if unread:
        remedy = f'Name it, as in --column time="{unread[0]}"; not read: {", ".join(unread[:8])}'
    return "none", f"{why}, and no column is known as its time. {remedy}"


def _waits(rate: Float[np.ndarray, " n"], stress: Float[np.ndarray, " n"]) -> bool:
    """Return whether the stress changes while the rate is held, in several rows at each rate."""
    steps = np.flatnonzero(np.abs(np.diff(rate)) > 1e-3 * np.max(np.abs(rate))) + 1
    long = [piece for piece in np.split(stress, steps) if len(piece) > _FEWEST]
    changes = [np.ptp(piece) > APART * np.max(np.abs(piece)) for piece in long]
    return sum(map(len, long)) > 0.8 * len(rate) and any(changes)


def _find_time(readings: Readings) -> None:
    """Take for the time a column in a unit of time that nothing else is known by, if it rises."""
    if "time" in readings.columns or "time" in readings.mapping.columns:
        return
    for i in _unread_in(readings, TIME):
        values = readings.block.numbers[i]
        values = values[~np.isnan(values)]
        if len(values) >= _FEWEST and np.all(np.diff(values) > 0.0):
            readings.columns["time"] = i
            return


def _as_extension(readings: Readings, said: Said | None) -> None:
    """Take stress, rate, strain for those of an extension, unless called those of shear."""
    tensile = set(_OF_TENSION.values()) & set(readings.columns)
    if not tensile and (said is None or said.test not in ("uniaxial", "planar", "biaxial")):
        return
    for shear, extension in _OF_TENSION.items():
        at = readings.columns.get(shear)
        if at is None and shear == "shear_rate":
            at = next(_unread_in(readings, SHEAR_RATE), None)
        if at is None or extension in readings.columns:
            continue
        if not _SHEAR.search(readings.block.columns[at][0]):
            readings.columns.pop(shear, None)
            readings.columns[extension] = at


def _unread_in(readings: Readings, quantity: Quantity) -> Iterator[int]:
    """Yield the columns with a name in a unit of a quantity that nothing is known by."""
    for i, (name, unit) in enumerate(readings.block.columns):
        known = read_unit(unit) if unit and i not in readings.columns.values() else None
        if name and known is not None and factor_to(known, quantity) is not None:
            yield i
