"""Tests that are more or less than a block: intervals of one test [Mewis & Wagner 2009], waves."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from discover.dataset.importing import series
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.importing.which_test import said_of

_FEWEST = 3  # rows of an interval
Numbered = tuple[int, Block]
_SAME_RATE, _ANOTHER_RATE = 1.3, 5.0
_SAME_STRESS = 0.1  # over the stress: an interval repeats another, and starts as that did


def joined_intervals(blocks: Sequence[Numbered], mapping: Mapping, file: str) -> list[Numbered]:
    """Return numbered blocks of a file, those that are intervals of one thixotropy test as one.

    By words, three rates of which the last is the first, or rates up and down that differ in
    stress.
    """
    left, found = list(blocks), []
    while left:
        number, first = left[0]
        several: list[Block] = []
        for at, block in left:  # as many as have the same columns and are nobody's choice
            chosen = mapping.test_of(file, at)
            # an import that is repeated knows the whole by the number of its first interval
            free = chosen is None or (not several and chosen == "run")
            if not free or (several and block.apart) or block.columns != first.columns:
                break
            several.append(block)
        count = max(_how_many(several, mapping, file), 1)
        found.append((number, first if count < 2 else _as_one(several[:count], mapping, file)))
        left = left[count:]
    return found


def _how_many(blocks: Sequence[Block], mapping: Mapping, file: str) -> int:
    """Return how many of these blocks, from the first on, are one test."""
    if len(blocks) < 2:
        return 0
    said = said_of(blocks[0], file)
    all_are = said is not None and said.test in ("loop", "intervals")
    ways: list[tuple[np.ndarray, np.ndarray]] = []  # rates and stresses
    for block in blocks if all_are else blocks[:3]:
        readings = Readings.of(block, mapping, file)
        rate, stress = map(readings.unless_wrong, ("shear_rate", "stress"))
        if rate is None or stress is None or readings.has("omega", "Gp"):
            break
        kept = np.isfinite(rate) & np.isfinite(stress)
        if np.sum(kept) < _FEWEST:
            break
        ways.append((rate[kept], stress[kept]))
    if all_are:
        return len(ways)
    if len(ways) > 1 and _is_loop(*ways[:2]):
        return 2
    return 3 if len(ways) == 3 and _recovers(ways) else 0


def _recovers(ways: Sequence[tuple[np.ndarray, np.ndarray]]) -> bool:
    """Return whether the third rate is the first again, after another, and what it does is not."""
    first, second, third = (
        float(np.median(rate)) if series.spread(rate) < series.CONSTANT else 0.0 for rate, _ in ways
    )
    if second and _is_loop(ways[0], ways[2]):
        return True
    if not (first and second and third) or min(first / third, first / second) <= 0.0:
        return False
    again, other = abs(np.log(first / third)), abs(np.log(first / second))
    if again > np.log(_SAME_RATE) or other < np.log(_ANOTHER_RATE):
        return False
    before, after = ways[0][1], ways[2][1]
    both = min(len(before), len(after))
    apart = np.median(np.abs(before[:both] - after[:both]))
    return bool(apart > _SAME_STRESS * np.max(np.abs(before)))


def _is_loop(up: tuple[np.ndarray, np.ndarray], down: tuple[np.ndarray, np.ndarray]) -> bool:
    if not (series.every_row_differs(up[0]) and series.every_row_differs(down[0])):
        return False
    both = series.up_and_down(*(np.concatenate(pair) for pair in zip(up, down, strict=True)))
    return both is not None and both.apart


def _as_one(blocks: Sequence[Block], mapping: Mapping, file: str) -> Block:
    """Return intervals one after the other; a clock that starts again goes on."""
    first = blocks[0]
    at = Readings.of(first, mapping, file).columns.get("time")
    cells: list[tuple[str, ...]] = []
    last = 0.0
    for block in blocks:
        times = [float(row[at]) for row in block.cells if at is not None and is_number(row[at])]
        begin = last if times and cells and times[0] <= last else 0.0
        for row in block.cells:
            if at is not None and is_number(row[at]):
                last = begin + float(row[at])
                row = (*row[:at], repr(last), *row[at + 1 :])
            cells.append(row)
    name = " to ".join(dict.fromkeys(block.name for block in (first, blocks[-1]) if block.name))
    return replace(first, name=name, cells=tuple(cells))


_FEWEST_OF_WAVE = 32

# RheoCompass writes the samples of each point below it, in columns of their own, with the number of
# the point left empty and often without a time.


def waves_of(readings: Readings) -> Iterator[Block]:
    """Yield the waveforms that stand beside the summary of an oscillation, a block for each point.

    Without a time samples are whole cycles, and the rate is the Fourier series' derivative.
    """
    strain, stress = readings.alone("strain_wave"), readings.alone("stress_wave")
    if strain is None or stress is None:
        return
    clock, omega = readings.get("wave_time"), readings.get("omega")
    raw = np.isfinite(strain) & np.isfinite(stress)
    # samples follow the line of their point, which may hold the first of them
    summary = ~raw if omega is None else np.isfinite(omega)
    points = np.cumsum(summary)
    for point in np.unique(points[raw]):
        rows = raw & (points == point)
        wave, answer = strain[rows], stress[rows]
        columns: dict[str, tuple[str, np.ndarray]] = {}
        if np.sum(rows) < _FEWEST_OF_WAVE or not series.alternates(wave):
            continue
        if clock is not None and np.isfinite(clock[rows]).all():
            time = clock[rows] - clock[rows][0]
        elif omega is not None and summary.any():
            spectrum = np.fft.rfft(wave)  # of whole cycles; the derivative in the phase of all
            order = np.arange(len(spectrum))
            cycles = int(np.argmax(np.abs(spectrum[1:]))) + 1
            slowest = float(omega[summary][point - 1]) / cycles
            time = np.linspace(0.0, 2.0 * np.pi / slowest, len(wave) + 1)
            kept = np.where(order <= series.HARMONICS * cycles, 1j * order * spectrum, 0.0)
            rate = np.fft.irfft(kept, len(wave)) * slowest
            columns["shear rate"] = ("1/s", np.append(rate, rate[0]))
            wave, answer = np.append(wave, wave[0]), np.append(answer, answer[0])
        else:
            continue
        columns |= {"time": ("s", time), "strain": ("", wave), "stress": ("Pa", answer)}
        yield Block.of(columns, f"{readings.block.name} waveform of point {point}".strip())
