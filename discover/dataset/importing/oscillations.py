"""Oscillations sample by sample: of what, from which start, and where exports hide them."""

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block
from discover.dataset.run_table import wave_of

Values = Float[np.ndarray, " n"]

_FEWEST_SAMPLES = 20
_HARMONICS = 9
_SINE = 0.005  # higher harmonics over the first, up to which a record is a sine
_AS_BEFORE = 0.05  # difference over the amplitude, up to which one cycle repeats another
# share of a period within which a fluid from rest has no stress yet, unless it answers at once
_AT_ONCE = 0.02
_FAR = 0.3
_WHOLE = 1e-3  # share of a period up to which a record is as long as one
_FEWEST = 32


def alternates(values: Values) -> bool:
    """Return whether a record swings to and fro about its middle, once at least."""
    if len(values) < _FEWEST_SAMPLES or not np.all(np.isfinite(values)) or not np.ptp(values):
        return False
    low, high = np.min(values), np.max(values)
    if min(high, -low) < 0.3 * max(high, -low):  # one sign: a start-up that overshoots, a ramp
        return False
    outer = np.abs(values) > 0.3 * (high - low) / 2.0
    signs = np.sign(values[outer])
    turns = int(np.sum(signs[1:] != signs[:-1]))
    # a sine spends 0.8 of its time there, noise about zero changes sign from sample to sample
    return turns >= 1 and turns < 0.25 * len(signs) and float(np.mean(outer)) > 0.5


def _harmonics(time: Values, values: Values, omega: float) -> Float[np.ndarray, " harmonics"]:
    """Return the amplitudes of the Fourier series that fits a record best."""
    phases = omega * time[:, None] * np.arange(1, _HARMONICS + 1)
    design = np.concatenate([np.cos(phases), np.sin(phases), np.ones((len(time), 1))], axis=1)
    found, *_ = np.linalg.lstsq(design, values, rcond=None)
    return np.hypot(found[:_HARMONICS], found[_HARMONICS:-1])


def purer(time: Values, stress: Values, strain: Values) -> bool:
    """Return whether the stress is a sine and the strain is not, so that the stress was imposed."""
    wave = wave_of(time, stress - np.mean(stress)) if np.all(np.diff(time) > 0.0) else None
    if wave is None or (time[-1] - time[0]) * wave[0] < 2.0 * np.pi * 0.99:
        return False  # no wave, or less than a cycle
    impure = []
    for values in (stress, strain):
        sizes = _harmonics(time, values, wave[0])
        impure.append(float(np.sqrt(np.sum(sizes[1:] ** 2)) / sizes[0]))
    return impure[0] < _SINE and impure[1] > 4.0 * impure[0] and impure[1] > 2.0 * _SINE


def goes_on(time: Values, imposed: Values, answer: Values) -> bool:
    """Whether strain and stress, in either role, begin in steady alternation, not from rest."""
    wave, size = wave_of(time, imposed - np.mean(imposed)), float(np.max(np.abs(answer)))
    if wave is None or size == 0.0:
        return False
    period, step = 2.0 * np.pi / wave[0], float(np.median(np.diff(time)))
    if time[-1] - time[0] + step < period * (1.0 - _WHOLE):
        return False
    if time[0] < _AT_ONCE * period and abs(answer[0]) > _FAR * size:
        return True
    first = time - time[0] < 0.2 * period
    later = time[first] + period
    inside = later <= time[-1]
    if not inside.any():  # one cycle alone: its ends meet, or would with the next sample
        ahead = (time[0] + period - time[-1]) / step
        end = answer[-1] + ahead * 0.5 * (3.0 * answer[-1] - 4.0 * answer[-2] + answer[-3])
        return bool(abs(answer[0] - end) < _AS_BEFORE * size)
    again = np.interp(later[inside], time, answer)
    return bool(np.max(np.abs(answer[first][inside] - again)) < _AS_BEFORE * size)


# RheoCompass writes the samples of each point below it, in columns of their own, with the number of
# the point left empty and often without a time.


def waves_of(readings: Readings) -> list[Block]:
    """Return the waveforms that stand beside the summary of an oscillation, a block for each point.

    Time is counted from the first sample. Where the export gives none, the samples are whole cycles
    at the frequency of the point, closed with the first sample, and the rate is the derivative of
    the Fourier series, without harmonics that are noise.
    """
    strain, stress = readings.alone("strain_wave"), readings.alone("stress_wave")
    if strain is None or stress is None:
        return []
    clock, omega = readings.get("wave_time"), readings.get("omega")
    raw = np.isfinite(strain) & np.isfinite(stress)
    # samples follow the line of their point, which may hold the first of them
    summary = ~raw if omega is None else np.isfinite(omega)
    points = np.cumsum(summary)
    found = []
    for point in np.unique(points[raw]):
        rows = raw & (points == point)
        wave, answer = strain[rows], stress[rows]
        columns: dict[str, tuple[str, np.ndarray]] = {}
        if np.sum(rows) < _FEWEST or not alternates(wave):
            continue
        if clock is not None and np.isfinite(clock[rows]).all():
            time = clock[rows] - clock[rows][0]
        elif omega is not None and summary.any():
            frequency = float(omega[summary][point - 1])
            cycles = int(np.argmax(np.abs(np.fft.rfft(wave)[1:]))) + 1
            slowest = frequency / cycles
            time = np.arange(np.sum(rows) + 1) / np.sum(rows) * 2.0 * np.pi / slowest
            series = np.fft.rfft(wave)  # of whole cycles; the derivative in the phase of all
            order = np.arange(len(series))
            kept = np.where(order <= _HARMONICS * cycles, 1j * order * series, 0.0)
            rate = np.fft.irfft(kept, len(wave)) * slowest
            columns["shear rate"] = ("1/s", np.append(rate, rate[0]))
            wave, answer = np.append(wave, wave[0]), np.append(answer, answer[0])
        else:
            continue
        columns |= {"time": ("s", time), "strain": ("", wave), "stress": ("Pa", answer)}
        name = f"{readings.block.name} waveform of point {point}".strip()
        found.append(Block.of(columns, name))
    return found
