"""What the learners of a comparison found, as equations with the box in which they were tested."""

from collections.abc import Sequence
from dataclasses import replace

from discover.comparison.flows import QUANTITIES, Flow, relative_errors
from discover.comparison.outcome import LearnerOutcome
from discover.equations import Equation, Tested, combined, law_parts
from discover.equations.equation import box_of, flow_numbers
from discover.errors import InputError
from discover.learners.registry import learner_title
from discover.study.declared_model import DeclaredModel

_PROJECTION = (
    "This is the network put into words (its projection on the library). The network itself has no "
    "closed form, and the errors are its own."
)


def known_equation(model: DeclaredModel) -> Equation | None:
    """Return the known part of a study as an equation; None where it cannot be written out."""
    try:
        named, terms = law_parts(model.law)
    except InputError:
        return None
    return Equation(
        terms,
        tuple(float(g) for g in model.modulus),
        tuple(float(time) for time in model.relaxation_time),
        model.law.linear_relaxation,
        float(model.solvent_viscosity),
        named=named,
    )


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
