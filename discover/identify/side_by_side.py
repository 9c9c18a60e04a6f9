"""Laws simulated side by side, and the histories that distinguish them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward import make_batch
from discover.forward.of_fluids import bare_run, observed
from discover.laws import AbstractConstitutiveLaw, Fluid, UpperConvectedMaxwell
from discover.laws.expansion import expansion_of
from discover.programs import on_device
from discover.protocols.kinematics import FlowKind
from discover.protocols.protocol import FlowProtocol, in_flow, oscillatory_shear, start_up
from discover.statistics.noise_model import rms
from discover.words import percent_of
from tensor_library import LawTerms, TermLibrary, parse_term

STRAIN_STEP = 0.1
"""Largest strain of a step."""


def joint_library(library: TermLibrary, laws: Sequence[LawTerms]) -> TermLibrary:
    """Return a library that also holds the terms of some laws."""
    names = [name for law in laws for name in law.coefficients]
    try:
        terms = [parse_term(name) for name in names]
    except ValueError as error:
        raise InputError(str(error)) from error
    return library.extended(terms)


def stresses_of_laws(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    runs: Sequence[Run],
    base: AbstractConstitutiveLaw | None = None,
    strain_step: float = STRAIN_STEP,
) -> Float[np.ndarray, "laws runs n 3"]:
    """Return what is recorded of several laws in a batch of flows, N1 and N2, dimensionless.

    `library`: holds every term of the laws. `base`: the known part; by default UCM. Not finite
    where a law diverges.
    """
    base = UpperConvectedMaxwell() if base is None else base
    names = {name for law in laws for name in law.coefficients}
    used = [term for term in library.terms if term.name in names] or library.terms[:1]
    used = TermLibrary(tuple(used))
    relaxes = base.linear_relaxation
    fluids = [Fluid.dimensionless(expansion_of(law, used, relaxes, base)) for law in laws]
    batch = make_batch(runs, strain_step, longest=longest_step(base))
    return observed(fluids, batch)


SAME = 1e-5
"""Relative difference below which two laws count as one: integration error, generously."""

_WAVES = 6
_DURATION = 8.0
_SAMPLES = 65
_AMPLITUDES = (0.3, 1.0, 2.0, 3.0)
_EACH = 3  # histories at each
_OSCILLATIONS = ((1.0, 1.0), (3.0, 1.0), (3.0, 0.25), (5.0, 1.0))
_START_UPS = (1.0, 3.0)


def longest_step(law: AbstractConstitutiveLaw) -> float:
    """Return the longest step, over λ, in which retracting chains are followed; else infinite."""
    if not law.retracts:
        return np.inf
    return 1.0 / (1.0 + float(jnp.max(jnp.sum(law.relaxations(), axis=1))))


@cache
def random_histories() -> tuple[Run, ...]:
    """Return runs of band-limited random shear rates at several amplitudes.

    Sums of six cosines with frequencies from 0.1 to 3 over eight relaxation times, at rms rates of
    0.3, 1, 2 and 3.
    """
    generator = np.random.default_rng(0)
    times, none, runs = np.linspace(0.0, _DURATION, _SAMPLES), on_device(np.zeros(1)), []
    for amplitude in np.repeat(_AMPLITUDES, _EACH):
        weights = generator.normal(size=_WAVES)
        weights *= amplitude * np.sqrt(2.0 / np.sum(weights**2))
        frequencies = generator.uniform(0.1, 3.0, _WAVES)
        phases = generator.uniform(0.0, 2.0 * np.pi, _WAVES)
        waves = on_device(weights), on_device(frequencies), on_device(phases)
        flow = FlowProtocol(none, none, *waves)
        runs.append(bare_run(flow, times))
    return tuple(runs)


@cache
def ordinary_flows() -> dict[str, Run]:
    """Return oscillations and start-ups of shear by name, at the times of `random_histories`."""
    flows = {
        f"oscillatory shear at Wi = {wi:g}, De = {de:g}": oscillatory_shear(wi, de)
        for wi, de in _OSCILLATIONS
    }
    flows |= {f"start-up of shear at Wi = {wi:g}": start_up(wi) for wi in _START_UPS}
    times = np.linspace(0.0, _DURATION, _SAMPLES)
    return {name: bare_run(flow, times) for name, flow in flows.items()}


@dataclass(frozen=True)
class Difference:
    """Difference of a law from another over histories: largest relative rms of each quantity.

    N2's is relative to the reference's N1. Infinite where the law diverges.
    """

    sigma12: float
    N1: float
    N2: float


def stresses_in_histories(
    library: TermLibrary, laws: Sequence[LawTerms], base: AbstractConstitutiveLaw | None = None
) -> Float[np.ndarray, "laws runs n 3"]:
    """Return σ12, N1 and N2 of laws in random histories, then ordinary flows.

    `base`: the known part, by default UCM.
    """
    runs = [*random_histories(), *ordinary_flows().values()]
    return stresses_of_laws(library, laws, runs, base)


def differences(stresses: Float[np.ndarray, "laws runs n 3"]) -> list[Difference]:
    """Return how far each law is from the first in the random histories that the first survives."""
    in_histories = stresses[:, : len(random_histories())]
    usable = np.all(np.isfinite(in_histories[0]), axis=(1, 2))
    reference, others = in_histories[0, usable], in_histories[1:, usable]
    scale = np.sqrt(np.mean(reference**2, axis=1))
    scale[:, 2] = scale[:, 1]
    size = np.sqrt(np.mean((reference - others) ** 2, axis=2))
    ratio = np.max(size / np.where(scale > 0, scale, 1.0), axis=1, initial=0.0)
    told = np.any(usable) & np.all(np.isfinite(others), axis=(1, 2, 3))
    return [Difference(*of) for of in np.where(told[:, None], ratio, np.inf).tolist()]


_EXTENSION_RATES = (0.1, 0.3, 1.0)
_VISIBLE = 1e-4

_MEASURED: Mapping[FlowKind, Mapping[str, tuple[int, int]]] = {
    "shear": {"sigma12": (0, 0), "N1": (1, 1), "N2": (2, 1)},
    "uniaxial": {"σ11 − σ22": (1, 1)},
    "planar": {"σ22 − σ33": (2, 1)},
}
"""What is measured in each flow: its column, and the column that it is relative to."""


@dataclass(frozen=True)
class Separation:
    """Experiment in which two laws part.

    `difference`: rms, relative to the reference's N1 for N2 in shear, to its σ11 − σ22 in
    extension, else to the quantity itself; infinite where the stress of one law alone grows without
    bound.
    """

    flow: str  # the flow in words, rates scaled by the relaxation time
    quantity: str  # what to measure in it
    difference: float

    @property
    def text(self) -> str:
        """The experiment in a few words."""
        size = (
            "one grows without bound"
            if not np.isfinite(self.difference)
            else percent_of(self.difference)
        )
        return f"{self.quantity} in {self.flow} ({size})"


def separations(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    stresses: Float[np.ndarray, "laws runs n 3"],
    base: AbstractConstitutiveLaw | None = None,
) -> list[tuple[Separation, ...]]:
    """Return for each law the flows that distinguish it from the first, best in each quantity.

    Oscillations and start-ups of shear, which need the fewest new instruments, then start-ups of
    uniaxial and planar extension. `stresses`: from `stresses_in_histories`.
    """
    kinds: tuple[FlowKind, ...] = "uniaxial", "planar"
    starts = [(kind, rate) for kind in kinds for rate in _EXTENSION_RATES]
    times = np.linspace(0.0, _DURATION, 161)
    runs = [bare_run(in_flow(start_up(rate), kind), times) for kind, rate in starts]
    extension = stresses_of_laws(library, laws, runs, base, strain_step=np.inf)
    flows: list[tuple[Any, str]] = [("shear", name) for name in ordinary_flows()]
    flows += [(kind, f"{kind} extension at a rate of {rate:g}") for kind, rate in starts]
    shear = stresses[:, len(random_histories()) :]
    reference, *others = ([*a, *b] for a, b in zip(shear, extension, strict=True))
    return [_best(flows, reference, other) for other in others]


def _best(
    flows: Sequence[tuple[FlowKind, str]],
    reference: Sequence[Float[np.ndarray, "_ 3"]],
    other: Sequence[Float[np.ndarray, "_ 3"]],
) -> tuple[Separation, ...]:
    """Return the largest difference in shear of each quantity and in each kind of extension."""
    best: dict[str, Separation] = {}
    for (kind, name), a, b in zip(flows, reference, other, strict=True):
        for quantity, (column, scale) in _MEASURED[kind].items():
            value = _relative(a[:, column], b[:, column], rms(a[:, scale]))
            known = best.get(quantity)
            if value >= _VISIBLE and (known is None or value > known.difference):
                best[quantity] = Separation(name, quantity, value)
    return tuple(best.values())


def _relative(a: np.ndarray, b: np.ndarray, scale: float) -> float:
    if not np.all(np.isfinite(a)):
        return 0.0
    if not np.all(np.isfinite(b)):
        return np.inf
    return rms(a - b) / scale if scale > 0 else 0.0
