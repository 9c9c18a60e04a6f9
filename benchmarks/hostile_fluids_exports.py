"""What exports, transducers and sessions do to records: by scipy for `hostile_fluids.py`."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from hostile_fluids_laboratory import Change
from hostile_fluids_records import FLOWS, GIESEKUS, Record, Sampled, _record, recorded
from independent import start_up
from independent.instruments import Instrument
from independent.material import RateLaw
from independent.noise import rms

Noise = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def on_instruments(faults: Mapping[str, Mapping[str, float]], law: RateLaw = GIESEKUS):
    """Return the maker of runs, some of them on instruments with faults, by name."""

    def make() -> dict[str, Record]:
        return {
            name: _record(Instrument(**faults.get(name, {})).record(law, *flow))
            for name, flow in FLOWS.items()
        }

    return make


def averaged_since(width: float, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs whose software told the mean over the last time in s."""

    def make() -> dict[str, Record]:
        made = {}
        for name, (flow, times) in flows.items():
            fine = np.linspace(0.0, times[-1], 6001)
            stress = np.append(0.0, law.respond(flow, fine[1:]).sigma12)
            total = np.append(0.0, np.cumsum((stress[1:] + stress[:-1]) / 2 * np.diff(fine)))
            low = np.maximum(times - width, 0.0)
            mean = (np.interp(times, fine, total) - np.interp(low, fine, total)) / width
            run = _record(Instrument().record(law, flow, times))
            made[name] = replace(run, columns={**run.columns, "stress_Pa": mean})
        return made

    return make


def from_time(make: Callable[[], dict[str, Record]], begin: float):
    """Return the maker of the same runs, of which what comes before a time is left out."""

    def later() -> dict[str, Record]:
        return {name: _kept(run, run.columns["time_s"] >= begin) for name, run in make().items()}

    return later


def without(low: float, high: float, names: tuple[str, ...]) -> Change:
    """Return the change of some runs that lost the samples of a stretch of time."""

    def change(name: str, run: Record) -> Record:
        time = run.columns["time_s"]
        return _kept(run, (time < low) | (time > high)) if name in names else run

    return change


def _kept(run: Record, which: np.ndarray) -> Record:
    columns = {name: values[which] for name, values in run.columns.items()}
    normal = (None, None) if run.N1 is None else (run.N1[which], run.N2[which])
    return replace(run, columns=columns, N1=normal[0], N2=normal[1])


def of_stress(function: Callable[[str, np.ndarray, np.ndarray], np.ndarray]) -> Change:
    """Return the change of a stress that depends on the run, the time and the stress."""

    def change(name: str, run: Record) -> Record:
        told = function(name, run.columns["time_s"], run.columns["stress_Pa"])
        return replace(run, columns={**run.columns, "stress_Pa": told})

    return change


def range_switch(more: float):
    """Return a stress that is read too high above 50 Pa, in another range of the torque."""
    return lambda name, time, stress: stress * (1 + more * (np.abs(stress) > 50.0))


def dried(name: str, time: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Return the stress of a sample that dries, run after run of ten seconds each."""
    return stress * (1 + 0.002 * (10.0 * list(FLOWS).index(name) + time))


def cooled(name: str, time: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Return a stress whose modulus rises by 5 % over 8 s of each run."""
    del name
    return stress * (1 + 0.05 * time / 8.0)


def with_strain(offset: float) -> Change:
    """Return the change of a record that tells the strain too, with an offset."""

    def change(name: str, run: Record) -> Record:
        flow, times = FLOWS[name]
        return replace(run, columns={**run.columns, "strain": flow.strain(times) + offset})

    return change


def twice(which: str, law: RateLaw = GIESEKUS):
    """Return the maker of runs one of which was measured a second time."""

    def make() -> dict[str, Record]:
        runs = recorded(law)()
        return {**runs, "again.csv": runs[which]}

    return make


def interpolated(every: int, size: float = 0.01) -> Noise:
    """Return an export on a fine grid of what was recorded less often: straight lines between."""

    def read(stress, lot):
        at = np.arange(len(stress))
        told = np.unique(np.append(at[::every], at[-1]))
        noisy = stress + size * rms(stress) * lot.standard_normal(len(stress))
        return np.interp(at, told, noisy[told])

    return read


def held_and_rounded(size: float = 0.01) -> Noise:
    """Return every second value as the one before it, all with three digits."""

    def read(stress, lot):
        noisy = stress + size * rms(stress) * lot.standard_normal(len(stress))
        noisy[1::2] = noisy[: len(noisy) - 1 : 2][: len(noisy[1::2])]
        return np.array([float(f"{value:.3g}") for value in noisy])

    return read


def share_and_floor(share: float, floor: float) -> Noise:
    """Return noise in proportion to each value, beside some Pa."""
    return lambda stress, lot: (
        stress + np.hypot(share * stress, floor) * lot.standard_normal(len(stress))
    )


def banded(law: RateLaw, solvent: float = 5.0):
    """Return the maker of a flow curve with a plateau between two branches, as bands have it."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        rates = np.geomspace(0.05, 50.0, 30)
        end = np.array([60.0, 90.0])
        stress = np.array([law.respond(start_up(r), end).sigma12[-1] + solvent * r for r in rates])
        top = 0.9 * float(np.max(stress[rates < 3.0]))
        first = np.argmax(stress > top)
        last = np.flatnonzero(stress < top)[-1]
        stress[first : max(last + 1, first)] = top
        return {"flow_curve.csv": {"shear_rate_1_s": rates, "stress_Pa": stress}}

    return make
