"""The table of every law fitted to the runs of a comparison, classical and learned."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.outcomes.constant import in_words as constant_in_words
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.learners.registry import learner_title
from discover.report.plots.by_mode import by_mode_in_brief
from discover.report.wording import effects_title, readable, significant


def law_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return every law fitted to the runs, classical and learned: constants, misfit, errors.

    Errors are means, of the recorded stress, over the flows that no fit saw, those inside the
    fitted range apart from those beyond it.
    """
    placed = {flow.name: comparison.placement(flow).inside for flow in comparison.judged}
    one_mode = comparison.known is None or len(comparison.known.modulus) == 1
    rows = []
    for fit in comparison.classical:
        end = " (the end of its range)" if fit.at_bound else ""
        constants = [
            f"{readable(name)} = {significant(value, 3)}{end}"
            for name, value in fit.parameters.items()
        ]
        constants += [
            f"{constant_in_words(name, one_mode)} = {significant(value, 3)}"
            for name, value in fit.along.items()
        ]
        rows.append(
            {
                "law": fit.title,
                "constants": ", ".join(constants),
                "number": len(fit.parameters) + len(fit.along),
                "misfit": fit.misfit,
                "criterion": fit.criterion,
                **_mean_errors(fit.errors, placed),
            }
        )
    if comparison.by_mode is not None:
        rows.append(_row_by_mode(comparison.by_mode, placed))
    for name, outcome in comparison.outcomes.items():
        errors = {flow.name: comparison.errors(name, flow) for flow in comparison.judged}
        path, chosen = outcome.details.get("path") or (), outcome.details.get("chosen")
        left = comparison.explanation.lack_of_fit.get(name)
        rows.append(
            {
                "law": learner_title(name),
                "constants": ", ".join(
                    f"{constant_in_words(c.name, one_mode)} = {significant(c.value, 3)}"
                    for c in outcome.constants.values()
                ),
                "number": _number_of_constants(outcome),
                "misfit": None if left is None else left.misfit,
                # of moduli that may move it would say less of the misfit than classical laws' do
                "criterion": path[chosen].get("bic_at_exact_moduli", path[chosen]["bic"])
                if path and chosen is not None
                else None,
                **_mean_errors(errors, placed),
            }
        )
    least = min((row["criterion"] for row in rows if row["criterion"] is not None), default=0.0)
    for row in rows:
        if row["criterion"] is not None:
            row["criterion"] -= least
    return rows


def _row_by_mode(law: LawByMode, placed: Mapping[str, bool]) -> dict[str, Any]:
    errors = {name: {"recorded": law.errors.get(name)} for name in placed}
    return {
        "law": f"constants by mode: {effects_title([*law.constants])}",
        "constants": "; ".join(
            by_mode_in_brief(name, constant) for name, constant in law.constants.items()
        ),
        "number": law.n_constants,
        "misfit": law.left.misfit,
        "criterion": None,  # it counts the samples that this law leaves independent
        **_mean_errors(errors, placed),
    }


def _number_of_constants(outcome: LearnerOutcome) -> int | None:
    """Return how many numbers of a law were fitted; None of a learner that does not say."""
    if outcome.learner == "tensor_sindy":
        own = sum(1 + len(term.inner) for term in outcome.terms)
    elif (own := outcome.details.get("n_constants")) is None:
        return None
    return own + len(outcome.constants)


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
