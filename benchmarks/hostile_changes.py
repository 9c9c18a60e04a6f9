"""What hostile data sets do to records: changes of runs, tables beside them, exports, noises."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from hostile_records import (
    FLOWS,
    GIESEKUS,
    SAMPLED,
    Change,
    Record,
    Runs,
    Tables,
    recorded,
)
from independent import Material, RateLaw, start_up, steps
from independent.folders import maxwell_sweep
from independent.noise import rms
from independent.sweeps import modulus_of

Columns = Mapping[str, np.ndarray]
Told = Callable[[str, np.ndarray, np.ndarray, Columns], np.ndarray]
"""From the run's name, its times and stresses and all its columns: the stress that is told."""


def of_stress(told: Told, silent: bool = False) -> Change:
    """Return the change of a stress; with `silent` there is no fluid in it."""

    def change(name: str, run: Record) -> Record:
        c = run.columns
        run = run.told(stress_Pa=told(name, c["time_s"], c["stress_Pa"], c))
        return replace(run, N1=None, N2=None) if silent else run

    return change


def _fractured(n, t, s, c):
    """Return the stress behind an edge that loses a third of its area over a strain of 1."""
    rate = np.abs(c["shear_rate_1_s"])
    first = rate[0] * t[0]
    strain = np.concatenate([[first], first + np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t))])
    return s * (1 - 0.33 / (1 + np.exp(-(strain - 5.0) / 0.4)))


def _wobbling(n, t, s, c):
    """Return the stress on a cone that wobbles by 5 %, once in a strain of 20."""
    strain = np.cumsum(c["shear_rate_1_s"] * np.diff(t, prepend=0.0))
    return s * (1 + 0.05 * np.sin(2 * np.pi * strain / 20.0))


def _at_edge(lost, strain):
    """Return a stress behind an edge that loses some area beyond a strain of start-ups."""

    def told(n, t, s, c):
        gone = t * np.abs(c["shear_rate_1_s"])
        return s if n == "wave.csv" else s * (1 - lost / (1 + np.exp(-(gone - strain) / 0.8)))

    return told


def _age(n, t, each):
    return each * list(FLOWS).index(n) + t


STRESSES: dict[str, Callable] = {
    "line": lambda at_rest, slope: lambda n, t, s, c: at_rest + slope * t,
    "hum": lambda size, hertz: lambda n, t, s, c: size * np.sin(2 * np.pi * hertz * t),
    "negative": lambda n, t, s, c: -s,
    "plus": lambda offset: lambda n, t, s, c: offset + s,
    "fractured": _fractured, "wobbling": _wobbling, "partly_broken": _at_edge,
    "drying": lambda n, t, s, c: s * (1 + 0.1 * np.sqrt(t)),
    "times_stress": lambda factors: lambda n, t, s, c: s * factors.get(n, 1.0),
    "at_zero": lambda zeros: lambda n, t, s, c: s + zeros.get(n, 0.0),
    "grown": lambda rates: lambda n, t, s, c: s * (1 + rates.get(n, 0.0) * t),
    "range_switch": lambda more: lambda n, t, s, c: s * (1 + more * (np.abs(s) > 50.0)),
    "dried": lambda n, t, s, c: s * (1 + 0.002 * _age(n, t, 10.0)),
    "cooled": lambda n, t, s, c: s * (1 + 0.05 * t / 8.0),
    "gain_by_decade": lambda n, t, s, c: (
        s * (1 + 0.02 * np.floor(np.log10(np.maximum(np.abs(s), 1.0))))
    ),
    "saturating": lambda level: lambda n, t, s, c: level * np.tanh(s / level),
    "spliced": lambda at, more: lambda n, t, s, c: s * (1 + more * (t < at)),
    "humming": lambda size, hertz: lambda n, t, s, c: (
        s + size * np.sin(2 * np.pi * hertz * t + sum(map(ord, n)))
    ),
    "sticking": lambda n, t, s, c: (
        s if n != "fast.csv" else s * (1 - 0.06 * ((t / 0.7) % 1.0) * (s > 60.0))
    ),
    "rested": lambda shares: lambda n, t, s, c: s * (1 - shares[n] * np.exp(-t / 4.0)),
    # a solvent whose particles settle while the session lasts
    "settling": lambda: lambda n, t, s, c: (
        s + 8.0 * np.exp(-_age(n, t, 12.0) / 25.0) * c["shear_rate_1_s"]
    ),
    "by_largest": lambda names=tuple(FLOWS): lambda n, t, s, c: (
        100.0 * s / np.max(np.abs(s)) if n in names else s
    ),
}  # fmt: skip
"""What is told of a stress; where a name takes numbers, it makes that."""


