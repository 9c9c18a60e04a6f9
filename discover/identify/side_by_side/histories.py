"""Random shear histories, and how far laws agree in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.forward.grids.grid import IntegrationGrid, make_grids
from discover.identify.side_by_side.laws_side_by_side import stresses_of_laws
from discover.laws.base import AbstractConstitutiveLaw
from discover.protocols.protocol import FlowProtocol, oscillatory_shear, stack_protocols, start_up
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary

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

    `protocols`, `grids`: batched, ready to simulate.
    `amplitude`: root-mean-square shear rate of each random history, shape (r,); these come first.
    `names`: of the ordinary flows that follow, for telling laws apart; the same batch serves both,
        so that one compiled program does.
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
    """Return the longest step, over λ, in which chains that retract are followed.

    Other laws relax in λ, in which any step of the flow's length is short enough.
    """
    if not law.retracts:
        return np.inf
    return 1.0 / (1.0 + float(jnp.max(jnp.sum(law.relaxations(), axis=1))))


@lru_cache(maxsize=4)
def random_histories(max_step: float = np.inf) -> Histories:
    """Return band-limited random shear rates at several amplitudes.

    γ̇(t) is a sum of six cosines with frequencies from 0.1 to 3 and random phases, for eight
    relaxation times, at root-mean-square rates of 0.3, 1, 2 and 3: nearly linear to strongly
    nonlinear. Rates that start with a jump are among them, as cosines do not vanish at zero.

    `max_step`: longest step, in relaxation times, as from `longest_step`.
    """
    generator = np.random.default_rng(0)
    protocols, amplitudes = [], []
    for amplitude in _AMPLITUDES:
        for _ in range(_EACH):
            weights = generator.normal(size=_WAVES)
            weights *= amplitude * np.sqrt(2.0 / np.sum(weights**2))
            protocols.append(
                FlowProtocol(
                    jnp.zeros(1),
                    jnp.zeros(1),
                    jnp.asarray(weights),
                    jnp.asarray(generator.uniform(0.1, 3.0, _WAVES)),
                    jnp.asarray(generator.uniform(0.0, 2.0 * np.pi, _WAVES)),
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
    """How far a law is from another over a set of histories.

    `sigma12`, `N1`, `N2`: largest over the histories of the root-mean-square difference over the
        root-mean-square of the reference; N2's is relative to the reference's N1. Infinite where
        the law runs away.
    """

    sigma12: float
    N1: float
    N2: float


def differences(
    library: TermLibrary,
    reference: LawTerms,
    others: Sequence[LawTerms],
    base: AbstractConstitutiveLaw | None = None,
) -> list[Difference]:
    """Return how far each of several laws is from a reference in random shear histories.

    Histories in which the reference itself runs away are left out.

    `library`: holds every term of the laws. `base`: the known part; by default UCM.
    """
    flows = histories_for(base)
    stresses = stresses_of_laws(library, [reference, *others], flows.protocols, flows.grids, base)
    observed = observe_differences(stresses[:, : flows.n_random])
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
