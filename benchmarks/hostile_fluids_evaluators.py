"""What evaluators find in drawers: readings, geometries, sessions of other kinds; by scipy."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from hostile_fluids_records import FLOWS, GIESEKUS, Record, Sampled, _record, recorded
from independent import start_up, steps
from independent.flow import Flow
from independent.folders import maxwell_sweep
from independent.instruments import Instrument
from independent.material import RateLaw, integrate
from independent.sweeps import modulus_of
from scipy.integrate import solve_ivp

Maker = Callable[[], dict[str, Record]]
_PULLED = {"a.csv": 0.2, "b.csv": 0.6, "c.csv": 2.0, "held.csv": 1.2}
_LOG = np.geomspace(0.06, 8.0, 22)
LOGARITHMIC: Sampled = {
    "slow.csv": (start_up(0.5), _LOG),
    "middle.csv": (start_up(1.0), _LOG),
    "fast.csv": (start_up(2.0), _LOG),
    "held.csv": (start_up(3.0), _LOG),
}
STEPPED: Sampled = {
    "a.csv": (steps([0.0, 3.0, 6.0], [0.5, 2.0, 1.0]), np.linspace(0.05, 9.0, 120)),
    "b.csv": (steps([0.0, 2.0, 5.0], [2.0, 0.3, 1.5]), np.linspace(0.05, 9.0, 120)),
    "c.csv": (steps([0.0, 4.0, 6.0], [1.0, 3.0, 0.2]), np.linspace(0.05, 9.0, 120)),
    "held.csv": (steps([0.0, 3.0, 5.0], [1.5, 0.5, 2.5]), np.linspace(0.05, 9.0, 120)),
}
TWO_RATES: Sampled = {
    "a.csv": (start_up(1.0), np.linspace(0.1, 8.0, 80)),
    "b.csv": (start_up(2.0), np.linspace(0.1, 8.0, 80)),
    "held.csv": (start_up(3.0), np.linspace(0.1, 8.0, 80)),
}
SLOW_START: Sampled = {
    "slow.csv": (start_up(0.3), np.linspace(0.1, 8.0, 80)),
    "held.csv": (start_up(0.6), np.linspace(0.1, 8.0, 80)),
}


def digitised(law: RateLaw, jitter: float = 0.01) -> Maker:
    """Return the maker of curves that a hand read from a plot: times that are off, too."""

    def make() -> dict[str, Record]:
        lot, made = np.random.default_rng(21), {}
        for name, run in recorded(law, LOGARITHMIC)().items():
            times = run.columns["time_s"]
            read = times * np.exp(jitter * lot.standard_normal(len(times)))
            made[name] = replace(run, columns={**run.columns, "time_s": read})
        return made

    return make


def read_by_hand(size: float, correlation: float = 0.7):
    """Return the error of a hand along a curve, in shares of each value."""

    def put(stress, lot):
        error = np.zeros(len(stress))
        last = lot.standard_normal()
        for i, new in enumerate(lot.standard_normal(len(stress))):
            last = correlation * last + np.sqrt(1 - correlation**2) * new
            error[i] = last
        return stress * (1 + size * error)

    return put


def pulled(law: RateLaw, told: Callable[[np.ndarray, np.ndarray, float], np.ndarray]) -> Maker:
    """Return the maker of uniaxial extensions whose stress is told otherwise.

    Parameters
    ----------
    told
        Of the stress, the times and the rate.
    """

    def make() -> dict[str, Record]:
        made = {}
        for name, rate in _PULLED.items():
            times = np.linspace(0.03, 3.0 / rate, 80) if rate > 0.3 else np.linspace(0.1, 12.0, 80)
            stress = told(law.pull(rate, times), times, rate)
            made[name] = _pulled_record(times, rate, stress)
        return made

    return make


def _pulled_record(times: np.ndarray, rate: float, stress: np.ndarray) -> Record:
    columns = {
        "time_s": times, "hencky_rate_1_s": np.full(len(times), rate), "tensile_stress_Pa": stress
    }  # fmt: skip
    return Record(columns, "tensile_stress_Pa", {"flow": "uniaxial"})


def over_first_area(stress: np.ndarray, times: np.ndarray, rate: float) -> np.ndarray:
    """Return force over the first area: σ exp(−ε)."""
    return stress * np.exp(-rate * times)


def necked(law: RateLaw, begins: float = 1.5, more: float = 0.6) -> Maker:
    """Return the maker of extensions that neck: beyond a strain it is faster in the middle.

    The force there is told over the area that a sample without a neck had.
    """

    def make() -> dict[str, Record]:
        made = {}
        for name, rate in _PULLED.items():
            times = np.linspace(0.03, 3.0 / rate, 80)

            def faster(t, rate=rate):
                return rate * (1 + more * max(rate * t - begins, 0.0))

            states = integrate(
                lambda t, s, faster=faster: law.change(
                    s, faster(t) * np.diag([1.0, -0.5, -0.5])
                ),
                law.rest(), times, scale=law.scale(),
            )  # fmt: skip
            tensors = [law.stress(s, np.zeros((3, 3))) for s in states]
            true = np.array([one[0, 0] - one[1, 1] for one in tensors])
            gone = 0.5 * more * np.maximum(rate * times - begins, 0.0) ** 2
            made[name] = _pulled_record(times, rate, true * np.exp(-gone))
        return made

    return make


def planar_told_uniaxial(law: RateLaw) -> Maker:
    """Return the maker of planar extensions that are told to be uniaxial."""

    def make() -> dict[str, Record]:
        made = {}
        for name, rate in _PULLED.items():
            times = np.linspace(0.03, 3.0 / rate, 80)
            gradient = rate * np.diag([1.0, -1.0, 0.0])
            states = integrate(
                lambda t, s, gradient=gradient: law.change(s, gradient),
                law.rest(), times, scale=law.scale(),
            )  # fmt: skip
            tensors = [law.stress(s, gradient) for s in states]
            stress = np.array([one[0, 0] - one[1, 1] for one in tensors])
            made[name] = _pulled_record(times, rate, stress)
        return made

    return make


def ringing_creep(law: RateLaw, inertia: float, solvent: float = 2.0) -> Maker:
    """Return the maker of creep with the inertia of a tool: I γ'' = σ − what the fluid carries."""
    times = np.geomspace(0.02, 12.0, 90)
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 75.0}
    scale = np.append(law.scale(), [1.0, 1.0])

    def make() -> dict[str, Record]:
        made = {}
        for name, imposed in stresses.items():

            def change(t, scaled, imposed=imposed):
                state = scale * scaled
                rate = state[-1]
                carried = law.stress(state[:-2], rate)[0, 1] + solvent * rate
                grown = (imposed - carried) / inertia
                return np.concatenate([law.change(state[:-2], rate), [rate, grown]]) / scale

            start = np.concatenate([law.rest(), [0.0, 0.0]]) / scale
            found = solve_ivp(
                change, (0.0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-10
            )
            columns = {
                "time_s": times,
                "stress_Pa": np.full(len(times), imposed),
                "strain": found.y[-2],
            }
            made[name] = Record(columns, "strain", {"control": "stress"})
        return made

    return make


def with_first_difference(
    told: Callable[[np.ndarray, Record], np.ndarray], noise: float = 0.01
) -> Callable[[str, Record], Record]:
    """Return the change of a record that has N1 too, as it is told."""

    def change(name: str, run: Record) -> Record:
        lot = np.random.default_rng(sum(map(ord, name)))
        read = told(run.columns["time_s"], run)
        read = read + noise * np.sqrt(np.mean(run.N1**2)) * lot.standard_normal(len(read))
        return replace(run, columns={**run.columns, "N1_Pa": read})

    return change


def late_axially(lag: float):
    """Return N1 behind a soft axis: it follows with a time."""

    def told(times: np.ndarray, run: Record) -> np.ndarray:
        out, last, before = np.zeros(len(times)), 0.0, 0.0
        for i, (t, value) in enumerate(zip(times, run.N1, strict=True)):
            last = value + (last - value) * np.exp(-(t - before) / lag)
            out[i], before = last, t
        return out

    return told


def thrown_out(size: float):
    """Return N1 less what the inertia of the fluid takes, in proportion to the rate squared."""
    return lambda times, run: run.N1 - size * run.columns["shear_rate_1_s"] ** 2


def of_plates(times: np.ndarray, run: Record) -> np.ndarray:
    """Return N1 − N2, which the thrust of parallel plates tells, for N1."""
    del times
    return run.N1 - run.N2


def settling(first: float = 8.0, time: float = 25.0):
    """Return the change of a record: a solvent whose particles settle while the session lasts."""

    def change(name: str, run: Record) -> Record:
        age = 12.0 * list(FLOWS).index(name) + run.columns["time_s"]
        more = first * np.exp(-age / time) * run.columns["shear_rate_1_s"]
        stress = run.columns["stress_Pa"] + more
        return replace(run, columns={**run.columns, "stress_Pa": stress})

    return change


def soft_steps(rise: float, law: RateLaw = GIESEKUS) -> Maker:
    """Return the maker of steps of the rate that take their time, told as at once."""

    def make() -> dict[str, Record]:
        instrument = Instrument(rise_time=rise)
        return {name: _record(instrument.record(law, *flow)) for name, flow in STEPPED.items()}

    return make


def spliced(at: float, more: float):
    """Return a stress whose first part another card recorded, with a gain of its own."""
    return lambda name, time, stress: stress * (1 + more * (time < at))


def humming(size: float, frequency: float):
    """Return a stress with a hum that begins anywhere in each run."""

    def told(name: str, time: np.ndarray, stress: np.ndarray) -> np.ndarray:
        return stress + size * np.sin(2 * np.pi * frequency * time + sum(map(ord, name)))

    return told


def sticking(name: str, time: np.ndarray, stress: np.ndarray) -> np.ndarray:
    """Return a stress that in the fast run sticks and slips, by 6 %, every 0.7 s."""
    if name != "fast.csv":
        return stress
    return stress * (1 - 0.06 * ((time / 0.7) % 1.0) * (stress > 60.0))


def rested(shares: Mapping[str, float], time: float = 4.0):
    """Return a stress of a structure that has not come back from the run before."""
    return lambda name, t, stress: stress * (1 - shares[name] * np.exp(-t / time))


def distorted(third: float, law: RateLaw = GIESEKUS) -> Maker:
    """Return the maker of runs whose wave has a third harmonic that nobody told."""

    def make() -> dict[str, Record]:
        made = recorded(law)()
        flow, times = FLOWS["wave.csv"]
        true = Flow(
            lambda t: flow.rate(t) + third * np.cos(3 * np.asarray(t)),
            lambda t: flow.strain(t) + third * np.sin(3 * np.asarray(t)) / 3,
        )
        run = _record(Instrument().record(law, true, times))
        told = np.asarray(flow.rate(times), float)
        made["wave.csv"] = replace(run, columns={**run.columns, "shear_rate_1_s": told})
        return made

    return make


def sweep_at(law: RateLaw, strain: float, low: float = 0.03, high: float = 50.0):
    """Return the maker of a sweep at a strain that is not small, told as linear."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        frequencies = np.geomspace(low, high, 17)
        found = np.array([modulus_of(law, strain, omega, 8) for omega in frequencies])
        return {"lve.csv": {"omega_rad_s": frequencies, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}

    return make


_RATES = np.geomspace(0.05, 20.0, 30)


def _steady(law: RateLaw, rates: np.ndarray) -> np.ndarray:
    ends = np.array([20.0, 60.0])
    return np.array([law.respond(start_up(rate), ends).sigma12[-1] for rate in rates])


def _curve(rates: np.ndarray, stress: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
    return {"flow_curve.csv": {"shear_rate_1_s": rates, "stress_Pa": stress}}


def in_haste(law: RateLaw, each: float = 1.0):
    """Return the maker of a flow curve swept upwards, with a time for each point."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        begins = each * np.arange(len(_RATES))
        found = law.respond(steps(begins, _RATES), begins + 0.999 * each)
        return _curve(_RATES, found.sigma12)

    return make


def apparent(law: RateLaw):
    """Return the maker of a flow curve of a capillary at rates as of a Newtonian fluid."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        rates = np.geomspace(1e-3, 20.0, 120)
        stress = _steady(law, rates)
        both = np.append(0.0, stress**2 * rates)
        wall = np.append(0.0, stress)
        through = np.append(0.0, np.cumsum((both[1:] + both[:-1]) / 2 * np.diff(wall)))[1:]
        told = 4 * through / stress**3
        kept = np.searchsorted(rates, _RATES[:-1])
        return _curve(told[kept], stress[kept])

    return make


def by_cox_and_merz(modulus: float, time: float):
    """Return the maker of a flow curve that nobody measured: |η*| of one mode."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        return _curve(_RATES, modulus * time * _RATES / np.sqrt(1 + (time * _RATES) ** 2))

    return make


def broad(count: int = 10):
    """Return moduli and times of a broad spectrum, evenly in log time."""
    times = np.geomspace(20.0, 0.04, count)
    return 60.0 * np.exp(-0.5 * (np.log(times / 0.3) / 2.0) ** 2), times


def sweep_of_modes(moduli: np.ndarray, times: np.ndarray):
    """Return the maker of a linear sweep of these modes."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        frequencies = np.geomspace(0.01, 100.0, 33)
        return {"lve.csv": maxwell_sweep(moduli, times, frequencies)}

    return make
