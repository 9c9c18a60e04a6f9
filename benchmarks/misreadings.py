"""How often a fault of reading is seen where there is one, and where there is none.

    python benchmarks/misreadings.py

Two tables of docs/verdicts.md, by the statistic alone: start-ups and an oscillation of a Giesekus
fluid by scipy, of which three runs are fitted and one is held out. The mobility is fitted to first
order, and with it the test of `discover.statistics.misread` is asked.
"""

import argparse
from collections.abc import Mapping

import numpy as np
from hostile_fluids_materials import autoregressive, heavy, proportional, white
from hostile_fluids_records import FLOWS, GIESEKUS, SCALE
from independent import Giesekus
from independent.noise import rms

from discover.statistics.misread import CLEAR, POSSIBLE, Misread, misread
from discover.statistics.reading_faults import Reading

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


def ask(records: Mapping[str, np.ndarray]) -> tuple[float, float, Misread, Misread]:
    """Return the error of the mobility, half of its interval, and the faults of fitted and all."""
    left = np.concatenate([(records[n] - EXACT[n]) / rms(records[n]) for n in FITTED])
    slope = np.concatenate([SLOPES[n] / rms(records[n]) for n in FITTED])
    error = float(slope @ left / (slope @ slope))
    noise = np.sqrt(np.mean((left - error * slope) ** 2))
    half = float(1.96 * noise / np.sqrt(slope @ slope))
    runs = {}
    for name, (_, times) in FLOWS.items():
        predicted = EXACT[name] + error * SLOPES[name]
        runs[name] = Reading(times, predicted, predicted - records[name], SLOPES[name][None])
    fitted = misread([runs[name] for name in FITTED])
    every = misread(list(runs.values()))
    assert fitted is not None
    assert every is not None
    return error, half, fitted, every


def is_refuted(fitted: Misread, every: Misread) -> bool:
    """Return whether a comparison would say that the records were read otherwise."""
    return 2 * min(fitted.probability, every.probability) <= CLEAR


def of_a_range(size: float, draws: int) -> str:
    """Return what is said where a range reads more by `size`, as a row of a table."""
    refuted = wider = holds = far = 0
    for seed in range(draws):
        lot = np.random.default_rng([seed, 9])
        read = {n: EXACT[n] * (1 + size * (np.abs(EXACT[n]) > LEVEL)) for n in FLOWS}
        noisy = {n: read[n] + 0.01 * rms(read[n]) * lot.standard_normal(len(read[n])) for n in read}
        error, half, fitted, every = ask(noisy)
        if is_refuted(fitted, every):
            refuted += 1
            continue
        low, high = error - half, error + half
        if fitted.probability <= POSSIBLE:
            wider += 1
            moved = float(fitted.steps[0])
            low, high = min(low, low + moved), max(high, high + moved)
        holds += low <= 0.0 <= high
        far += abs(error) > 1.5 * (high - low)
    left = draws - refuted
    return (
        f"{size:.2%} | {refuted} of {draws} | {wider} | {left - wider} | {holds} of {left} | {far}"
    )


def of_noise(kind: str, draws: int) -> str:
    """Return what is said of a right law in a kind of noise, as a row of a table."""
    refuted = wider = 0
    for seed in range(draws):
        lot = np.random.default_rng([seed, 5])
        _, _, fitted, every = ask({name: NOISES[kind](EXACT[name], lot) for name in FLOWS})
        refuted += is_refuted(fitted, every)
        wider += fitted.probability <= POSSIBLE
    return f"{kind} | {refuted} of {draws} | {wider}"


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=100)
    options = parser.parse_args()
    print("reads more by | unexplained | wider | as before | holds | off by 3 half-widths")
    for size in SIZES:
        print(of_a_range(size, options.draws), flush=True)
    print("\nnoise | unexplained | wider")
    for kind in NOISES:
        print(of_noise(kind, options.draws), flush=True)


if __name__ == "__main__":
    main()
