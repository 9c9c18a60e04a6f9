"""Which test a block of numbers is, by what it holds, before any of it is used.

Names of steps are the user's own words and decide only what numbers leave open: whether rates that
rise from row to row are a ramp in time or steady states, and whether a flow at constant stress and
constant rate is a creep test.
"""

import re
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.oscillations import alternates, purer
from discover.dataset.importing.readings import Readings
from discover.words import percent_of

_SAME_FREQUENCY = 1.02
_SAME_AMPLITUDE = 1.2
_SAME_TEMPERATURE = 1.5
_FEWEST = 3

_CONSTANT = 0.03
"""Spread, of the middle nine tenths of the samples, up to which an imposed quantity is constant."""

_RAMP = re.compile(r"ramp", re.IGNORECASE)  # rampe in German and French
_CREEP = re.compile(r"creep|kriech|fluage|retardation", re.IGNORECASE)
_STEADY = re.compile(r"flow (sweep|curve)|fließkurve|courbe", re.IGNORECASE)

Rows = Bool[np.ndarray, " n"]


@dataclass(frozen=True)
class Recognised:
    """What some rows of a block are taken for.

    Attributes
    ----------
    kind
        The test.
    rows
        Which rows of the block it has.
    why
        What in the block says so.
    """

    kind: TestName
    rows: Rows
    why: str


def recognise(readings: Readings) -> list[Recognised]:
    """Return which tests a block holds; the tests of one table are apart already.

    Raises
    ------
    InputError
        If a unit is missing or wrong.
    """
    rows = np.ones(len(readings), bool)
    if readings.has("omega", "Gp", "Gpp"):
        return [_oscillatory(readings)]
    if readings.has("time", "tensile_stress"):
        return [Recognised("run", rows, "an extension: it has a tensile stress over time")]
    if readings.has("Gp", "Gpp") and not readings.has("omega") and readings.alone("strain"):
        return [Recognised("amplitude_sweep", rows, "moduli against strain, without a frequency")]
    in_flow = readings.has("stress") and (readings.has("shear_rate") or readings.has("strain"))
    if readings.has("time") and in_flow:
        # rows that lack a number are counted when the rest is taken
        return [replace(_in_time(readings), rows=rows)]
    if readings.has("time", "relaxation_modulus"):
        return [Recognised("relaxation", rows, "it has a relaxation modulus over time")]
    if readings.has("time", "compliance"):
        return [Recognised("creep", rows, "it has a compliance over time")]
    if readings.has("stress", "shear_rate"):
        return [Recognised("flow_curve", rows, "it has stress and rate, and no time")]
    return [Recognised("none", rows, "")]


def spread(values: Float[np.ndarray, " n"]) -> float:
    """Return the width of the middle nine tenths of values over their median; inf if that is 0."""
    low, middle, high = np.percentile(values, [5.0, 50.0, 95.0])
    return float((high - low) / abs(middle)) if middle else np.inf


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


def _in_time(readings: Readings) -> Recognised:
    has_rate = readings.has("shear_rate")
    kept = whole(readings, "time", "stress", "shear_rate" if has_rate else "strain")
    if np.sum(kept) < _FEWEST:
        return Recognised("run", kept, "a record in time")
    time, stress = _of(readings, "time", kept), _of(readings, "stress", kept)
    strain = readings.get("strain")
    strain = None if strain is None else strain[kept]
    if strain is not None and not np.all(np.isfinite(strain)):
        strain = None
    rate = _of(readings, "shear_rate", kept) if has_rate else None
    name = readings.block.name or readings.name
    if rate is None:
        assert strain is not None
        moved = np.gradient(strain, time) if np.all(np.diff(time) > 0.0) else np.diff(strain)
    else:
        moved = rate
    if alternates(strain if strain is not None else moved) or alternates(stress):
        if strain is not None and purer(time, stress, strain):
            return Recognised("creep", kept, "the stress is a sine and the strain is not")
        return Recognised("run", kept, "an oscillation, sample by sample")
    if rate is not None and _steps(rate) and not _RAMP.search(name):
        span = f"{np.min(np.abs(rate)):.3g} to {np.max(np.abs(rate)):.3g} 1/s"
        return Recognised("flow_curve", kept, f"every row has another rate, {span}")
    if rate is not None and _steps(stress) and _STEADY.search(name):
        return Recognised("flow_curve", kept, "every row has another stress, and its name says so")
    steady_rate = spread(moved) < _CONSTANT
    if strain is not None and not (steady_rate and not _CREEP.search(name)):
        steady_stress = spread(stress) < _CONSTANT
        rises = np.ptp(strain) > _CONSTANT * np.max(np.abs(strain))
        if rises and (steady_stress or _CREEP.search(name)):
            return Recognised("creep", kept, "the stress is constant, and the strain grows")
        if _RAMP.search(name) and _rougher(time, moved, stress):
            return Recognised("creep", kept, "a ramp of stress, which the strain follows")
        # held: what is left of the rise of the strain lies before the middle of the record
        late = strain[len(strain) // 4 :]
        if abs(np.median(strain)) > 0.0 and spread(late) < _CONSTANT and not steady_rate:
            return Recognised("relaxation", kept, "the strain is held, and the stress relaxes")
    return Recognised("run", kept, "a flow at a given rate, over time")


def _steps(rate: Float[np.ndarray, " n"]) -> bool:
    """Return whether every row has another rate, in order, over a factor of three or more."""
    size = np.abs(rate)
    if len(rate) < _FEWEST or np.any(size == 0.0) or not (np.all(rate > 0) or np.all(rate < 0)):
        return False
    steps = np.diff(np.log(size))
    larger = np.abs(steps) > 0.01
    one_way = max(np.mean(steps[larger] > 0), np.mean(steps[larger] < 0)) if larger.any() else 0.0
    return bool(np.mean(larger) > 0.9 and one_way > 0.9 and size.max() > 3.0 * size.min())


def _rougher(time, answer, imposed) -> bool:
    """Return whether one record is rougher than another by a factor of ten."""

    def roughness(values):
        middle = np.interp(time[1:-1], time[::2], values[::2])
        return np.median(np.abs(values[1:-1] - middle)) / (np.ptp(values) or 1.0)

    return bool(roughness(answer) > 10.0 * roughness(imposed))
