"""What a day in the laboratory does to a session of runs: by scipy for `hostile_fluids.py`."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from hostile_fluids_laboratory import Change
from hostile_fluids_records import FLOWS, GIESEKUS, Record, Sampled, recorded
from independent import start_up
from independent.material import RateLaw
from independent.noise import rms
from scipy.interpolate import UnivariateSpline

Export = Callable[[dict[str, Record]], dict[str, Record]]


def grown(rates: Mapping[str, float]) -> Change:
    """Return the change of a stress whose modulus grows so much a second in each run: it dries."""

    def change(name: str, run: Record) -> Record:
        time, stress = run.columns["time_s"], run.columns["stress_Pa"]
        told = stress * (1 + rates.get(name, 0.0) * time)
        return replace(run, columns={**run.columns, "stress_Pa": told})

    return change


def partly_broken(lost: float, strain: float) -> Change:
    """Return the change of a stress behind an edge that loses a share of its area beyond a strain.

    Only start-ups go so far.
    """

    def change(name: str, run: Record) -> Record:
        if name == "wave.csv":
            return run
        gone = run.columns["time_s"] * np.abs(run.columns["shear_rate_1_s"])
        left = 1 - lost / (1 + np.exp(-(gone - strain) / 0.8))
        return replace(run, columns={**run.columns, "stress_Pa": run.columns["stress_Pa"] * left})

    return change


def at_zero(zeros: Mapping[str, float]) -> Change:
    """Return the change of a stress whose zero was set anew, in Pa, before each run."""

    def change(name: str, run: Record) -> Record:
        told = run.columns["stress_Pa"] + zeros.get(name, 0.0)
        return replace(run, columns={**run.columns, "stress_Pa": told})

    return change


def interpolated_onto(
    points: int, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS, interval: float = 0.1
):
    """Return the maker of runs recorded evenly in time and exported evenly in log t.

    By straight lines between the samples, the first of which is no stress at no time.
    """
    even = {
        name: (flow, np.arange(1, round(times[-1] / interval) + 1) * interval)
        for name, (flow, times) in flows.items()
    }

    def make() -> dict[str, Record]:
        made = {}
        for name, run in recorded(law, even)().items():
            known = np.append(0.0, run.columns["time_s"])
            times = np.geomspace(0.02, known[-1], points)
            told = np.interp(times, known, np.append(0.0, run.columns["stress_Pa"]))
            rate = np.asarray(flows[name][0].rate(times), float) + 0.0 * times
            columns = {"time_s": times, "shear_rate_1_s": rate, "stress_Pa": told}
            normal = [np.interp(times, known, np.append(0.0, n)) for n in (run.N1, run.N2)]
            made[name] = replace(run, columns=columns, N1=normal[0], N2=normal[1])
        return made

    return make


def between(points: int, interval: float = 0.1, size: float = 0.01):
    """Return noise of even samples, as straight lines carry it to times evenly in log t.

    The last time is that of the start-ups, or of the wave where there are more values than theirs.
    """

    def put(stress, lot):
        end = FLOWS["slow.csv"][1][-1]
        known = np.arange(0, round(end / interval) + 1) * interval
        white = np.append(0.0, lot.standard_normal(len(known) - 1))
        told = np.interp(np.geomspace(0.02, end, points), known, white)
        return stress + size * rms(stress) * told

    return put


def without_wave(flows: Sampled = FLOWS) -> Sampled:
    """Return the flows with a third start-up in place of the wave."""
    starts = {name: flow for name, flow in flows.items() if name != "wave.csv"}
    return {**starts, "third.csv": (start_up(1.0), flows["fast.csv"][1])}


def of_blocks(every: int, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs of which so many neighbours each are told as their mean."""
    fine = {
        name: (
            flow,
            times[0] / every + np.arange(len(times) * every) * (times[1] - times[0]) / every,
        )
        for name, (flow, times) in flows.items()
    }

    def make() -> dict[str, Record]:
        made = {}
        for name, run in recorded(law, fine)().items():
            blocks = {k: v.reshape(-1, every).mean(axis=1) for k, v in run.columns.items()}
            flow = flows[name][0]
            blocks["shear_rate_1_s"] = np.asarray(flow.rate(blocks["time_s"]), float) + np.zeros(
                len(blocks["time_s"])
            )
            normal = [n.reshape(-1, every).mean(axis=1) for n in (run.N1, run.N2)]
            made[name] = replace(run, columns=blocks, N1=normal[0], N2=normal[1])
        return made

    return make


def splined(size: float = 0.01):
    """Return noise that was smoothed by a cubic spline, as far as its size is to be expected."""

    def put(stress, lot):
        at, sigma = np.arange(len(stress)), size * rms(stress)
        noisy = stress + sigma * lot.standard_normal(len(stress))
        return UnivariateSpline(at, noisy, s=len(stress) * sigma**2)(at)

    return put


def moving_mean(width: int, size: float = 0.01):
    """Return noise as the mean over so many neighbours leaves it, of fewer at the ends."""

    def put(stress, lot):
        noisy = stress + size * rms(stress) * lot.standard_normal(len(stress))
        ones = np.convolve(np.ones(len(stress)), np.ones(width), "same")
        return np.convolve(noisy, np.ones(width), "same") / ones

    return put


def copied(which: str, to: str) -> Export:
    """Return an export that has one run under two names, digit by digit."""

    def export(runs: dict[str, Record]) -> dict[str, Record]:
        return {**runs, to: runs[which]}

    return export


def recorded_again(which: str, to: str, places: int = 3) -> Export:
    """Return an export that has one run under two names, once with fewer digits."""

    def export(runs: dict[str, Record]) -> dict[str, Record]:
        run = runs[which]
        stress = np.array([float(f"{v:.{places}g}") for v in run.columns["stress_Pa"]])
        return {**runs, to: replace(run, columns={**run.columns, "stress_Pa": stress})}

    return export


def filled_up(end: float, names: tuple[str, ...], last: bool) -> Export:
    """Return an export of runs that stopped early, filled with their last value or with zeros."""

    def export(runs: dict[str, Record]) -> dict[str, Record]:
        made = dict(runs)
        for name in names:
            run = runs[name]
            stress, over = run.columns["stress_Pa"].copy(), run.columns["time_s"] > end
            stress[over] = stress[~over][-1] if last else 0.0
            made[name] = replace(run, columns={**run.columns, "stress_Pa": stress})
        return made

    return export


def by_largest(names: tuple[str, ...] = tuple(FLOWS), unit: float = 100.0) -> Change:
    """Return the change of a stress told over its own largest value, times one number."""

    def change(name: str, run: Record) -> Record:
        if name not in names:
            return run
        stress = run.columns["stress_Pa"]
        told = unit * stress / np.max(np.abs(stress))
        return replace(run, columns={**run.columns, "stress_Pa": told})

    return change
