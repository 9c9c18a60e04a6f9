"""Laws simulated side by side, and the histories that distinguish them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.forward.fluids import solve_on_grid
from discover.forward.grid import IntegrationGrid, make_grids
from discover.laws import AbstractConstitutiveLaw, Fluid, LibraryExpansion, UpperConvectedMaxwell
from discover.programs import compiled, on_device
from discover.protocols.protocol import (
    FlowProtocol,
    in_flow,
    oscillatory_shear,
    stack_protocols,
    start_up,
)
from discover.statistics.noise.noise_model import rms
from discover.words import percent_of
from tensor_library import LawTerms, TermLibrary, parse_term

LAWS_AT_ONCE = 8
"""Laws simulated side by side; fewer are padded, so that any number shares one program."""


def joint_library(library: TermLibrary, laws: Sequence[LawTerms]) -> TermLibrary:
    """Return a library that also holds the terms of some laws."""
    names = [name for law in laws for name in law.coefficients]
    try:
        terms = [parse_term(name) for name in names]
    except ValueError as error:
        raise InputError(str(error)) from error
    return library.extended(terms)


def _batches(library: TermLibrary, laws: Sequence[LawTerms]):
    for first in range(0, len(laws), LAWS_AT_ONCE):
        some = [law.over(library) for law in laws[first : first + LAWS_AT_ONCE]]
        count = len(some)
        some += some[-1:] * (LAWS_AT_ONCE - count)
        coefficients, inner = (on_device(np.stack(part)) for part in zip(*some, strict=True))
        yield count, coefficients, inner


def stresses_of_laws(
    library: TermLibrary,
    laws: Sequence[LawTerms],
    protocols: FlowProtocol,
    grids: IntegrationGrid,
    base: AbstractConstitutiveLaw | None = None,
) -> Float[np.ndarray, "laws runs n 4"]:
    """Return the dimensionless σ11, σ22, σ33, σ12 of several laws in a batch of flows.

    `library`: holds every term of the laws. `base`: the known part; by default UCM. Not finite
    where a law diverges.
    """
    base = UpperConvectedMaxwell() if base is None else base
    parts = [
        np.asarray(_march(library, base, c, inner, protocols, grids))[:count]
        for count, c, inner in _batches(library, laws)
    ]
    return np.concatenate(parts)


def _law(library, base, coefficients, inner) -> LibraryExpansion:
    return LibraryExpansion(coefficients, inner, library, base.linear_relaxation, base)


@compiled
def _march(library, base, coefficients, inner, protocols, grids):
    def one(c, i, protocol, grid):
        law = _law(library, base, c, i)
        return solve_on_grid(Fluid.dimensionless(law), protocol, grid)

    over_runs = jax.vmap(one, in_axes=(None, None, 0, 0))
    return jax.vmap(over_runs, in_axes=(0, 0, None, None))(coefficients, inner, protocols, grids)


SAME = 1e-5
"""Relative difference below which two laws count as one: integration error, generously."""

_WAVES = 6
_DURATION = 8.0
_SAMPLES = 65
_AMPLITUDES = (0.3, 1.0, 2.0, 3.0)
_EACH = 3  # histories at each
_STRAIN_STEP = 0.1
_OSCILLATIONS = ((1.0, 1.0), (3.0, 1.0), (3.0, 0.25), (5.0, 1.0))
_START_UPS = (1.0, 3.0)


@dataclass(frozen=True)
class Histories:
    """Shear flows with the times at which they are looked at.

    `amplitude`: rms shear rate of each random history, shape (r,); these come first. `names`: of
    the ordinary flows that follow in the same batch.
    """

    protocols: FlowProtocol
    grids: IntegrationGrid
    amplitude: Float[np.ndarray, " r"]
    names: tuple[str, ...] = ()

    @property
    def n_random(self) -> int:
        """Number of random histories."""
        return self.amplitude.size


def longest_step(law: AbstractConstitutiveLaw) -> float:
    """Return the longest step, over λ, in which retracting chains are followed; else infinite."""
    if not law.retracts:
        return np.inf
    return 1.0 / (1.0 + float(jnp.max(jnp.sum(law.relaxations(), axis=1))))


@lru_cache(maxsize=4)
def random_histories(max_step: float = np.inf) -> Histories:
    """Return band-limited random shear rates at several amplitudes, then ordinary flows.

    Sums of six cosines with frequencies from 0.1 to 3 over eight relaxation times, at rms rates of
    0.3, 1, 2 and 3. `max_step`: in relaxation times, from `longest_step`.
    """
    generator = np.random.default_rng(0)
    protocols, amplitudes = [], []
    for amplitude in _AMPLITUDES:
        for _ in range(_EACH):
            weights = generator.normal(size=_WAVES)
            weights *= amplitude * np.sqrt(2.0 / np.sum(weights**2))
            protocols.append(
                FlowProtocol(
                    on_device(np.zeros(1)),
                    on_device(np.zeros(1)),
                    on_device(weights),
                    on_device(generator.uniform(0.1, 3.0, _WAVES)),
                    on_device(generator.uniform(0.0, 2.0 * np.pi, _WAVES)),
                )
            )
            amplitudes.append(amplitude)
    ordinary = {
        f"oscillatory shear at Wi = {wi:g}, De = {de:g}": oscillatory_shear(wi, de)
        for wi, de in _OSCILLATIONS
    }
    ordinary |= {f"start-up of shear at Wi = {wi:g}": start_up(wi) for wi in _START_UPS}
    protocols += ordinary.values()
    times = np.linspace(0.0, _DURATION, _SAMPLES)
    every = [times] * len(protocols)
    grids = make_grids(protocols, every, strain_step=_STRAIN_STEP, max_step=max_step)
    return Histories(stack_protocols(protocols), grids, np.asarray(amplitudes), tuple(ordinary))


def histories_for(law: AbstractConstitutiveLaw | None) -> Histories:
    """Return `random_histories()` in steps that a law allows; none is UCM."""
    return random_histories() if law is None else random_histories(longest_step(law))


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
) -> Float[np.ndarray, "laws runs n 4"]:
    """Return the stresses of laws in `histories_for` a known part, by default UCM."""
    flows = histories_for(base)
    return stresses_of_laws(library, laws, flows.protocols, flows.grids, base)


def differences(stresses: Float[np.ndarray, "laws runs n 4"]) -> list[Difference]:
    """Return how far each law is from the first in the random histories that the first survives."""
    observed = observe_differences(stresses[:, : _EACH * len(_AMPLITUDES)])
    return [difference(observed[0], other) for other in observed[1:]]


def observe_differences(stresses: Float[np.ndarray, "*batch 4"]) -> Float[np.ndarray, "*batch 3"]:
    """Return σ12, N1 and N2 from the components 11, 22, 33, 12."""
    s11, s22, s33, s12 = np.moveaxis(stresses, -1, 0)
    return np.stack([s12, s11 - s22, s22 - s33], axis=-1)


def difference(
    reference: Float[np.ndarray, "runs n 3"], other: Float[np.ndarray, "runs n 3"]
) -> Difference:
    """Return the largest relative difference of each quantity over the runs."""
    usable = np.all(np.isfinite(reference), axis=(1, 2))
    a, b = reference[usable], other[usable]
    if not usable.any() or not np.all(np.isfinite(b)):
        return Difference(np.inf, np.inf, np.inf)
    scale = np.sqrt(np.mean(a**2, axis=1))
    scale[:, 2] = scale[:, 1]
    size = np.sqrt(np.mean((a - b) ** 2, axis=1))
    ratio = np.max(size / np.where(scale > 0, scale, 1.0), axis=0)
    return Difference(*(float(r) for r in ratio))


_EXTENSION_RATES = (0.1, 0.3, 1.0)
_QUANTITIES = ("sigma12", "N1", "N2")
_VISIBLE = 1e-4

_EXTENSION_QUANTITY = {"uniaxial": "σ11 − σ22", "planar": "σ22 − σ33"}


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
    stresses: Float[np.ndarray, "laws runs n 4"],
    base: AbstractConstitutiveLaw | None = None,
) -> list[tuple[Separation, ...]]:
    """Return for each law the flows that distinguish it from the first, best in each quantity.

    Oscillations and start-ups of shear, which need the fewest new instruments, then start-ups of
    uniaxial and planar extension. `stresses`: from `stresses_in_histories`.
    """
    flows = histories_for(base)
    names, shear = flows.names, observe_differences(stresses[:, flows.n_random :])
    times = np.linspace(0.0, _DURATION, 161)
    starts = [(kind, rate) for kind in _EXTENSION_QUANTITY for rate in _EXTENSION_RATES]
    protocols = [in_flow(start_up(rate), kind) for kind, rate in starts]
    step = np.inf if base is None else longest_step(base)
    grids = make_grids(protocols, [times] * len(protocols), strain_step=np.inf, max_step=step)
    extension = stresses_of_laws(library, laws, stack_protocols(protocols), grids, base)
    return [
        _best(
            [
                *_in_shear(names, shear[0], shear[i]),
                *_in_extension(starts, extension[0], extension[i]),
            ]
        )
        for i in range(1, len(laws))
    ]


def _relative(a: np.ndarray, b: np.ndarray, scale: float) -> float | None:
    if not np.all(np.isfinite(a)):
        return None
    if not np.all(np.isfinite(b)):
        return np.inf
    return rms(a - b) / scale if scale > 0 else None


def _in_shear(names, reference, other):
    for run, name in enumerate(names):
        for kind, quantity in enumerate(_QUANTITIES):
            scale = rms(reference[run, :, 1 if kind == 2 else kind])
            value = _relative(reference[run, :, kind], other[run, :, kind], scale)
            if value is not None:
                yield Separation(name, quantity, value)


def _in_extension(starts, reference, other):
    for (kind, rate), a, b in zip(starts, reference, other, strict=True):
        scale = rms(a[:, 0] - a[:, 1])
        first, second = (0, 1) if kind == "uniaxial" else (1, 2)
        value = _relative(a[:, first] - a[:, second], b[:, first] - b[:, second], scale)
        if value is not None:
            flow = f"{kind} extension at a rate of {rate:g}"
            yield Separation(flow, _EXTENSION_QUANTITY[kind], value)


def _best(found: list[Separation]) -> tuple[Separation, ...]:
    """Return the largest difference in shear of each quantity and in each kind of extension."""
    best: dict[str, Separation] = {}
    for one in found:
        if one.difference < _VISIBLE:
            continue
        known = best.get(one.quantity)
        if known is None or one.difference > known.difference:
            best[one.quantity] = one
    return tuple(best.values())
