"""The report on a comparison: page, figures, JSON and LaTeX."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.identifiability import EXACT, Rival
from discover.comparison.outcome import LearnerOutcome
from discover.equations.mathml import law_element, term_element, term_mathml
from discover.laws.registry import LAWS
from discover.learners.result import RecoveredTerm
from discover.report.equations import equations_tex
from discover.report.page import made_by, render
from discover.report.plots.flows import SYMBOLS, flow_picture, start_up_picture, training_picture
from discover.report.plots.next_experiment import next_picture
from discover.report.plots.pipkin import error_map_picture, identifiability_picture
from discover.report.plots.residual_map import comparison_residual_map
from discover.report.plots.selection import selection_picture
from discover.report.plots.studies import high_deborah_picture, loss_picture, sweep_picture
from discover.report.plots.style import LEARNER_TITLES, Picture
from discover.report.verdicts import QUESTIONS, comparison_verdict
from discover.report.wording import (
    RULES,
    interval,
    selection_sentence,
    significant,
    spoken,
)
from discover.study.run_folder import RunFolder

_COLOURS = {"tensor_sindy": "--sparse", "tbnn_ude": "--network"}


def write_comparison(
    comparison: Comparison, folder: RunFolder, linear_relaxation: bool, study_text: str = ""
) -> Path:
    """Write ``report.html``, ``comparison.json``, ``equations.tex`` and ``figures/*.svg``.

    Parameters
    ----------
    comparison
        What to report.
    folder
        Where to.
    linear_relaxation
        Whether −σ was part of the known law.
    study_text
        The study file, shown at the end.

    Returns
    -------
    The page.
    """
    pictures, training = comparison_pictures(comparison)
    for drawn in (*pictures, *training):
        folder.write(f"figures/{safe_name(drawn.name)}.svg", drawn.svg)
    content = json.dumps(comparison.to_json(), indent=2, allow_nan=False, ensure_ascii=False)
    folder.write("comparison.json", content + "\n")
    folder.write("equations.tex", equations_tex(comparison, linear_relaxation))
    page = render(
        "comparison.html",
        comparison=comparison,
        questions=QUESTIONS,
        sentences=comparison_verdict(comparison),
        columns=[
            {"title": "before"},
            *({"title": LEARNER_TITLES[name]} for name in comparison.outcomes),
        ],
        error_rows=_error_rows(comparison),
        laws=[_law(outcome, linear_relaxation) for outcome in comparison.outcomes.values()],
        term_rows=_term_rows(comparison),
        network_interval=_network_interval(comparison),
        coefficients=_coefficients(comparison),
        pictures=pictures,
        training_pictures=training,
        selection=_selection(comparison),
        rivals_text=_rivals_text(comparison),
        structure=_structure(comparison),
        physics_titles=[LEARNER_TITLES[name] for name in comparison.physics],
        physics_rows=_physics_rows(comparison),
        proposals=_proposals(comparison),
        rivals=[_rival(rival, _titles(comparison)) for rival in comparison.rivals],
        distillations=_distillations(comparison),
        run=made_by(
            folder.fingerprint,
            f"discover compare {comparison.name}.toml --seed {comparison.seed}",
            ("comparison.json", "equations.tex", "figures/*.svg"),
            study_text,
        ),
    )
    return folder.write("report.html", page)


def comparison_pictures(comparison: Comparison) -> tuple[list[Picture], list[Picture]]:
    """Return the pictures of what was found, and those of training."""
    pictures: list[Picture | None] = [
        flow_picture(comparison, flow) if flow.oscillatory else start_up_picture(comparison, flow)
        for flow in comparison.judged
    ]
    sparse = comparison.outcomes.get("tensor_sindy")
    pictures += [
        error_map_picture(comparison),
        identifiability_picture(comparison),
        comparison_residual_map(comparison),
        None if sparse is None else selection_picture(sparse.details),
        next_picture(comparison),
        high_deborah_picture(comparison),
        sweep_picture(comparison),
    ]
    training = [training_picture(comparison), loss_picture(comparison)]
    return [p for p in pictures if p is not None], training


def _selection(comparison: Comparison) -> dict[str, Any] | None:
    """Return the sparse learner's path as the page shows it, or None where there is none."""
    sparse = comparison.outcomes.get("tensor_sindy")
    path = [] if sparse is None else sparse.details.get("path", [])
    if sparse is None or not path:
        return None
    chosen = (sparse.details.get("selectors") or {}).get("chosen", {})
    lowest = min(row["bic"] for row in path)
    rows = [
        {
            "size": row["size"],
            "math": " + ".join(term_element(name, row["inner"]) for name in row["support"]) or "–",
            "misfit": row["misfit"],
            "held_out": row["held_out"],
            "range": list(row.get("held_out_by_run", {}).values()),
            "bic": row["bic"] - lowest,
            "rules": ", ".join(
                RULES[rule] for rule, support in chosen.items() if support == row["support"]
            ),
        }
        for row in path
    ]
    titles = _titles(comparison)
    runs = [
        {
            "title": titles.get(name, name),
            "errors": [row["held_out_by_run"][name] for row in path],
        }
        for name in path[0].get("held_out_by_run", {})
    ]
    return {
        "rows": rows,
        "runs": runs,
        "sentence": selection_sentence(sparse),
    }


def safe_name(name: str) -> str:
    """Return a file name without anything that a file system could take amiss."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name)[:100]


def _error_rows(comparison: Comparison) -> list[dict[str, Any]]:
    rows = []
    for flow in comparison.judged:
        band = comparison.next_measurement.bands.get(flow.key)
        widths = {} if band is None else band.widths(with_rivals=False)
        cells = []
        for who in ("before", *comparison.outcomes):
            known = widths if who == "tensor_sindy" else {}
            cells += [
                {"value": value, "half_width": None if value is None else _half(known.get(name))}
                for name, value in comparison.errors(who, flow).items()
            ]
        rows.append({"title": flow.title, "anchor": f"flow_{flow.name}", "cells": cells})
    return rows


def _half(width: float | None) -> float | None:
    return None if width is None or not np.isfinite(width) else 0.5 * width


def _network_interval(comparison: Comparison) -> bool:
    network = comparison.outcomes.get("tbnn_ude")
    return network is None or any(term.ci95 for term in network.terms)


def _law(outcome: LearnerOutcome, linear_relaxation: bool) -> dict[str, Any]:
    return {
        "title": LEARNER_TITLES[outcome.learner],
        "colour": _COLOURS[outcome.learner],
        "math": law_element(outcome.terms, linear_relaxation),
        "message": (outcome.message[:1].upper() + outcome.message[1:]).rstrip("."),
        "seconds": outcome.train_seconds,
        "intervals": any(term.ci95 for term in outcome.terms),
    }


def _term_rows(comparison: Comparison) -> list[dict[str, Any]]:
    truth = {t.term: t for t in comparison.truth or ()}
    found: dict[str, dict[str, RecoveredTerm]] = {}
    for name, outcome in comparison.outcomes.items():
        for term in outcome.terms:
            found.setdefault(term.term, {})[name] = term
    rows = []
    for name in dict.fromkeys([*truth, *found]):
        cells, inner = [], []
        if name in truth and truth[name].inner:
            inner += [
                f"truth: {spoken(key)} = {value:.4g}" for key, value in truth[name].inner.items()
            ]
        for learner, outcome in comparison.outcomes.items():
            term = found.get(name, {}).get(learner)
            cells.append(
                {
                    "debiased": None if term is None else term.coefficient,
                    "penalised": None if term is None else term.coefficient_penalised,
                    "ci95": None if term is None else term.ci95,
                    "intervals": any(t.ci95 for t in outcome.terms),
                }
            )
            if term is not None:
                inner += [
                    f"{LEARNER_TITLES[learner]}: {spoken(key)} = {value:.4g}"
                    + (f" ({interval(term.inner_ci95[key])})" if key in term.inner_ci95 else "")
                    for key, value in term.inner.items()
                ]
                inner += [
                    f"{LEARNER_TITLES[learner]}, if the coefficient is one: {spoken(key)} = "
                    f"{value:.4g} ({interval((low, high))})"
                    for key, (value, low, high) in term.inner_at_one.items()
                ]
        true = truth.get(name)
        rows.append(
            {
                "math": term_element(name),
                "inner": ", ".join(inner),
                "truth": (0.0 if true is None else true.coefficient),
                "cells": cells,
            }
        )
    return rows


def _coefficients(comparison: Comparison) -> list[dict[str, Any]]:
    network = comparison.outcomes.get("tbnn_ude")
    table = {} if network is None else network.details.get("coefficients", {})
    return [
        {"math": term_element(name), "mean": row["mean"], "spread": row["spread"]}
        for name, row in table.items()
    ]


def _proposals(comparison: Comparison) -> list[dict[str, Any]]:
    following = comparison.next_measurement
    return [
        {
            "title": proposal.experiment.title,
            "observed": ", ".join(SYMBOLS[name] for name in proposal.observed),
            "falling": f"{len(proposal.falling)} of {len(following.laws) - 1}",
            "weakest": min(proposal.evidence.values()),
        }
        for proposal in following.proposals
    ]


def _rivals_text(comparison: Comparison) -> str:
    sparse = comparison.outcomes.get("tensor_sindy")
    text = "" if sparse is None else str(sparse.details.get("rivals_text", ""))
    # the text is on laws that were fitted; a twin follows from mathematics and is never ruled out
    exact = sum((r.errors_to_chosen["sigma12"] or 0.0) <= EXACT for r in comparison.rivals)
    twins = "One law below gives" if exact == 1 else f"{exact} laws below give"
    return f"{text} {twins} the same σ12 whatever the flow." if text and exact else text


def _titles(comparison: Comparison) -> dict[str, str]:
    """Return the flows in the field's notation, by their names."""
    return {flow.name: flow.title for flow in comparison.flows}


def _distillations(comparison: Comparison) -> list[dict[str, Any]]:
    def values(parameters: Mapping[str, float]) -> str:
        return ", ".join(f"{spoken(k)} = {significant(v)}" for k, v in parameters.items())

    return [
        {
            "teacher": LAWS[row["teacher"]].title,
            "student": LAWS[row["student"]].title,
            "penalised": values(row["penalised"]),
            "debiased": values(row["debiased"]),
            "misfit": row["misfit"],
        }
        for row in comparison.distillations
    ]


def _structure(comparison: Comparison) -> dict[str, Any] | None:
    if comparison.structure is None:
        return None
    relations = [spoken(relation.text) for relation in comparison.structure.relations]
    return {"text": comparison.structure.text, "relations": relations}


_MARKS = {True: "✓", False: "✗", None: "–"}


def _physics_rows(comparison: Comparison) -> list[dict[str, Any]]:
    """Return one row for each check, with what every law says to it."""
    reports = [report or {"checks": []} for report in comparison.physics.values()]
    names = dict.fromkeys(check["name"] for report in reports for check in report["checks"])
    rows = []
    for name in names:
        cells = []
        for report in reports:
            check = next((c for c in report["checks"] if c["name"] == name), None)
            cells.append(
                {"mark": _MARKS[None], "text": ""}
                if check is None
                else {"mark": _MARKS[check["passed"]], "text": check["text"]}
            )
        rows.append({"name": name, "cells": cells})
    return rows


def _rival(rival: Rival, titles: Mapping[str, str]) -> dict[str, Any]:
    sum_of_terms = "".join(
        f"<mo>{'−' if value < 0 else '+'}</mo>{term_mathml(name, rival.inner, abs(value))}"
        for name, value in rival.terms.items()
    ).removeprefix("<mo>+</mo>")
    place = rival.separated_by
    return {
        "math": f"<math><mrow>{sum_of_terms}</mrow></math>",
        "reason": rival.reason,
        "errors": rival.errors_to_chosen,
        "separated": f"{SYMBOLS[place['quantity']]} in "
        f"{titles.get(place['protocol'], place['protocol'])}"
        if place
        else "nothing that was tried",
    }
