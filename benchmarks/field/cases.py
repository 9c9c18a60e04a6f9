"""Fluids and flows of the benchmark, from scipy simulators that share nothing with a contestant."""

import zlib

import numpy as np
from independent import (
    ExtendedPomPom,
    Giesekus,
    JohnsonSegalman,
    PhanThienTanner,
    RateLaw,
    RoliePoly,
    WhiteMetzner,
    multimode_giesekus,
)
from independent.flow import Flow as Shear
from independent.flow import oscillation, start_up
from independent.material import integrate, velocity_gradient

from field.contract import Flow, Record, Training

FLUIDS: dict[str, tuple[str | None, RateLaw]] = {
    "Giesekus": ("giesekus", Giesekus(0.3)),
    "linear PTT": ("ptt_linear", PhanThienTanner(0.3)),
    "exponential PTT": ("ptt_exponential", PhanThienTanner(0.3, "exponential")),
    "Johnson–Segalman": ("johnson_segalman", JohnsonSegalman(0.3)),
    "Rolie–Poly": (None, RoliePoly(1.0, 0.1)),
    "extended pom-pom": (None, ExtendedPomPom(5.0, 0.1, 0.4)),
    "White–Metzner": (None, WhiteMetzner(0.5, 1.0)),
    # seen as one mode it has the same modulus and viscosity: 1 Pa and 1 Pa s
    "two-mode Giesekus": (None, multimode_giesekus((0.1, 0.7), (0.5, 0.5), (1.3, 0.7))),
}
"""Right name, or None where no list holds the fluid; and its law, with G = 1 Pa and λ = 1 s."""

NOISE = 0.01
"""Standard deviation over the root-mean-square of a record, or of a component of its stress."""

_TIMES = np.linspace(0.0, 12.0, 121)
TRAINING = (
    *(Flow(f"laos_{a:g}_{f:g}", a, f, _TIMES) for f in (0.5, 1.0) for a in (1.0, 2.0)),
    Flow("startup_1", 1.0, 0.0, _TIMES),
)
UNSEEN = (
    Flow("laos_3_1.5", 3.0, 1.5, _TIMES),
    Flow("startup_2.5", 2.5, 0.0, _TIMES),
    *(Flow(f"extension_{r:g}", r, 0.0, np.linspace(0.0, 3.0, 61), "uniaxial") for r in (0.5, 1.0)),
)


def training(fluid: str, seed: int, with_stress: bool) -> Training:
    """Return the records of a fluid; the noise of σ12 is the same with and without the stress."""
    law = FLUIDS[fluid][1]
    generator = np.random.default_rng([seed, zlib.crc32(fluid.encode())])
    records = []
    for flow in TRAINING:
        tensors = _tensors(law, flow)
        size = NOISE * np.sqrt(np.mean(tensors**2, axis=0))
        noise = size * generator.standard_normal(tensors.shape)
        upper = np.triu(noise)  # one draw for each pair of equal components
        noisy = tensors + upper + np.triu(noise, 1).swapaxes(1, 2)
        records.append(Record(flow, noisy[:, 0, 1], noisy if with_stress else None))
    return Training(tuple(records), 1.0, 1.0, seed)


def truth(fluid: str, flow: Flow) -> dict[str, np.ndarray]:
    """Return what a fluid does in a flow, in Pa."""
    law = FLUIDS[fluid][1]
    if flow.kind == "uniaxial":
        return {"tensile": law.pull(flow.amplitude, flow.times)}
    stresses = law.respond(_shear(flow), flow.times)
    return {"sigma12": stresses.sigma12, "N1": stresses.N1, "N2": stresses.N2}


def _shear(flow: Flow) -> Shear:
    if flow.frequency:
        return oscillation(flow.amplitude, flow.frequency)
    return start_up(flow.amplitude)


def _tensors(law: RateLaw, flow: Flow) -> np.ndarray:
    states = integrate(
        lambda t, state: law.change(state, float(flow.rate(t))),
        law.rest(),
        flow.times,
        scale=law.scale(),
    )
    rates = map(velocity_gradient, flow.rate(flow.times))
    return np.array([law.stress(s, rate) for s, rate in zip(states, rates, strict=True)])
