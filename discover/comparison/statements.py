"""What the data say of N1 and N2, which learners seldom see: open, or on which condition not.

No data say that the law is in the library. So the best that can be said of a quantity that was not
measured is conditional, and nothing is said where no law describes the data to the noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from discover.comparison.flows import MEASURED, QUANTITIES, Flow, FlowBand, relative_errors
from discover.comparison.outcome import LearnerOutcome
from discover.equations import Equation, Tested, combined
from discover.equations.equation import box_of, flow_numbers
from discover.errors import InputError
from discover.identify import Structure
from discover.learners.registry import learner_title
from discover.protocols.kinematics import LINEAR_STRAIN, ONLY_STATES
from discover.study.declared_model import StudyModel
from discover.words import percent_of

Determined = Literal["no", "if_the_law_is_in_the_library"]

IN_LIBRARY: Determined = "if_the_law_is_in_the_library"

NARROW = 0.1
"""Relative half-width of a 95 % band up to which a quantity is said to be determined."""

_NORMAL_STRESSES = ("N1", "N2")
_NO_SIGNAL = "The data hold no signal, so {} is not determined."
_ONLY_EXTENSION = "Only extension was measured, which does not say what a fluid does in shear."
_UNEXPLAINED = "No law describes these runs to the noise{}."
_FEW = (
    "The law has {} terms and {} flows tested it. So many terms can follow so few flows of any "
    "fluid. Fit more runs."
)
_TITLES = {"sigma12": "σ12"}


@dataclass(frozen=True)
class Statement:
    """What the data say of a quantity.

    `of_transients`: whether it is about transients alone, and not about steady and periodic states.
    """

    quantity: str  # one of `QUANTITIES`
    determined: Determined  # on which condition the data decide it
    text: str  # the reason, for a reader
    of_transients: bool = False

    @property
    def title(self) -> str:
        """The quantity as a reader knows it."""
        if self.of_transients:
            return "σ12 in transients"
        return _TITLES.get(self.quantity, self.quantity)

    @property
    def undetermined(self) -> bool:
        """Whether the data do not decide it."""
        return self.determined == "no"

    def leaves_open(self, quantity: str, flow: Flow) -> bool:
        """Return whether it says that a quantity is not determined in a flow."""
        if not self.undetermined or self.quantity != quantity:
            return False
        return not (self.of_transients and flow.is_of_states)

    def to_json(self) -> dict[str, Any]:
        """Return the statement as ``comparison.json`` holds it."""
        return {
            "quantity": self.quantity,
            "undetermined": self.undetermined,
            "determined": self.determined,
            "text": self.text,
        }


def make_statements(
    verdict: str, flows: Sequence[Flow], bands: Mapping[str, FlowBand], structure: Structure | None,
    spread: Mapping[str, float | None], normal_stresses_used: bool = False, terms: int = 0,
) -> list[Statement]:  # fmt: skip
    """Return what the training data say of N1 and N2, with the reason.

    `verdict`: of the comparison. `bands`: by the key of the flow. `structure`: what σ12 could say
    of the library at the law found. `spread`: relative difference of N1 and N2 between laws that
    describe the runs as well, where known. `normal_stresses_used`: whether measured normal stresses
    were part of the fit. `terms`: of the law found.
    """
    asked = [q for q in _NORMAL_STRESSES if not (normal_stresses_used and _is_measured(q, flows))]
    if verdict == "no_signal":
        return [Statement(q, "no", _NO_SIGNAL.format(q)) for q in asked]
    training = [flow for flow in flows if flow.kind == "training"]
    if training and not any(flow.in_shear for flow in training):
        return [Statement(q, "no", _ONLY_EXTENSION) for q in QUANTITIES]
    found = [Statement("sigma12", "no", ONLY_STATES, True)] if only_states(flows) else []
    return [*found, *(_said_of(q, verdict, flows, bands, structure, spread, terms) for q in asked)]


def _said_of(quantity, verdict, flows, bands, structure, spread, terms) -> Statement:
    """Return the statement on one quantity; parameters as in `make_statements`."""
    differ, of_n1 = spread.get(quantity), " of N1" if quantity == "N2" else ""
    if verdict == "unexplained":
        said = f"; the nearest differ by {percent_of(differ)}{of_n1}" if differ is not None else ""
        return Statement(quantity, "no", _UNEXPLAINED.format(said))
    if only_states(flows):
        return Statement(quantity, "no", ONLY_STATES)
    told = () if structure is None else structure.quantities
    algebra = next((one for one in told if one.quantity == quantity), None)
    if algebra is not None and algebra.verdict != "measured" and algebra.open:
        return Statement(quantity, "no", algebra.text)
    tested = flows_measured(flows)
    if terms and tested <= terms:
        return Statement(quantity, "no", _FEW.format(terms, tested))
    half_width = _widest(quantity, flows, bands)
    if half_width is None:
        return Statement(quantity, "no", "In some flow the laws that fit diverge.")
    width = f"± {percent_of(max(half_width, 1e-5))}{of_n1} (95 %)"
    if half_width > NARROW:
        return Statement(quantity, "no", f"Its band is {width} at the widest.")
    return Statement(quantity, IN_LIBRARY, f"{width} at the widest.")


def _widest(quantity: str, flows: Sequence[Flow], bands: Mapping[str, FlowBand]) -> float | None:
    """Return the largest relative half-width in flows that no fit saw; None where one has none."""
    judged = [flow for flow in flows if flow.kind in ("test", "held_out") and flow.in_shear]
    judged = judged or [flow for flow in flows if flow.kind == "training" and flow.in_shear]
    widths = []
    for flow in judged:
        if not flow.records_shear_stress:
            continue
        band = bands.get(flow.key)
        width = np.nan if band is None else band.half_widths()[quantity]
        if not np.isfinite(width):
            return None
        widths.append(width)
    return max(widths, default=None)


def _is_measured(quantity: str, flows: Sequence[Flow]) -> bool:
    return any(
        flow.kind == "training" and quantity in flow.reference and not flow.is_truth
        for flow in flows
    )


def only_states(flows: Sequence[Flow]) -> bool:
    """Return whether all that was measured are steady or periodic states, and no transient."""
    measured = [flow for flow in flows if flow.kind in MEASURED]
    return bool(measured) and all(flow.is_of_states for flow in measured)


def flows_measured(flows: Sequence[Flow]) -> int:
    """Return how many flows were measured that a law could fail in.

    Each state of a table is one, but none of an oscillation so small that it is linear.
    """
    return sum(_flows_in(flow) for flow in flows if flow.kind in MEASURED)


def _flows_in(flow: Flow) -> int:
    if flow.protocol.control == "oscillation":
        return int(np.count_nonzero(np.asarray(flow.strain) > LINEAR_STRAIN))
    return len(flow.times) if flow.is_of_states else 1


_PROJECTION = (
    "This is the network put into words (its projection on the library). The network itself has no "
    "closed form, and the errors are its own."
)


def known_equation(model: StudyModel) -> Equation | None:
    """Return the known part of a study as an equation; None where it cannot be written out."""
    try:
        return Equation.of_fluid(model.fluid)
    except InputError:
        return None


def outcome_equation(
    known: Equation, outcome: LearnerOutcome, flows: Sequence[Flow], study: str
) -> Equation:
    """Return the known part with what a learner found."""
    who = learner_title(outcome.learner)
    who = f"the {who}" if outcome.learner == "tbnn_ude" else who
    found = tuple(term.in_law for term in outcome.terms)
    time = known.mean_relaxation_time
    judged = [flow for flow in flows if flow.kind in ("test", "held_out")]
    learned_in = box_of(_numbers(flow, time) for flow in flows if flow.kind == "training")
    tested = None
    if learned_in is not None:
        judged_in = box_of(_numbers(flow, time) for flow in judged)
        tested = Tested(learned_in, judged_in, _worst(outcome, judged))
    return replace(
        known,
        # without a known part in the way, the terms keep their intervals
        terms=combined(known.terms + found) if known.terms else found,
        title=f"Law found by {who} in the study '{study}'.",
        notes=(_PROJECTION,) if outcome.learner == "tbnn_ude" else (),
        tested=tested,
    )


def _numbers(flow: Flow, time: float) -> tuple[float, float]:
    return flow_numbers(flow.times, flow.rate, time, flow.frequency)


def _worst(outcome: LearnerOutcome, judged: Sequence[Flow]) -> dict[str, float]:
    rows = [relative_errors(outcome.predictions[flow.key], flow.reference) for flow in judged]
    worst = {}
    for quantity in QUANTITIES:
        values = [value for row in rows if (value := row[quantity]) is not None]
        if values:
            worst[quantity] = max(values)
    return worst
