"""The tables of a comparison's page, row by row, as the templates take them."""

import re
from collections.abc import Iterator, Mapping
from itertools import chain
from typing import Any

import numpy as np

from discover import words
from discover.comparison import Comparison, LearnerOutcome
from discover.comparison.rivals import Rival
from discover.equations import Equation
from discover.equations.markup import law_element, sum_elements
from discover.learners import RecoveredTerm
from discover.learners.registry import learner_title
from discover.report.plots.style import learner_colour
from discover.report.wording import known, learner_as_subject, percent, sentence, terms_text


def error_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return the errors in flows that no fit saw, with half of the band where there is one."""
    rows = []
    for flow in comparison.unseen_flows:
        cells = []
        for who in ("before", *comparison.outcomes):
            band = None if who == "before" else comparison.outcomes[who].bands.get(flow.key)
            if who == "tensor_sindy":
                band = comparison.determined_band(flow) if comparison.determined_terms else None
            widths = {} if band is None else band.half_widths()
            finite = {name: width for name, width in widths.items() if known(width)}
            law = comparison.before if who == "before" else comparison.outcomes[who].predictions
            cells += [
                {
                    "value": value,
                    "half_width": None if value is None else finite.get(name),
                    "runs_away": law[flow.key] is None and name in flow.reference,
                }
                for name, value in comparison.errors(who, flow).items()
            ]
        rows.append(
            {
                "title": flow.title,
                "anchor": f"flow_{flow.name}",
                "range": comparison.placement(flow).text,
                "cells": cells,
            }
        )
    return rows


def laws_fitted(comparison: Comparison) -> dict[str, Any]:
    """Return every law fitted to the runs, classical and learned: constants, misfit, errors.

    Errors are means, of the recorded stress, over the flows that no fit saw, those inside the
    fitted range apart from those beyond it, and whether there are such.
    """
    placed = {flow.name: comparison.placement(flow).inside for flow in comparison.unseen_flows}
    rows = [
        {
            "law": fit.title,
            "constants": ", ".join(
                f"{words.readable(name)} = {words.estimate(value, ends)} ({words.interval(ends)})"
                for name, value in fit.parameters.items()
                for ends in [fit.ci95[name]]
            ),
            "number": len(fit.parameters),
            "misfit": fit.misfit,
            "criterion": fit.criterion,
            **_mean_errors(fit.errors, placed),
        }
        for fit in comparison.classical
    ]
    for name, outcome in comparison.outcomes.items():
        errors = {flow.name: comparison.errors(name, flow) for flow in comparison.unseen_flows}
        left = comparison.lack_of_fit.get(name)
        number = outcome.details.get("n_constants")  # None of a learner that does not say
        if outcome.learner == "tensor_sindy":
            number = sum(1 + len(term.inner) for term in outcome.terms)
        rows.append(
            {
                "law": learner_title(name),
                "constants": "",
                "number": number,
                "misfit": None if left is None else left.misfit,
                "criterion": None,
                **_mean_errors(errors, placed),
            }
        )
    judged = placed.values()
    return {"rows": rows, "inside": True in judged, "beyond": False in judged}


def _mean_errors(
    errors: Mapping[str, Mapping[str, float | None]], inside: Mapping[str, bool]
) -> dict[str, float | None]:
    """Return the mean error of the recorded stress inside the fitted range and beyond it."""
    means: dict[str, float | None] = {}
    for name, wanted in (("inside", True), ("beyond", False)):
        flows = [flow for flow, is_inside in inside.items() if is_inside is wanted]
        # what is recorded comes first
        values = [next(iter(errors[flow].values())) for flow in flows]
        said = [value for value in values if value is not None]
        # a law that cannot be integrated through one of the flows has no mean
        means[name] = float(np.mean(said)) if said and len(said) == len(values) else None
    return means


STANDING = {
    "explained": "",
    "unexplained": "None of these laws describes the data to the noise. They are the best "
    "descriptions in their class.",
    "no_signal": "The data hold no signal, so no law is reported.",
}
CONDITION = {
    True: "The intervals hold if the law is in the library, with small instrument errors "
    "fitted jointly.",
    False: "The intervals hold for this law alone, which is not the likeliest.",
}
NO_TERM = {
    "explained": "No term: the known part alone explains the data.",
    "unexplained": "No term.",
    "no_signal": "No term is reported: the data hold no signal.",
}


def law(outcome: LearnerOutcome, linear_relaxation: bool, known: Equation) -> dict[str, Any]:
    """Return a law found with the known part below it, as mathematics, and how its fit ended."""
    message = (outcome.message[:1].upper() + outcome.message[1:]).rstrip(".")
    if (missed := outcome.details.get("projection_misfit")) is not None and outcome.terms:
        message += f"; the terms above reproduce the network's correction to {percent(missed)}"
    named = known.named
    if named is not None and not named.is_written:
        message += f". Add the h of the known law {named.law}, which has no written form"
        named = None
    return {
        "title": learner_title(outcome.learner),
        "colour": learner_colour(outcome.learner),
        "math": law_element([*known.terms, *outcome.terms], linear_relaxation, named),
        "message": message,
        "seconds": outcome.train_seconds,
    }


def has_intervals(outcome: LearnerOutcome) -> bool:
    """Return whether terms have intervals: those of a network alone have none."""
    return any(term.ci95 for term in outcome.terms)


def term_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return the terms that were found, or should have been, with those of each learner."""
    truth = {t.term: t for t in comparison.truth or ()}
    found = {n: {t.term: t for t in one.terms} for n, one in comparison.outcomes.items()}
    rows = []
    for name in dict.fromkeys(chain(truth, *found.values())):
        true, own = truth.get(name), {learner: terms.get(name) for learner, terms in found.items()}
        inner = [] if true is None else [f"truth: {_equals(*one)}" for one in true.inner.items()]
        for learner, term in own.items():
            inner += [] if term is None else _inner(learner_title(learner), term)
        size = 0.0 if true is None else true.coefficient
        rows.append({"term": name, "inner": ", ".join(inner), "truth": size, "found": own})
    return rows


