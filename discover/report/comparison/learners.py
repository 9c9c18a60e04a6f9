"""What each learner found, how much that leaves, and how it predicts flows that no fit saw."""

from collections.abc import Iterator

from discover.comparison.comparison import Comparison
from discover.comparison.outcome import LearnerOutcome
from discover.protocols.kinematics import in_words as quantities_in_words
from discover.report.wording import learner_as_subject, percent, sentence, terms_text, worst
from discover.words import listed, percent_of, readable, significant

_MOST_TERMS = 4
"""More are a table and no sentence."""

_DIFFERS = 0.05
"""Relative difference between network and posterior that is told."""


def learner_lines(comparison: Comparison) -> list[str]:
    """Return what became of each learner, one line each; none where the data hold no signal."""
    if comparison.verdict == "no_signal":
        return []
    return [
        " ".join(sentence([part]) for part in _parts(comparison, name, outcome))
        for name, outcome in comparison.outcomes.items()
    ]


def _parts(comparison: Comparison, name: str, outcome: LearnerOutcome) -> Iterator[str]:
    yield _of_learner(comparison, name, outcome)
    yield from _unseen(comparison, name)
    apart = {q: off for q, off in comparison.disagreement.items() if off > _DIFFERS}
    if name == "tbnn_ude" and apart:
        told = [f"{readable(q)} by {percent_of(off)}" for q, off in apart.items()]
        yield f"it differs from the posterior in {listed(told)}"
    checks = (comparison.physics.get(name) or {}).get("checks", ())
    if failed := [check["name"] for check in checks if check["passed"] is False]:
        yield f"it fails {listed(failed)}"


def _of_learner(comparison: Comparison, name: str, outcome: LearnerOutcome) -> str:
    who = learner_as_subject(name)
    left = comparison.lack_of_fit.get(name)
    missed = "" if left is None else f" and leaves {percent(left.misfit)}"
    if len(outcome.terms) > _MOST_TERMS:
        return f"{who} has {len(outcome.terms)} terms{missed}"
    if name == "tbnn_ude":
        if not outcome.terms:
            return f"{who} projects on no term{missed}"
        largest = max(outcome.terms, key=lambda term: abs(term.coefficient))
        coefficient = f"{significant(largest.coefficient)} {readable(largest.term)}"
        return f"{who} projects mostly on {coefficient}{missed}"
    share = comparison.shares.get(name, 0.0)
    chance = f" (probability {percent(share)})" if share else ""
    return f"{who} finds {terms_text(outcome)}{chance}{missed}"


def _unseen(comparison: Comparison, name: str) -> list[str]:
    """Return what becomes of a law in flows that no fit saw, inside the range and beyond."""
    predictions, parts, lost = comparison.outcomes[name].predictions, [], []
    for inside, where in ((True, "inside the fitted range"), (False, "beyond it")):
        flows = [f for f in comparison.judged if comparison.placement(f).inside is inside]
        lost += [flow.title for flow in flows if predictions[flow.key] is None]
        errors = {flow.name: comparison.errors(name, flow) for flow in flows}
        recorded = quantities_in_words(flow.protocol.quantity for flow in flows)
        said = [
            f"{symbol} by up to {percent(value)}"
            for symbol, quantity in ((recorded, "sigma12"), ("N1", "N1"), ("N2 (of N1)", "N2"))
            if (value := worst(errors, quantity)) is not None
        ]
        if said:
            parts.append(f"{listed(said)} {where}")
    told = []
    if parts:
        told.append(f"{learner_as_subject(name)} misses unseen flows: {'; '.join(parts)}")
    if lost:
        told.append(f"{learner_as_subject(name)} diverges in {listed(lost)}")
    return told