def mislabelled(which: str, factor: float) -> Change:
    def change(name: str, run: Record) -> Record:
        told = run.told(shear_rate_1_s=run.columns["shear_rate_1_s"] * factor)
        return replace(told, N1=None, N2=None) if name == which else run

    return change


def later_zero(begin: float) -> Change:
    """Return the change of a record whose clock was started after the flow."""

    def change(name: str, run: Record) -> Record:
        kept = run.kept(run.columns["time_s"] > begin)
        return kept.told(time_s=kept.columns["time_s"] - begin)

    return change


def without(low: float, high: float, names: Sequence[str]) -> Change:
    def change(name: str, run: Record) -> Record:
        time = run.columns["time_s"]
        return run.kept((time < low) | (time > high)) if name in names else run

    return change


def clock(factor: float, names: Sequence[str]) -> Change:
    def change(name: str, run: Record) -> Record:
        return run.told(time_s=run.columns["time_s"] * factor) if name in names else run

    return change


def in_minutes(name: str, run: Record) -> Record:
    return run.told(time_s=run.columns["time_s"] / 60.0) if name == "fast.csv" else run


def with_strain(offset: float) -> Change:
    def change(name: str, run: Record) -> Record:
        flow, times = FLOWS[name]
        return run.told(strain=flow.strain(times) + offset)

    return change


def with_first_difference(told: Callable[[np.ndarray, Record], np.ndarray]) -> Change:
    """Return the change of a record that has N1 too, as it is told, with 1 % noise."""

    def change(name: str, run: Record) -> Record:
        lot, read = np.random.default_rng(sum(map(ord, name))), told(run.columns["time_s"], run)
        read = read + 0.01 * np.sqrt(np.mean(run.N1**2)) * lot.standard_normal(len(read))
        return run.told(N1_Pa=read)

    return change


FIRST_DIFFERENCES: dict[str, Callable] = {
    "as_read": lambda offset, gain: lambda times, run: gain * run.N1 + offset,
    # the inertia of the fluid takes a part in proportion to the rate squared
    "thrown_out": lambda size: (
        lambda times, run: run.N1 - size * run.columns["shear_rate_1_s"] ** 2
    ),
    "n1_less_n2": lambda times, run: run.N1 - run.N2,  # what the thrust of parallel plates tells
    "expanding": lambda size, time: lambda times, run: run.N1 + size * -np.expm1(-times / time),
}


def late_axially(lag: float):
    """Return N1 behind a soft axis: it follows with a time."""

    def told(times: np.ndarray, run: Record) -> np.ndarray:
        out, last, before = np.zeros(len(times)), 0.0, 0.0
        for i, (t, value) in enumerate(zip(times, run.N1, strict=True)):
            last = value + (last - value) * np.exp(-(t - before) / lag)
            out[i], before = last, t
        return out

    return told


def digitised(law: RateLaw, jitter: float = 0.01) -> Runs:
    """Return curves that a hand read from a plot: times that are off, too."""
    lot, made = np.random.default_rng(21), {}
    for name, run in recorded(law, SAMPLED["LOGARITHMIC"]).items():
        times = run.columns["time_s"]
        made[name] = run.told(time_s=times * np.exp(jitter * lot.standard_normal(len(times))))
    return made


def noisy_rates(size: float) -> Runs:
    """Return runs whose rate is told as measured, with noise of a share of it."""
    lot, made = np.random.default_rng(12), {}
    for name, run in recorded(GIESEKUS).items():
        rate = run.columns["shear_rate_1_s"]
        noise = size * rms(rate) * lot.standard_normal(len(rate))
        made[name] = run.told(shear_rate_1_s=rate + noise)
    return made


def shifted(factors: Mapping[str, Sequence[float]]) -> Runs:
    """Return runs at several temperatures by factors of time that are told, and that are true."""
    from hostile_records import warmed

    runs = warmed({name: true / told for name, (told, true) in factors.items()})()
    return {n: replace(run, cells={"a_T": factors[n][0]}) for n, run in runs.items()}