def _inner(who: str, term: RecoveredTerm) -> Iterator[str]:
    for key, value in term.inner.items():
        ends = f" ({words.interval(term.inner_ci95[key])})" if key in term.inner_ci95 else ""
        yield f"{who}: {_equals(key, value)}{ends}"


def _equals(name: str, value: float) -> str:
    return f"{words.readable(name)} = {words.significant(value)}"


def physics_checks(comparison: Comparison) -> dict[str, list[Mapping[str, Any] | None]]:
    """Return what every law says to each check, by its name; None where it was not made."""
    reports = [
        {check["name"]: check for check in (report or {"checks": ()})["checks"]}
        for report in comparison.physics.values()
    ]
    names = dict.fromkeys(chain(*reports))
    return {name: [own.get(name) for own in reports] for name in names}


_LAW_SPELLED = re.compile(r"^h = .*? (?=(?:leaves|gives|predicts) )")


def rival_row(rival: Rival, comparison: Comparison) -> dict[str, Any]:
    """Return a law that the data do not tell from the one found."""
    place, titles = rival.separated_by, {flow.name: flow.title for flow in comparison.flows}
    return {
        "math": sum_elements(rival.law.terms),
        # it stands above the sentence
        "reason": _LAW_SPELLED.sub("It ", rival.reason),
        "errors": rival.errors_to_chosen,
        "separated": f"{words.FIGURE_SYMBOLS.get(place['quantity'], place['quantity'])} in "
        f"{titles.get(place['protocol'], place['protocol'])}"
        if place
        else "nothing that was tried",
    }


_MOST_TERMS = 4  # More are a table and no sentence
_DIFFERS = 0.05  # Relative difference between network and posterior that is told


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
    lost = [flow.title for flow in comparison.unseen_flows if outcome.predictions[flow.key] is None]
    if lost:
        yield f"{learner_as_subject(name)} diverges in {words.listed(lost)}"
    apart = {q: off for q, off in comparison.disagreement.items() if off > _DIFFERS}
    if name == "tbnn_ude" and apart:
        told = [f"{words.readable(q)} by {words.percent_of(off)}" for q, off in apart.items()]
        yield f"it differs from the posterior in {words.listed(told)}"
    checks = (comparison.physics.get(name) or {}).get("checks", ())
    if failed := [check["name"] for check in checks if check["passed"] is False]:
        yield f"failed checks: {words.listed(failed)}"


def _of_learner(comparison: Comparison, name: str, outcome: LearnerOutcome) -> str:
    who = learner_as_subject(name)
    left = comparison.lack_of_fit.get(name)
    missed = "" if left is None else f"; misfit {percent(left.misfit)}"
    if len(outcome.terms) > _MOST_TERMS:
        return f"{who} has {len(outcome.terms)} terms{missed}"
    if name == "tbnn_ude":
        if not outcome.terms:
            return f"{who} is close to no term{missed}"
        largest = max(outcome.terms, key=lambda term: abs(term.coefficient))
        coefficient = f"{words.significant(largest.coefficient)} {words.readable(largest.term)}"
        return f"{who} is mostly {coefficient}{missed}"
    share = comparison.shares.get(name, 0.0)
    chance = f" (probability {percent(share)})" if share else ""
    return f"{who} finds {terms_text(outcome)}{chance}{missed}"
