"""The verdict on a comparison: what was found, how sure, what to measure next."""

from discover.comparison.comparison import Comparison
from discover.comparison.outcome import LearnerOutcome
from discover.protocols.kinematics import in_words as quantities_in_words
from discover.report.wording import (
    learner_as_subject,
    percent,
    readable,
    sentence,
    significant,
    terms_text,
    worst,
)
from discover.words import effects_title, listed, percent_of

_MOST_TERMS = 4
"""More are a table and no sentence."""

_DIFFERS = 0.05
"""Relative difference between network and posterior that is told."""


def comparison_verdict(comparison: Comparison) -> list[str]:
    """Return the verdict on a comparison: an answer to each of `QUESTIONS`, in order."""
    return [what_was_found(comparison), how_sure(comparison), what_to_measure_next(comparison)]


def what_was_found(comparison: Comparison) -> str:
    """Return whether a law describes the data to the noise, and what each learner found."""
    if comparison.verdict == "no_signal":
        return "No signal: these runs hold no more than noise, so no law is reported."
    posterior = comparison.posterior
    effects = effects_title([stage.effect for stage in posterior.stages])
    noise = percent(posterior.noise_floor)
    if comparison.verdict == "explained":
        what = f"the known part with {effects}" if effects else "the known part alone"
        parts = [f"explained: {what} describes the runs to the noise ({noise})"]
    else:
        size = posterior.discrepancy
        left = "" if size is None else f", which leaves {percent(size['size'])}"
        what = f"best is {effects}{left}" if effects else f"best is the known part{left}"
        parts = [f"unexplained: no law that was tried describes the runs to the noise; {what}"]
    parts += [_of_learner(comparison, name, one) for name, one in comparison.outcomes.items()]
    return sentence(parts)


def _of_learner(comparison: Comparison, name: str, outcome: LearnerOutcome) -> str:
    who = learner_as_subject(name)
    who = who[:1].lower() + who[1:]
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


def how_sure(comparison: Comparison) -> str:
    """Return the errors on unseen flows, and what is not determined."""
    if comparison.verdict == "no_signal":
        return "Nothing is determined by these data."
    parts = [part for name in comparison.outcomes for part in _unseen(comparison, name)]
    if not parts:
        parts.append("no run was held out, so no prediction was tested")
    if open_ := [s.title for s in comparison.statements if s.undetermined]:
        parts.append(f"not determined by these data: {listed(open_)}")
    if sure := [s.title for s in comparison.statements if not s.undetermined]:
        ends = "s" if len(sure) == 1 else ""
        parts.append(f"{listed(sure)} follow{ends} from σ12 if the law is in the library")
    apart = {q: off for q, off in comparison.disagreement.items() if off > _DIFFERS}
    if apart:
        told = [f"{readable(q)} by {percent_of(off)}" for q, off in apart.items()]
        parts.append(f"the network differs from the posterior in {listed(told)}")
    for name, report in comparison.physics.items():
        failed = [c["name"] for c in (report or {}).get("checks", ()) if c["passed"] is False]
        if failed:
            parts.append(f"{learner_as_subject(name)} fails {listed(failed)}")
    return " ".join(sentence([part]) for part in parts)


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


def what_to_measure_next(comparison: Comparison) -> str:
    """Return the measurement that would tell most."""
    return comparison.answer.next_test
