"""Which experiment would tell two laws apart."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from discover.forward.grids.grid import make_grids
from discover.identify.side_by_side.histories import (
    histories_for,
    longest_step,
    observe_differences,
)
from discover.identify.side_by_side.laws_side_by_side import stresses_of_laws
from discover.laws.base import AbstractConstitutiveLaw
from discover.protocols.protocol import in_flow, stack_protocols, start_up
from discover.statistics.projection import rms
from discover.words import percent_of
from tensor_library.law_terms import LawTerms
from tensor_library.library import TermLibrary

_EXTENSION_RATES = (0.1, 0.3, 1.0)
_DURATION = 8.0
_QUANTITIES = ("sigma12", "N1", "N2")
_VISIBLE = 1e-4

_EXTENSION_QUANTITY = {"uniaxial": "σ11 − σ22", "planar": "σ22 − σ33"}


@dataclass(frozen=True)
class Separation:
    """An experiment in which two laws part.

    `difference`: root-mean-square difference, relative to the reference's N1 for N2 in shear, to
        its σ11 − σ22 in extension, and to the quantity itself otherwise; infinite where the stress
        of one law grows without bound and that of the other does not.
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
    reference: LawTerms,
    others: Sequence[LawTerms],
    base: AbstractConstitutiveLaw | None = None,
) -> list[tuple[Separation, ...]]:
    """Return for each law the flows that tell it from the reference, best in each quantity.

    Oscillations and start-ups of shear, and the start of uniaxial and planar extension. A shear
    quantity comes first where one differs, as it needs the fewest new instruments.
    """
    laws = [reference, *others]
    flows = histories_for(base)
    stresses = stresses_of_laws(library, laws, flows.protocols, flows.grids, base)
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
