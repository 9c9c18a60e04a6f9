"""A law of terms whose coefficients, and constants of the known part, can be moved."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.comparison.outcomes.flows import QUANTITIES, Flow, predict
from discover.laws.each_mode import LawOfEachMode
from discover.laws.expansion import law_of_terms
from discover.laws.multimode import Fluid
from discover.laws.registry import make_law
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel
from tensor_library.law_terms import LawTerm, LawTerms

_STEP = 1e-3
"""Of a difference, relative; of what is near zero, of `_SMALL`."""

_SMALL = 1e-2

_SHORTER = (1.0, 1e-2, 1e-4)

_OF_MODULUS = 1e-2  # of a modulus; the stress at a given rate is linear in it


Slopes = tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "q n 3"]]
"""Predictions of σ12, N1 and N2 in a flow, and their derivatives in each of the values."""


@dataclass(frozen=True)
class MovedLaw:
    """The law found, with constants of the declared model and coefficients that can be moved.

    What it predicts of a flow is kept, since one question after another is asked of it.

    Attributes
    ----------
    declared
        The known part.
    terms
        The terms found, beyond the known part.
    names
        Constants that move beside the coefficients: of the modes, or of the declared law.
    """

    declared: DeclaredModel
    terms: LawTerms
    names: tuple[str, ...]
    _kept: dict[tuple[str, str], tuple[Flow, Any]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @classmethod
    def of(
        cls, terms: Sequence[LawTerm], declared: DeclaredModel, names: tuple[str, ...] = ()
    ) -> "MovedLaw":
        """Return the law of these terms beside the known part."""
        return cls(declared, LawTerms.of(terms), names)

    @property
    def start(self) -> Float[np.ndarray, " q"]:
        """Logarithms of factors on the modes, constants of the law, and coefficients."""
        law = self.declared.parameters
        constants = [0.0 if name in MODE_CONSTANTS else law[name] for name in self.names]
        return np.array([*constants, *self.terms.coefficients.values()])

    def fluid(self, values: Float[np.ndarray, " q"]) -> Fluid:
        """Return the fluid with other values."""
        own = dict(zip(self.names, map(float, values), strict=False))
        modulus, time = (np.exp(own.pop(name, 0.0)) for name in MODE_CONSTANTS)
        known = self.declared
        law = make_law(known.law_name, {**known.parameters, **own}) if own else known.law
        terms = self.terms.at([*values[len(self.names) :], *self.terms.inner.values()])
        found = law_of_terms(terms, known.law.linear_relaxation, law)
        return Fluid(
            found, known.modulus * modulus, known.relaxation_time * time, known.solvent_viscosity
        )

    def derivatives(self, flow: Flow) -> Slopes | None:
        """Return predictions in a flow and their derivatives; None where one runs away.

        With far shorter steps where it does: of a coefficient that is small, for fast flows.
        """

        def derive(flow: Flow) -> Slopes | None:
            found = (self._derivatives(flow, shorter) for shorter in _SHORTER)
            return next((one for one in found if one is not None), None)

        return self._once("slopes", flow, derive)

    def _derivatives(self, flow: Flow, shorter: float) -> Slopes | None:
        start = self.start
        rows, steps = [start], []
        for i, value in enumerate(start):
            of_factor = i < len(self.names) and self.names[i] in MODE_CONSTANTS
            step = _STEP * (1.0 if of_factor else shorter * max(abs(value), _SMALL))
            for sign in (1.0, -1.0):
                moved = start.copy()
                moved[i] += sign * step
                rows.append(moved)
            steps.append(step)
        found = [predict(self.fluid(row), flow) for row in rows]
        columns = [
            np.stack([one[q] for q in QUANTITIES], axis=-1) for one in found if one is not None
        ]
        if len(columns) < len(rows) or not np.all(np.isfinite(columns)):
            return None
        if not steps:
            return columns[0], np.zeros((0, *columns[0].shape))
        up, down = np.array(columns[1::2]), np.array(columns[2::2])
        return columns[0], (up - down) / (2.0 * np.array(steps))[:, None, None]

    def of_moduli(self, flow: Flow) -> Float[np.ndarray, "c n"] | None:
        """Return the change of the record per relative change of each modulus and a solvent."""
        return self._once("moduli", flow, self._moved_moduli)

    def of_further_modes(
        self, flow: Flow, times: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "k n"] | None:
        """Return the stress in a flow of one more mode of each of these times, as all modes are.

        Its modulus is that of all modes together. At a given rate it adds to theirs; None of other
        flows, and of a law with constants by mode. Zero where the law runs away.
        """
        if flow.protocol.control != "rate" or isinstance(self.declared.law, LawOfEachMode):
            return None
        fluid = self.fluid(self.start)
        modulus = np.array([np.sum(fluid.modulus)])
        one_more = [Fluid(fluid.law, modulus, np.array([time]), 0.0) for time in times]
        found = [predict(fluid, flow) for fluid in one_more]
        rows = [np.zeros(len(flow.times)) if one is None else one["sigma12"] for one in found]
        return np.array([row if np.all(np.isfinite(row)) else np.zeros_like(row) for row in rows])

    def _once(self, what: str, flow: Flow, make: Callable[[Flow], Any]) -> Any:
        """Return what is made of a flow, made once; another flow may have the same name."""
        of, found = self._kept.get((what, flow.key), (None, None))
        if of is not flow:
            found = make(flow)
            self._kept[what, flow.key] = flow, found
        return found

    def _moved_moduli(self, flow: Flow) -> Float[np.ndarray, "c n"] | None:
        fluid = self.fluid(self.start)
        solvent = float(fluid.solvent_viscosity)
        both = np.append(np.asarray(fluid.modulus, dtype=float), solvent)
        told = np.eye(len(both))[: len(both) if solvent > 0.0 else -1]
        others = [both, *(both * (1.0 + _OF_MODULUS * one) for one in told)]
        found = [
            predict(Fluid(fluid.law, one[:-1], fluid.relaxation_time, float(one[-1])), flow)
            for one in others
        ]
        rows = [one["sigma12"] for one in found if one is not None]
        if len(rows) < len(found) or not np.all(np.isfinite(rows)):
            return None
        return (np.array(rows[1:]) - rows[0]) / _OF_MODULUS
