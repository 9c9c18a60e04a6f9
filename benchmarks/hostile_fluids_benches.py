"""What a bench does that no table of runs tells: cells, clocks, rests; by scipy."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from hostile_fluids_laboratory import _OneMore
from hostile_fluids_records import FLOWS, GIESEKUS, Record, Sampled, _record, recorded
from independent import start_up, step_strain
from independent.flow import Flow, of_rate
from independent.folders import maxwell_sweep
from independent.instruments import Instrument
from independent.material import (
    Material,
    Rate,
    RateLaw,
    Stresses,
    differences,
    integrate,
    rate_tensor,
    stretched,
)
from independent.noise import rms
from scipy.ndimage import median_filter


@dataclass(frozen=True)
class Couette(Material):
    """Coaxial cylinders of a ratio of radii; stress and rate told as ISO 3219 has them.

    The rate that is told is Ω (δ² + 1)/(δ² − 1), the stress the mean of those at both walls: right
    for a Newtonian fluid. Here σ12 r² is the same everywhere and Ω = ∫ γ̇ dr/r, no inertia. Normal
    stresses are those at the rate that is told.
    """

    law: RateLaw
    ratio: float = 1.0847  # δ of the standard
    layers: int = 6

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stress that is told."""
        nodes, weights = np.polynomial.legendre.leggauss(self.layers)
        radii = 1 + (self.ratio - 1) * (nodes + 1) / 2
        weights = weights * (self.ratio - 1) / 2
        size, law = len(self.law.rest()), self.law

        def change(t, states):
            layers = states.reshape(self.layers, size)
            still = np.array([law.change(s, 0.0) for s in layers])
            sheared = np.array([law.change(s, 1.0) for s in layers]) - still
            # of the nine components of a stress the second is σ12
            own, driven = still[:, 1], sheared[:, 1]
            turn = flow.rate(t) * (self.ratio**2 - 1) / (self.ratio**2 + 1)
            torque = (turn + np.sum(weights * own / driven / radii)) / np.sum(
                weights / driven / radii**3
            )
            rates = (torque / radii**2 - own) / driven
            return (still + rates[:, None] * sheared).ravel()

        scale = np.tile(law.scale(), self.layers)
        states = integrate(
            change, np.tile(law.rest(), self.layers), times, flow.jumps, scale
        ).reshape(len(times), self.layers, size)
        torque = np.mean(states[:, :, 1] * radii**2, axis=1)
        told = torque * (1 + 1 / self.ratio**2) / 2
        inside = law.respond(flow, times)
        return Stresses(told, inside.N1, inside.N2)


