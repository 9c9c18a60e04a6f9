"""How often a fault of reading is seen where there is one, and where there is none.

    python benchmarks/misreadings.py

Two tables of docs/hostile.md, by the statistic alone: start-ups and an oscillation of a Giesekus
fluid by scipy, of which three runs are fitted and one is held out. The mobility is fitted to first
order, and with it the test of `discover.statistics.reading.misread` is asked.
"""

import argparse
from collections.abc import Mapping

import numpy as np
from hostile_fluids_materials import autoregressive, heavy, proportional, white
from hostile_fluids_records import FLOWS, GIESEKUS, SCALE
from independent import Giesekus
from independent.noise import rms

from discover.statistics.reading.misread import CLEAR, POSSIBLE, Misread, misread
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.reading.small_faults import small_faults

MOBILITY, STEP = GIESEKUS.mobility, 1e-3
HELD_OUT = "held.csv"
LEVEL = 50.0  # Pa, from which on a range reads more
SIZES = (0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015)
NOISES = {
    "white, 1 %": white(0.01),
    "of 5 % of each value": proportional(0.05),
    "Student's, 1 %": heavy(0.01),
    "correlated to 0.5": autoregressive(0.02, 0.5),
    "correlated to 0.9": autoregressive(0.02, 0.9),
    "correlated to 0.95": autoregressive(0.02, 0.95),
}


def stresses(mobility: float) -> dict[str, np.ndarray]:
    """Return the stress of each run in Pa."""
    fluid = Giesekus(mobility, **SCALE)
    return {name: fluid.respond(flow, times).sigma12 for name, (flow, times) in FLOWS.items()}


EXACT = stresses(MOBILITY)
_MORE, _LESS = stresses(MOBILITY + STEP), stresses(MOBILITY - STEP)
SLOPES = {name: (_MORE[name] - _LESS[name]) / (2 * STEP) for name in FLOWS}
FITTED = [name for name in FLOWS if name != HELD_OUT]


FAULTS = {
    "a range that reads more above 50 Pa": lambda stress, part, lot, size: (
        stress * (1 + size * (np.abs(stress) > LEVEL))
    ),
    "a factor of each run": lambda stress, part, lot, size: (
        stress * (1 + size * lot.standard_normal())
    ),
    "a zero of each run": lambda stress, part, lot, size: (
        stress + size * rms(stress) * lot.standard_normal()
    ),
    "growth of each run": lambda stress, part, lot, size: (
        stress * (1 + size * lot.standard_normal() * part)
    ),
}


def ask(
    records: Mapping[str, np.ndarray],
) -> tuple[float, float, Misread, Misread, tuple[float, float]]:
    """Return what is said of the mobility, to first order.

    Its error and half of its interval for noise alone, the faults of the fitted runs and of all,
    and the ends of the interval that allows for small faults, about the truth.
    """
    left = np.concatenate([(records[n] - EXACT[n]) / rms(records[n]) for n in FITTED])
    slope = np.concatenate([SLOPES[n] / rms(records[n]) for n in FITTED])
    error = float(slope @ left / (slope @ slope))
    noise = np.sqrt(np.mean((left - error * slope) ** 2))
    half = float(1.96 * noise / np.sqrt(slope @ slope))
    runs = {}
    for name, (_, times) in FLOWS.items():
        predicted = EXACT[name] + error * SLOPES[name]
        runs[name] = Reading(times, predicted, predicted - records[name], SLOPES[name][None])
    seen = [runs[name] for name in FITTED]
    fitted, every, small = misread(seen), misread(list(runs.values())), small_faults(seen)
    assert fitted is not None
    assert every is not None
    assert small is not None
    ends = small.holding(0, error, error - half, error + half)
    if fitted.probability <= POSSIBLE:
        moved = float(fitted.steps[0])
        ends = min(ends[0], error - half + moved), max(ends[1], error + half + moved)
    return error, half, fitted, every, ends


def is_refuted(fitted: Misread, every: Misread) -> bool:
    """Return whether a comparison would say that the records were read otherwise."""
    return 2 * min(fitted.probability, every.probability) <= CLEAR


def of_a_fault(kind: str, size: float, draws: int) -> str:
    """Return what is said where a fault has a size, as a row of a table."""
    refuted = by_noise = holds = far = 0
    halves = []
    for seed in range(draws):
        lot = np.random.default_rng([seed, 9])
        noisy = {}
        for name, (_, times) in FLOWS.items():
            read = FAULTS[kind](EXACT[name], times / times[-1], lot, size)
            noisy[name] = read + 0.01 * rms(read) * lot.standard_normal(len(read))
        error, half, fitted, every, (low, high) = ask(noisy)
        if is_refuted(fitted, every):
            refuted += 1
            continue
        by_noise += abs(error) <= half
        holds += low <= 0.0 <= high
        far += abs(error) > 1.5 * (high - low)
        halves.append((half / MOBILITY, 0.5 * (high - low) / MOBILITY))
    left = draws - refuted
    alone, both = np.median(halves, axis=0) if halves else (np.nan, np.nan)
    return (
        f"{kind} | {size:.2%} | {refuted} of {draws} | {by_noise} of {left} | {alone:.2%} | "
        f"{holds} of {left} | {both:.2%} | {far}"
    )


def of_noise(kind: str, draws: int) -> str:
    """Return what is said of a right law in a kind of noise, as a row of a table."""
    refuted = wider = 0
    for seed in range(draws):
        lot = np.random.default_rng([seed, 5])
        _, _, fitted, every, _ = ask({name: NOISES[kind](EXACT[name], lot) for name in FLOWS})
        refuted += is_refuted(fitted, every)
        wider += fitted.probability <= POSSIBLE
    return f"{kind} | {refuted} of {draws} | {wider}"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=100)
    options = parser.parse_args()
    print(
        "fault | size | unexplained | interval for noise holds | half | interval holds | half | "
        "off by 3 half-widths"
    )
    for kind in FAULTS:
        for size in SIZES if kind == next(iter(FAULTS)) else SIZES[2::2]:
            print(of_a_fault(kind, size, options.draws), flush=True)
    print("\nnoise | unexplained | wider")
    for kind in NOISES:
        print(of_noise(kind, options.draws), flush=True)


if __name__ == "__main__":
    main()
