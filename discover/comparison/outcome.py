"""What one learner found and predicts, in a form that can be kept in a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, Real

from discover.comparison.flows import DRAWN, QUANTITIES, Flow, Stresses, predict
from discover.laws.multimode import Fluid
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.results.term_tables import TermTables
from discover.plain_json import plain

Limits = Mapping[str, tuple[Float[np.ndarray, " _"], Float[np.ndarray, " _"]]]
"""Lowest and highest value of some of `QUANTITIES`, each of shape (n,)."""


@dataclass(frozen=True)
class LearnerOutcome(TermTables):
    """A learner's result with its predictions in every flow of the comparison.

    `loss_history`: iterations and losses, both of shape (m,).
    `details`: what else the learner says; JSON-able.
    `predictions`: by the key of the flow; None where the law runs away.
    `physics`: checks of physical soundness, as from `PhysicsReport.to_json`; None where not made.
    `bands`: by the key of the flow: lowest and highest prediction of each quantity over the members
        of an ensemble. None for a flow in which one of them runs away; empty where there is one
        law.
    """

    learner: str  # name of the learner
    terms: tuple[RecoveredTerm, ...]  # the law term by term
    train_seconds: float  # wall-clock time of the fit
    loss_history: tuple[Real[np.ndarray, " m"], Real[np.ndarray, " m"]]
    details: Mapping[str, Any] = field(default_factory=dict)
    message: str = ""  # one sentence on how the fit ended
    predictions: Mapping[str, Stresses | None] = field(default_factory=dict)
    physics: Mapping[str, Any] | None = None
    bands: Mapping[str, Limits | None] = field(default_factory=dict)

    def half_widths(self, flow: Flow) -> dict[str, float]:
        """Return the root-mean-square half-width of each band over that of the prediction.

        N2's is relative to N1, as its error is. Empty where there is no band.
        """
        limits, predicted = self.bands.get(flow.key), self.predictions.get(flow.key)
        if limits is None or predicted is None:
            return {}
        found = {}
        for quantity, (low, high) in limits.items():
            size = np.linalg.norm(predicted["N1" if quantity == "N2" else quantity])
            if size > 0:
                found[quantity] = float(0.5 * np.linalg.norm(high - low) / size)
        return found

    @classmethod
    def of(cls, result: LearnerResult, fluid: Fluid, flows: list[Flow]) -> "LearnerOutcome":
        """Return the outcome of a fit, with the fluid it found simulated in every flow."""
        predictions = {flow.key: predict(fluid, flow) for flow in flows}
        return cls(
            result.learner,
            result.terms,
            result.train_seconds,
            result.loss_history,
            result.details,
            result.message,
            predictions,
            bands=_bands(result, fluid, flows),
        )

    def to_state(self) -> dict[str, Any]:
        """Return everything as JSON-able values; `from_state` undoes it exactly."""
        return {
            "learner": self.learner,
            "terms": [term.to_json() for term in self.terms],
            "train_seconds": self.train_seconds,
            "loss_history": [np.asarray(part).tolist() for part in self.loss_history],
            "details": plain(self.details),
            "message": self.message,
            "predictions": {
                name: None if p is None else {q: v.tolist() for q, v in p.items()}
                for name, p in self.predictions.items()
            },
            "physics": plain(self.physics),
            "bands": {
                name: None
                if b is None
                else {q: [v.tolist() for v in pair] for q, pair in b.items()}
                for name, b in self.bands.items()
            },
        }

    @classmethod
    def from_state(cls, state: Mapping[str, Any]) -> "LearnerOutcome":
        """Return the outcome that was kept."""
        terms = tuple(RecoveredTerm.from_json(term) for term in state["terms"])
        iterations, losses = (np.asarray(part, dtype=float) for part in state["loss_history"])
        predictions = {
            name: None if p is None else {q: np.asarray(v, dtype=float) for q, v in p.items()}
            for name, p in state["predictions"].items()
        }
        return cls(
            state["learner"],
            terms,
            float(state["train_seconds"]),
            (iterations, losses),
            state["details"],
            state["message"],
            predictions,
            state.get("physics"),
            {
                name: None
                if b is None
                else {q: (np.asarray(low), np.asarray(high)) for q, (low, high) in b.items()}
                for name, b in state.get("bands", {}).items()
            },
        )


def _bands(result: LearnerResult, fluid: Fluid, flows: list[Flow]) -> dict[str, Limits | None]:
    if len(result.members) < 2:
        return {}
    fluids = [
        Fluid(law, fluid.modulus, fluid.relaxation_time, fluid.solvent_viscosity)
        for law in result.members
    ]
    bands: dict[str, Limits | None] = {}
    for flow in flows:
        if flow.kind not in DRAWN:
            continue
        predicted = [predict(member, flow) for member in fluids]
        told = [p for p in predicted if p is not None]
        bands[flow.key] = None
        if len(told) == len(fluids):
            rows = {q: np.stack([p[q] for p in told]) for q in QUANTITIES}
            bands[flow.key] = {q: (v.min(axis=0), v.max(axis=0)) for q, v in rows.items()}
    return bands
