"""What real laboratories hand over without knowing: records by scipy for `hostile_fluids.py`."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from hostile_fluids_records import FLOWS, GIESEKUS, Record, Sampled, _record, recorded
from independent import start_up
from independent.flow import Flow
from independent.folders import maxwell_sweep
from independent.instruments import Instrument
from independent.material import Material, RateLaw, Stresses

Change = Callable[[str, Record], Record]


@dataclass(frozen=True)
class PlatePlate(Material):
    """Parallel plates, their torque told as that of a Newtonian fluid: 4 ∫ x² σ(x γ̇_R) dx.

    No Weissenberg–Rabinowitsch correction   [Bird, Armstrong & Hassager 1987, eq. 10.2-15]. Normal
    stresses are those at the rim, where the rate is the one that is told.
    """

    law: RateLaw
    points: int = 8

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the apparent stress by Gauss's rule, and N1 and N2 at the rim."""
        nodes, weights = np.polynomial.legendre.leggauss(self.points)
        apparent = 0.0
        for x, weight in zip((nodes + 1) / 2, weights / 2, strict=True):
            inner = Flow(
                lambda t, x=x: x * flow.rate(t), lambda t, x=x: x * flow.strain(t), flow.jumps
            )
            apparent = apparent + 4 * weight * x**2 * self.law.respond(inner, times).sigma12
        rim = self.law.respond(flow, times)
        return Stresses(apparent, rim.N1, rim.N2)


@dataclass(frozen=True)
class _OneMore(RateLaw):
    """A law whose state has one number more, before those of another law: zero at rest."""

    law: RateLaw

    def rest(self) -> np.ndarray:
        """Return zero, and the state of the law at rest."""
        return np.append(0.0, self.law.rest())

    def scale(self) -> np.ndarray:
        """Return 1, and the scales of the law."""
        return np.append(1.0, self.law.scale())


@dataclass(frozen=True)
class Networked(_OneMore):
    """A law beside a permanent neo-Hookean network: σ12 = E γ and N1 = E γ² more."""

    network: float = 15.0
    modulus: float = 100.0

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return the rate, and the change of the law's state."""
        return np.append(rate, self.law.change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return the sum of both."""
        strain = state[0]
        elastic = np.array([[strain**2, strain, 0.0], [strain, 0.0, 0.0], [0.0, 0.0, 0.0]])
        return self.law.stress(state[1:], rate) + self.network * elastic


@dataclass(frozen=True)
class Ageing(_OneMore):
    """A law whose relaxation time grows linearly with time from the start of each run."""

    growth: float = 0.03  # 1/s
    modulus: float = 100.0

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return 1, and the change of the law's state at its age."""
        older = self.law.relaxation_time * (1 + self.growth * state[0])
        return np.append(1.0, replace(self.law, relaxation_time=older).change(state[1:], rate))

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return the stress of the law."""
        return self.law.stress(state[1:], rate)


@dataclass(frozen=True)
class CriticalSlip(_OneMore):
    """Wall slip that sets in beyond a stress, with a memory: γ̇_felt = γ̇ − s m σ, m' = (H − m)/τ.

    H goes from 0 to 1 within some 10 Pa of the critical stress.
    """

    slip: float = 0.006  # 1/(Pa s)
    critical: float = 60.0
    memory: float = 1.0
    modulus: float = 100.0

    def _felt(self, state: np.ndarray, rate: float) -> float:
        return rate - self.slip * state[0] * self.law.stress(state[1:], rate)[0, 1]

    def change(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return the change of m and of the law's state at the rate that is felt."""
        stress = abs(self.law.stress(state[1:], rate)[0, 1])
        target = 1 / (1 + np.exp(-(stress - self.critical) / 3.0))
        change = self.law.change(state[1:], self._felt(state, rate))
        return np.append((target - state[0]) / self.memory, change)

    def stress(self, state: np.ndarray, rate: float) -> np.ndarray:
        """Return the stress of the law."""
        return self.law.stress(state[1:], self._felt(state, rate))


def each(change: Change, material: Material = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs that are changed by their name."""

    def make() -> dict[str, Record]:
        return {name: change(name, run) for name, run in recorded(material, flows)().items()}

    return make


def times_stress(factors: Mapping[str, float]) -> Change:
    """Return the change of the stress by a factor for each run: a filling that differs."""

    def change(name: str, run: Record) -> Record:
        stress = run.columns["stress_Pa"] * factors.get(name, 1.0)
        return replace(run, columns={**run.columns, "stress_Pa": stress})

    return change


def mislabelled(which: str, factor: float) -> Change:
    """Return the change of the rate that is told of one run."""

    def change(name: str, run: Record) -> Record:
        if name != which:
            return run
        told = run.columns["shear_rate_1_s"] * factor
        return replace(run, columns={**run.columns, "shear_rate_1_s": told}, N1=None, N2=None)

    return change


def with_n1(offset: float = 0.0, gain: float = 1.0, noise: float = 0.01) -> Change:
    """Return the change of a record that has N1 too, read with an offset in Pa and a gain."""

    def change(name: str, run: Record) -> Record:
        lot = np.random.default_rng(sum(map(ord, name)))
        size = noise * np.sqrt(np.mean(run.N1**2))
        read = gain * run.N1 + offset + size * lot.standard_normal(len(run.N1))
        return replace(run, columns={**run.columns, "N1_Pa": read})

    return change


def warmed(factors: Mapping[str, float], law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs at temperatures that drift: a relaxation time for each."""

    def make() -> dict[str, Record]:
        made = {}
        for name, flow in flows.items():
            fluid = replace(law, relaxation_time=law.relaxation_time * factors[name])
            made[name] = _record(Instrument().record(fluid, *flow))
        return made

    return make


def averaged(width: float, law: RateLaw = GIESEKUS, flows: Sampled = FLOWS):
    """Return the maker of runs whose software told the mean over a width in s about each sample."""

    def make() -> dict[str, Record]:
        made = {}
        for name, (flow, times) in flows.items():
            fine = np.linspace(1e-3, times[-1] + width, 6000)
            stress = law.respond(flow, fine).sigma12
            total = np.append(0.0, np.cumsum((stress[1:] + stress[:-1]) / 2 * np.diff(fine)))
            low, high = np.maximum(times - width / 2, 1e-3), times + width / 2
            mean = (np.interp(high, fine, total) - np.interp(low, fine, total)) / (high - low)
            run = _record(Instrument().record(law, flow, times))
            made[name] = replace(run, columns={**run.columns, "stress_Pa": mean})
        return made

    return make


def sweep_of(moduli: Sequence[float], times: Sequence[float]):
    """Return the maker of a linear sweep of Maxwell modes."""

    def make() -> dict[str, dict[str, np.ndarray]]:
        frequencies = np.geomspace(0.01, 100.0, 33)
        return {"lve.csv": maxwell_sweep(np.array(moduli), np.array(times), frequencies)}

    return make


def growths(times: np.ndarray, rates: Mapping[str, float]) -> Sampled:
    """Return start-ups, each with its samples."""
    return {name: (start_up(rate), times) for name, rate in rates.items()}


def to_strain(strain: float, rates: Mapping[str, float]) -> Sampled:
    """Return start-ups that end at a strain."""
    return {
        name: (start_up(rate), np.linspace(0.02, strain / rate, 60)) for name, rate in rates.items()
    }
