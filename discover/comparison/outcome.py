"""Outcome of one learner: its law, what it does in all flows, where they lie, what it leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from discover import identify
from discover.comparison.flows import DRAWN, QUANTITIES, Flow, FlowBand, Stresses, columns_of
from discover.forward import make_batch
from discover.forward.of_fluids import bare_run, followed, observed, pieces_in_time
from discover.laws import Fluid
from discover.learners import LearnerResult, RecoveredTerm
from discover.learners.files import kept_in_files
from discover.learners.lack_of_fit import LackOfFit
from discover.learners.results import TermTables


@kept_in_files
@dataclass(frozen=True)
class LearnerOutcome(TermTables):
    """Result of a learner with its predictions in every flow of the comparison.

    `predictions`: by the key of the flow; None where the law diverges. `physics`: from
    `PhysicsReport.to_json`; None where not made. `bands`: by key, of the members of an ensemble;
    none where one diverges.
    """

    learner: str  # name of the learner
    terms: tuple[RecoveredTerm, ...]  # the law term by term
    train_seconds: float  # wall-clock time of the fit
    details: Mapping[str, Any] = field(default_factory=dict)
    message: str = ""  # one sentence on how the fit ended
    predictions: Mapping[str, Stresses | None] = field(default_factory=dict)
    physics: Mapping[str, Any] | None = None
    bands: Mapping[str, FlowBand] = field(default_factory=dict)
    left: LackOfFit | None = None  # of the runs that it learned from


def bands_of_members(
    result: LearnerResult, fluid: Fluid, flows: list[Flow], own: Mapping[str, Stresses | None]
) -> dict[str, FlowBand]:
    """Return what the members of an ensemble span, by flow; `own`: what the whole predicts."""
    if len(result.members) < 2:
        return {}
    others = [replace(fluid, law=law) for law in result.members if law is not result.law]
    members = [own, *(simulated(member, flows) for member in others)]
    bands = {}
    for flow in flows:
        told = [p for member in members if (p := member[flow.key]) is not None]
        if flow.kind in DRAWN and len(told) == len(members):
            rows = {q: np.stack([p[q] for p in told]) for q in QUANTITIES}
            low, high = ({q: end(v, axis=0) for q, v in rows.items()} for end in (np.min, np.max))
            bands[flow.key] = FlowBand(told[0], low, high)
    return bands


MARGIN = 1.05
"""What exceeds the fitted flows by less than this factor is inside: samples of one cycle hit its
peak to some per cent only."""


_NUMBERS = {"shear rate": "shear rate (Wi)", "frequency": "frequency (De)"}
"""What exceeds, with the number that grows as it does."""


@dataclass(frozen=True)
class Placement:
    """Where a flow lies against the fitted ones."""

    beyond: Mapping[str, float]  # what exceeds the fitted flows, as a factor over their largest
    new_flow: str = ""  # which flow it is, where no fitted one is of that kind; empty otherwise

    @property
    def inside(self) -> bool:
        """Whether nothing exceeds the fitted flows, and flows of the kind were fitted."""
        return not (self.beyond or self.new_flow)

    @property
    def text(self) -> str:
        """The placement in a few words."""
        if self.inside:
            return "inside the fitted range"
        parts = [
            f"{_NUMBERS.get(name, name)} {factor:.2g} times the largest"
            for name, factor in self.beyond.items()
        ]
        if self.new_flow:
            what = "shear" if self.new_flow == "shear" else f"{self.new_flow} extension"
            parts.insert(0, f"{what}, of which nothing was fitted")
        return f"beyond the fitted range: {', '.join(parts)}"

    def to_json(self) -> dict[str, Any]:
        """Return the placement as ``comparison.json`` holds it."""
        said = {"inside": self.inside, "beyond": self.beyond}
        return said | ({"new_flow": self.new_flow} if self.new_flow else {})


def place(flow: Flow, training: Sequence[Flow]) -> Placement:
    """Return where a flow lies against the fitted ones; slower or smaller flows are inside."""
    kind = flow.protocol.flow
    alike = [other for other in training if other.protocol.flow == kind]
    others, rate_name = alike or training, "shear rate" if kind == "shear" else "Hencky rate"
    factors = {
        rate_name: _ratio(flow.largest_rate, [other.largest_rate for other in others]),
        "strain": _ratio(_largest(flow.strain), [_largest(other.strain) for other in others]),
    }
    frequencies = [f for other in training if (f := other.frequency) is not None]
    # where one of the two does not oscillate there is none: a step excites every frequency
    if flow.frequency is not None and len(frequencies) == len(training):
        factors["frequency"] = _ratio(flow.frequency, frequencies)
    beyond = {name: factor for name, factor in factors.items() if factor > MARGIN}
    return Placement(beyond, "" if alike else kind)


def _largest(values: np.ndarray) -> float:
    # a flow curve says nothing of strain, its states have gone through any
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _ratio(value: float, others: Sequence[float]) -> float:
    largest = max(others, default=0.0)
    return value / largest if largest > 0.0 else float("inf") if value > 0.0 else 0.0


_STRAIN_STEP = 0.15
"""Largest strain of a step: the stress of a Giesekus fluid is then off by less than 1e-6."""


def simulated(fluid: Fluid, flows: Sequence[Flow]) -> dict[str, Stresses | None]:
    """Return what a fluid does in flows, by key; None where the law diverges."""
    runs = [followed(fluid, bare_run(flow.protocol, flow.times)) for flow in flows]
    limits: dict[str, Any] = {"relaxation_time": fluid.settling_time}
    limits["pieces"] = pieces_in_time(fluid, runs, _STRAIN_STEP)
    found = observed([fluid], make_batch(runs, _STRAIN_STEP, **limits))[0]
    rows = [(flow.key, own[: len(flow.times)]) for flow, own in zip(flows, found, strict=True)]
    return {key: columns_of(own) if np.all(np.isfinite(own)) else None for key, own in rows}


def physics_of(fluid: Fluid, flows: Sequence[Flow]) -> dict[str, Any]:
    """Return checks of a fluid's physical soundness as JSON-able values."""
    training = [flow for flow in flows if flow.kind == "training"] or flows
    return identify.check_physics(fluid, max(flow.largest_rate for flow in training)).to_json()
