"""The table of every law fitted to the runs of a comparison, classical and learned."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.outcome import LearnerOutcome
from discover.learners.registry import learner_title
from discover.words import estimate, interval, readable


def law_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return every law fitted to the runs, classical and learned: constants, misfit, errors.

    Errors are means, of the recorded stress, over the flows that no fit saw, those inside the
    fitted range apart from those beyond it.
    """
    placed = {flow.name: comparison.placement(flow).inside for flow in comparison.judged}
    rows = [
        {
            "law": fit.title,
            "constants": ", ".join(
                f"{readable(name)} = {estimate(value, fit.ci95[name])} ({interval(fit.ci95[name])})"
                for name, value in fit.parameters.items()
            ),
            "number": len(fit.parameters),
            "misfit": fit.misfit,
            "criterion": fit.criterion,
            **_mean_errors(fit.errors, placed),
        }
        for fit in comparison.classical
    ]
    for name, outcome in comparison.outcomes.items():
        errors = {flow.name: comparison.errors(name, flow) for flow in comparison.judged}
        left = comparison.lack_of_fit.get(name)
        rows.append(
            {
                "law": learner_title(name),
                "constants": "",
                "number": _number_of_constants(outcome),
                "misfit": None if left is None else left.misfit,
                "criterion": None,
                **_mean_errors(errors, placed),
            }
        )
    return rows


def _number_of_constants(outcome: LearnerOutcome) -> int | None:
    """Return how many numbers of a law were fitted; None of a learner that does not say."""
    if outcome.learner == "tensor_sindy":
        return sum(1 + len(term.inner) for term in outcome.terms)
    return outcome.details.get("n_constants")


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