@dataclass(frozen=True)
class Settling(_OneMore):
    """A law whose relaxation time is longer by a share at first, which dies out: it warms up."""

    law: RateLaw
    share: float = 0.1
    time: float = 3.0  # s
    modulus: float = 100.0

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return 1, and the change of the law's state."""
        now = self.law.relaxation_time * (1 + self.share * np.exp(-state[0] / self.time))
        return np.append(1.0, replace(self.law, relaxation_time=now).change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return the stress of the law."""
        return self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class Evaporating(_OneMore):
    """A law whose modulus and relaxation time grow with its age, as its solvent goes."""

    law: RateLaw
    begin: float = 0.0  # age at the start of a run, s
    of_modulus: float = 1e-3  # 1/s
    of_time: float = 3e-3
    modulus: float = 100.0

    def rest(self) -> np.ndarray:
        """Return the age, and the law at rest."""
        return np.append(self.begin, self.law.rest())

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return 1, and the change of the law's state at its age."""
        law = replace(
            self.law,
            modulus=self.law.modulus * (1 + self.of_modulus * state[0]),
            relaxation_time=self.law.relaxation_time * (1 + self.of_time * state[0]),
        )
        return np.append(1.0, law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return the stress of the law."""
        return self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class Micelles(RateLaw):
    """σ▽ = G γ̇ − f σ/λ, f' = (1 − f)/λ_s + k (f_∞ − f) σ:D   [Bautista et al. 1999].

    [JNNFM 80, 93, eqs. 1 and 2]; f is the fluidity over that at rest, and λ = 1/(G φ_0).
    """

    breaking: float = 1e-3  # k, 1/Pa
    largest: float = 10.0  # f_∞
    structure_time: float = 2.0  # λ_s, s
    modulus: float = 100.0
    relaxation_time: float = 1.0

    def rest(self) -> np.ndarray:
        """Return f = 1 and no stress."""
        return np.append(1.0, np.zeros(9))

    def scale(self) -> np.ndarray:
        """Return 1, and the modulus nine times."""
        return np.append(1.0, np.full(9, self.modulus))

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return df/dt and dσ/dt."""
        fluidity, stress = state[0], state[1:].reshape(3, 3)
        work = np.sum(stress * rate_tensor(rate)) / 2
        grown = (1 - fluidity) / self.structure_time
        grown += self.breaking * (self.largest - fluidity) * work
        own = self.modulus * rate_tensor(rate) + stretched(stress, rate)
        return np.append(grown, own - fluidity * stress / self.relaxation_time)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return σ."""
        del rate
        return state[1:].reshape(3, 3)


def without_rest(rest: float, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs one after another, with so many s of rest, each from a new zero."""

    def make() -> dict[str, Record]:
        state, made = law.rest(), {}
        for name, (flow, times) in flows.items():
            states = integrate(
                lambda t, s, flow=flow: law.change(s, float(flow.rate(t))), state, times,
                scale=law.scale(),
            )  # fmt: skip
            rate = np.asarray(flow.rate(times), float) + np.zeros(len(times))
            true = differences([law.stress(s, r) for s, r in zip(states, rate, strict=True)])
            zero = law.stress(state, 0.0)[0, 1]
            columns = {"time_s": times, "shear_rate_1_s": rate, "stress_Pa": true.sigma12 - zero}
            made[name] = Record(columns, N1=true.N1, N2=true.N2)
            state = integrate(
                lambda t, s: law.change(s, 0.0), states[-1], np.array([rest]), scale=law.scale()
            )[-1]
        return made

    return make


def triggered(late: Mapping[str, float], law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs whose clocks started late, each by so many s."""

    def make() -> dict[str, Record]:
        made = {}
        for name, (flow, times) in flows.items():
            run = _record(Instrument().record(law, flow, times + late[name]))
            made[name] = replace(run, columns={**run.columns, "time_s": times})
        return made

    return make


def stamped(interval: float, size: float = 0.01):
    """Return noise of samples that were taken up to half an interval before or after their time.

    The interval is told in samples; the stress between them is taken along a straight line.
    """

    def put(stress, lot):
        at = np.arange(len(stress))
        taken = np.interp(at + interval * lot.uniform(-0.5, 0.5, len(at)), at, stress)
        return taken + size * rms(stress) * lot.standard_normal(len(stress))

    return put


def noisy_rates(size: float, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs whose rate is told as measured, with noise of a share of it."""

    def make() -> dict[str, Record]:
        lot, made = np.random.default_rng(12), {}
        for name, run in recorded(law, flows)().items():
            rate = run.columns["shear_rate_1_s"]
            told = rate + size * rms(rate) * lot.standard_normal(len(rate))
            made[name] = replace(run, columns={**run.columns, "shear_rate_1_s": told})
        return made

    return make


def ramped(rise: float, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs whose rate rises evenly over so many s, told as a step."""

    def make() -> dict[str, Record]:
        made = {}
        for name, (flow, times) in flows.items():
            true = of_rate(
                lambda t, flow=flow: flow.rate(t) * np.minimum(np.asarray(t) / rise, 1.0), times[-1]
            )
            run = _record(Instrument().record(law, replace(true, jumps=(rise,)), times))
            told = np.asarray(flow.rate(times), float) + np.zeros(len(times))
            made[name] = replace(run, columns={**run.columns, "shear_rate_1_s": told})
        return made

    return make


def cut_cycles(which: str, cycles: int, frequency: float = 1.0):
    """Return the maker of runs one of which is told from a later cycle on, its clock at zero."""

    def make() -> dict[str, Record]:
        later = 2 * np.pi * cycles / frequency
        return triggered({name: later * (name == which) for name in FLOWS})()

    return make


def strains(
    put_on: float, law: RateLaw = GIESEKUS, sizes: Sequence[float] = (0.5, 1.5, 4.0, 3.0),
    names: Sequence[str] = ("a.csv", "b.csv", "c.csv", "held.csv"),
):  # fmt: skip
    """Return the maker of steps of strain, told as at once and dated from their beginning."""
    times = np.geomspace(1.5 * put_on, 5.0, 60)

    def make() -> dict[str, Record]:
        made = {}
        for name, size in zip(names, sizes, strict=True):
            run = _record(Instrument().record(law, step_strain(size, put_on), times))
            columns = {**run.columns, "shear_rate_1_s": np.zeros(len(times))}
            made[name] = replace(run, columns=columns, cells={"step_strain": size})
        return made

    return make


def sweep_between(
    low: float, high: float, moduli: Sequence[float], times: Sequence[float]
) -> Callable[[], dict[str, dict[str, np.ndarray]]]:
    """Return the maker of a linear sweep that ends at these frequencies in rad/s."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        frequencies = np.geomspace(low, high, 17)
        return {"lve.csv": maxwell_sweep(np.array(moduli), np.array(times), frequencies)}

    return make


def median_of(width: int, size: float = 0.01):
    """Return noise as the median of so many neighbours leaves it."""

    def put(stress, lot):
        noisy = stress + size * rms(stress) * lot.standard_normal(len(stress))
        return median_filter(noisy, width, mode="nearest")

    return put


def loaded(spread: float, size: float = 0.01):
    """Return white noise, and a factor of each run, which is a loading of its own."""

    def put(stress, lot):
        factor = 1 + spread * lot.standard_normal()
        return factor * stress + size * rms(stress) * lot.standard_normal(len(stress))

    return put


@dataclass(frozen=True)
class Repeated:
    """Runs each of which was made twice, but the last, which is held out.

    Attributes
    ----------
    law
        Of the fluid.
    flows
        Of the runs.
    """

    law: Material
    flows: Sampled = field(default_factory=lambda: dict(FLOWS))

    def __call__(self) -> dict[str, Record]:
        """Return the records."""
        made = {}
        for name, run in recorded(self.law, self.flows)().items():
            made[name] = run
            if name != "held.csv":
                made[name.replace(".csv", "_again.csv")] = run
        return made


def saturating(level: float):
    """Return a stress behind a transducer that reads ever less: s tanh(σ/s)."""
    return lambda name, time, stress: level * np.tanh(stress / level)


SLOW_THEN_FASTER: Sampled = {
    "a.csv": (start_up(0.3), np.linspace(0.1, 8.0, 80)),
    "b.csv": (start_up(0.6), np.linspace(0.1, 8.0, 80)),
    "c.csv": (start_up(1.0), np.linspace(0.1, 8.0, 80)),
    "held.csv": (start_up(10.0), np.linspace(0.02, 2.0, 80)),
}
