"""Waveforms: oscillations sample by sample, where exports hide them.

RheoCompass writes the samples of each point below it, in columns of their own, with the number of
the point left empty and often without a time. MITlaos and SPP take tables without names: time,
strain and stress, and time, strain, rate and stress   [Ewoldt, Hosoi & McKinley 2008, J. Rheol. 52,
1427; Donley, Singh, Shetty & Rogers 2020, PNAS 117, 21945].
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.oscillations import alternates, frequency_of
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number

_FEWEST = 32
_HARMONICS = 9
_DERIVATIVE = 0.05
"""Misfit of a column to the derivative of another, over its size, up to which it is its rate."""


def waves_of(block: Block, mapping: Mapping, name: str) -> list[Block]:
    """Return the waveforms that stand beside the summary of an oscillation, a block for each point.

    Time is counted from the first sample. Where the export gives none, the samples are whole cycles
    at the frequency of the point, closed with the first sample, and the rate is the derivative of
    the Fourier series, without harmonics that are noise.
    """
    readings = Readings.of(block, mapping, name)
    if not {"strain_wave", "stress_wave"} <= set(readings.columns):
        return []
    strain, stress = readings.get("strain_wave"), readings.get("stress_wave")
    assert strain is not None
    assert stress is not None
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
            rate = _derivative(wave, cycles) * slowest
            columns["shear rate"] = ("1/s", np.append(rate, rate[0]))
            wave, answer = np.append(wave, wave[0]), np.append(answer, answer[0])
        else:
            continue
        columns |= {"time": ("s", time), "strain": ("", wave), "stress": ("Pa", answer)}
        found.append(Block.of(columns, f"{block.name} waveform of point {point}".strip()))
    return found


def _derivative(wave: Float[np.ndarray, " n"], cycles: int) -> Float[np.ndarray, " n"]:
    """Return the derivative of whole cycles in the phase of all of them together, in radians."""
    series = np.fft.rfft(wave)
    order = np.arange(len(series))
    kept = order <= _HARMONICS * cycles
    return np.fft.irfft(np.where(kept, 1j * order * series, 0.0), len(wave))


def without_names(rows: Sequence[Sequence[str]]) -> Block | None:
    """Return a table of three or four columns without names as an oscillation; None if it is none.

    Time, strain and stress in SI units, or with the rate before the stress, which is checked to be
    the derivative of the strain.
    """
    filled = [[cell for cell in row if cell] for row in rows]
    numbers = [row for row in filled if row and all(map(is_number, row))]
    if len(numbers) < _FEWEST or len({len(row) for row in numbers}) != 1:
        return None
    if len(numbers) < len([row for row in filled if row]) - 5:
        return None
    values: Float[np.ndarray, "n columns"] = np.array(numbers, dtype=float)
    if values.shape[1] not in (3, 4) or np.any(np.diff(values[:, 0]) <= 0.0):
        return None
    time, strain, stress = values[:, 0], values[:, 1], values[:, -1]
    if not (alternates(strain) and alternates(stress)):
        return None
    omega = frequency_of(time, strain)
    fit = np.stack([np.ones(len(time)), np.cos(omega * time), np.sin(omega * time)], axis=1)
    left = strain - fit @ np.linalg.lstsq(fit, strain, rcond=None)[0]
    if np.std(left) > _DERIVATIVE * np.std(strain):
        return None  # the second column is no imposed sine
    named = {"time": ("s", time), "strain": ("", strain)}
    if values.shape[1] == 4:
        rate, slope = values[:, 2], np.gradient(strain, time)
        if np.std(rate - slope) > _DERIVATIVE * np.std(slope):
            return None
        named["shear_rate"] = ("1/s", rate)
    return Block.of({**named, "stress": ("Pa", stress)}, "waveform without names")