# tables beside the runs

_RATES = np.geomspace(0.05, 20.0, 30)
THREE_TIMES, THREE_MODULI = (10.0, 1.0, 0.1), (20.0, 60.0, 120.0)


def swept(law: RateLaw) -> Tables:
    """Return an amplitude sweep at 1 rad/s."""
    strains = np.geomspace(0.05, 6.0, 20)
    found = np.array([modulus_of(law, strain, 1.0, 6) for strain in strains])
    columns = {"strain": strains, "omega_rad_s": np.ones(20)}
    return {"amplitude_sweep.csv": {**columns, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}


def _steady(law: Material, rates: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    return np.array([law.respond(start_up(r), np.array(ends)).sigma12[-1] for r in rates])


def _curve(rates: np.ndarray, stress: np.ndarray):
    return {"flow_curve.csv": {"shear_rate_1_s": rates, "stress_Pa": stress}}


def banded(law: RateLaw, solvent: float = 5.0) -> Tables:
    """Return a flow curve with a plateau between two branches, as bands have it."""
    rates = np.geomspace(0.05, 50.0, 30)
    stress = _steady(law, rates, [60.0, 90.0]) + solvent * rates
    top = 0.9 * float(np.max(stress[rates < 3.0]))
    first, last = np.argmax(stress > top), np.flatnonzero(stress < top)[-1]
    stress[first : max(last + 1, first)] = top
    return _curve(rates, stress)


def apparent(law: RateLaw) -> Tables:
    """Return a flow curve of a capillary at rates as of a Newtonian fluid."""
    rates = np.geomspace(1e-3, 20.0, 120)
    stress = _steady(law, rates, [20.0, 60.0])
    both, wall = np.append(0.0, stress**2 * rates), np.append(0.0, stress)
    through = np.append(0.0, np.cumsum((both[1:] + both[:-1]) / 2 * np.diff(wall)))[1:]
    told, kept = 4 * through / stress**3, np.searchsorted(rates, _RATES[:-1])
    return _curve(told[kept], stress[kept])


def sweep_at(law: RateLaw, strain: float) -> Tables:
    """Return a sweep at a strain that is not small, told as linear."""
    omega = np.geomspace(0.03, 50.0, 17)
    found = np.array([modulus_of(law, strain, w, 8) for w in omega])
    return {"lve.csv": {"omega_rad_s": omega, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}


def sweep_of(
    moduli: Sequence[float], times: Sequence[float], low=0.01, high=100.0, points=33
) -> Tables:
    """Return a linear sweep of Maxwell modes."""
    omega = np.geomspace(low, high, points)
    return {"lve.csv": maxwell_sweep(np.array(moduli), np.array(times), omega)}


_HASTE = np.arange(len(_RATES))
TABLES: dict[str, Callable] = {
    "curve": lambda law: _curve(_RATES, _steady(law, _RATES, [30.0, 60.0])),
    # swept upwards, with a second for each point
    "in_haste": lambda law: _curve(
        _RATES, law.respond(steps(1.0 * _HASTE, _RATES), 1.0 * _HASTE + 0.999).sigma12
    ),
    # a curve that nobody measured: |η*| of one mode
    "by_cox_and_merz": lambda modulus, time: _curve(
        _RATES, modulus * time * _RATES / np.sqrt(1 + (time * _RATES) ** 2)
    ),
}


# what becomes of runs that have their noise


def copied(runs: Runs, which: str, to: str, places: int = 0) -> Runs:
    """Return runs of which one has two names, once with fewer digits."""
    stress = runs[which].columns["stress_Pa"]
    told = np.array([float(f"{v:.{places}g}") for v in stress]) if places else stress
    return {**runs, to: runs[which].told(stress_Pa=told)}


def filled_up(runs: Runs, end: float, names: Sequence[str], last: bool) -> Runs:
    """Return runs that stopped early, filled with their last value or with zeros."""
    made = dict(runs)
    for name in names:
        stress = runs[name].columns["stress_Pa"].copy()
        over = runs[name].columns["time_s"] > end
        stress[over] = stress[~over][-1] if last else 0.0
        made[name] = runs[name].told(stress_Pa=stress)
    return made


OF_NAMES = STRESSES, FIRST_DIFFERENCES, TABLES
