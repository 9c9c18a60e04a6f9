"""Which test a block of numbers is, by what it holds, before any of it is used."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from discover.dataset.importing.in_time import APART, Course, kind_of_course, up_and_down
from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.oscillations import alternates
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Said, said_of
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import SHEAR_RATE, TIME, Quantity, factor_to, read_unit
from discover.words import percent_of

_SAME_FREQUENCY = 1.02
_SAME_AMPLITUDE = 1.2
_SAME_TEMPERATURE = 1.5
_FEWEST = 3

Rows = Bool[np.ndarray, " n"]


@dataclass(frozen=True)
class Recognised:
    """What some rows of a block are taken for.

    `kind`: the test.
    `rows`: which rows of the block it has.
    `why`: what in the block says so.
    """

    kind: TestName
    rows: Rows
    why: str


def recognise(readings: Readings) -> list[Recognised]:
    """Return which tests a block holds; the tests of one table are apart already.

    Raises InputError if a unit is missing or wrong.
    """
    said = said_of(readings.block, readings.name)
    _find_time(readings)
    _as_extension(readings, said)
    rows = np.ones(len(readings), bool)
    in_time = readings.alone("time")
    if readings.has("omega", "Gp", "Gpp"):
        return [_oscillatory(readings)]
    if in_time and readings.has("tensile_stress"):
        flow = said.test if said is not None and said.test in ("planar", "biaxial") else "uniaxial"
        return [Recognised("run", rows, f"an extension, {flow}: a tensile stress over time")]
    if readings.has("Gp", "Gpp") and not readings.has("omega") and readings.alone("strain"):
        return [Recognised("amplitude_sweep", rows, "moduli against strain, without a frequency")]
    in_flow = readings.has("stress") and (readings.has("shear_rate") or readings.has("strain"))
    if in_time and in_flow:
        # rows that lack a number are counted when the rest is taken
        return [replace(_in_time(readings, said), rows=rows)]
    if in_time and readings.has("relaxation_modulus"):
        return [Recognised("relaxation", rows, "it has a relaxation modulus over time")]
    if in_time and readings.has("compliance"):
        return [Recognised("creep", rows, "it has a compliance over time")]
    if readings.has("stress", "shear_rate"):
        return [_without_time(readings)]
    return [Recognised("none", rows, "")]


def _ratio(values: Float[np.ndarray, " n"]) -> float:
    low, high = np.min(np.abs(values)), np.max(np.abs(values))
    return float(high / low) if low > 0.0 else np.inf


def whole(readings: Readings, *keys: str) -> Rows:
    """Return the rows that have a number in each of these quantities."""
    kept = np.ones(len(readings), bool)
    for key in keys:
        values = readings.get(key)
        kept &= False if values is None else np.isfinite(values)
    return kept


def _oscillatory(readings: Readings) -> Recognised:
    # samples of a waveform have no frequency, and are no points that lack something; before the
    # tool moves instruments write zeros
    points = _of(readings, "omega", np.ones(len(readings), bool)) > 0.0
    rows = points & whole(readings, "omega", "Gp", "Gpp")
    return replace(_one_oscillatory(readings, rows), rows=points)


def _one_oscillatory(readings: Readings, rows: Rows) -> Recognised:
    if np.sum(rows) < _FEWEST:
        return Recognised("none", rows, f"an oscillation of {int(np.sum(rows))} points")
    omega = _of(readings, "omega", rows)
    amplitude = readings.get("strain_amplitude")
    amplitude = None if amplitude is None else amplitude[rows & np.isfinite(amplitude)]
    varied = None if amplitude is None or not len(amplitude) else _ratio(amplitude)
    if _ratio(omega) > _SAME_FREQUENCY:
        different = len(np.unique(np.round(np.log(omega) / np.log(_SAME_FREQUENCY))))
        several = varied is not None and varied > _SAME_AMPLITUDE
        if several and 2 * different <= len(omega):
            why = f"the strain goes from row to row, at {different} frequencies"
            return Recognised("amplitude_sweep", rows, why)
        why = f"{different} frequencies, {omega.min():.3g} to {omega.max():.3g} rad/s"
        if amplitude is not None and several:
            why += (
                f"; the strain is not one but {100 * amplitude.min():.2g} to "
                f"{percent_of(amplitude.max())}, taken as small"
            )
        elif varied is None:
            why += "; nothing says how large the strain was, it is taken as small"
        return Recognised("frequency_sweep", rows, why)
    at_one = f"one frequency, {omega[0]:.3g} rad/s"
    if amplitude is not None and varied is not None and varied > _SAME_AMPLITUDE:
        span = f"{100 * amplitude.min():.2g} to {percent_of(amplitude.max())}"
        return Recognised("amplitude_sweep", rows, f"{at_one}, and strains from {span}")
    temperature = readings.get("temperature")
    if temperature is not None and np.ptp(temperature[rows]) > _SAME_TEMPERATURE:
        return Recognised("none", rows, f"a temperature sweep: {at_one}, and temperature varies")
    return Recognised("none", rows, f"a time sweep: {at_one}, and no strain that varies")


def _of(readings: Readings, key: str, rows: Rows) -> Float[np.ndarray, " m"]:
    values = readings.get(key)
    assert values is not None
    return values[rows]


def _in_time(readings: Readings, said: Said | None) -> Recognised:
    moved = [key for key in ("shear_rate", "strain") if readings.has(key)]
    kept = whole(readings, "time", "stress", moved[0])
    if np.sum(kept) < _FEWEST:
        return Recognised("run", kept, "a record in time")
    strain = _of(readings, "strain", kept) if "strain" in moved else None
    if strain is not None and not np.all(np.isfinite(strain)):
        strain = None
    rate = _of(readings, "shear_rate", kept) if moved[0] == "shear_rate" else None
    time, stress = (_of(readings, key, kept) for key in ("time", "stress"))
    kind, why = kind_of_course(Course(time, stress, rate, strain), said)
    return Recognised(kind, kept, why)


def _without_time(readings: Readings) -> Recognised:
    """Return a flow curve, or why stresses and rates without a time are none."""
    rows = whole(readings, "stress", "shear_rate")
    found = Recognised(
        "flow_curve", np.ones(len(readings), bool), "it has stress and rate, and no time"
    )
    if np.sum(rows) < _FEWEST:
        return found
    rate, stress = _of(readings, "shear_rate", rows), _of(readings, "stress", rows)
    ways = up_and_down(rate, stress)
    if alternates(rate) or alternates(stress):
        why = "an oscillation, as rate or stress swing to and fro"
    elif not np.any(rate) or np.ptp(np.percentile(rate, [5.0, 95.0])) < 0.1 * np.max(np.abs(rate)):
        why = "a record at one rate, and no flow curve"
    elif _waits(rate, stress):
        why = "records at one rate after the other, and no flow curve"
    elif ways is not None and ways.apart:
        why = f"a loop whose ways up and down are {ways.described} at the same rates, so no flow "
        why += "curve of steady states"
    else:
        return found
    unread = [
        shown(name)
        for i, (name, _) in enumerate(readings.block.columns)
        if name and i not in readings.columns.values()
    ]
    why += ", and no column is known as its time. "
    if unread:
        why += f'Name it, as in --column time="{unread[0]}"; not read: {", ".join(unread[:8])}'
    else:
        why += "Export it with its time, or add a column of it"
    return Recognised("none", found.rows, why)


def _waits(rate: Float[np.ndarray, " n"], stress: Float[np.ndarray, " n"]) -> bool:
    """Return whether the stress changes while the rate is held, in several rows at each rate."""
    size = np.max(np.abs(rate))
    pieces = np.split(np.arange(len(rate)), np.flatnonzero(np.abs(np.diff(rate)) > 1e-3 * size) + 1)
    long = [piece for piece in pieces if len(piece) > _FEWEST]
    changes = [np.ptp(stress[piece]) > APART * np.max(np.abs(stress[piece])) for piece in long]
    return sum(map(len, long)) > 0.8 * len(rate) and any(changes)


def _find_time(readings: Readings) -> None:
    """Take for the time a column in a unit of time that nothing else is known by, if it rises."""
    if readings.alone("time") or "time" in readings.mapping.columns:
        return
    for i in _unread_in(readings, TIME):
        cells = [float(row[i]) for row in readings.block.cells if is_number(row[i])]
        if len(cells) >= _FEWEST and np.all(np.diff(cells) > 0.0):
            readings.columns["time"] = i
            return


_OF_TENSION = {
    "stress": "tensile_stress", "shear_rate": "hencky_rate", "strain": "hencky_strain",
}  # fmt: skip


def _as_extension(readings: Readings, said: Said | None) -> None:
    """Take stress, rate and strain for those of an extension, where words or other columns say so.

    A column that is called one of shear stays it.
    """
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


_SHEAR = re.compile(r"shear|scher|schub|cisaill|cizall|cortante|taglio|xy|12", re.IGNORECASE)
