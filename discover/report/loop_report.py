"""The report on a closed loop: page, figures, JSON and LaTeX."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from discover.closed_loop.results.loop_result import ConstantByMode, Fold, LoopResult, Stage
from discover.effects import make_effect
from discover.equations.mathml import law_element
from discover.errors import InputError
from discover.protocols.kinematics import in_words
from discover.report.comparison_report import safe_name
from discover.report.mathtext import formula
from discover.report.overlay import Overlay
from discover.report.page import made_by, render
from discover.report.plots.by_mode import by_mode_picture
from discover.report.plots.free_form import free_form_picture
from discover.report.plots.loop import (
    ranking_picture,
    reading_picture,
    residual_picture,
    run_error_picture,
    runs_picture,
    waterfall_picture,
)
from discover.report.plots.loop_lissajous import lissajous_picture
from discover.report.plots.next_test import next_test_picture
from discover.report.plots.residual_map import loop_residual_map
from discover.report.plots.rivals import rivals_picture
from discover.report.predictions import PREDICTIONS, loop_predictions, write_predictions
from discover.report.verdicts import KINDS, QUESTIONS, loop_verdict, named
from discover.report.wording import (
    FIGURE_SYMBOLS,
    effect_title,
    effects_title,
    percent,
    significant,
)
from discover.statistics.residual import fast_part
from discover.study.run_folder import RunFolder


def write_loop(
    result: LoopResult,
    folder: RunFolder,
    name: str,
    summary: str,
    study_text: str = "",
    run: dict | None = None,
    conditions: str = "",
    overlays: Sequence[Overlay] = (),
) -> Path:
    """Write ``report.html``, ``loop.json``, ``equations.tex``, ``predictions.csv`` and the figures.

    Parameters
    ----------
    result
        What to report.
    folder
        Where to.
    name, summary
        Title, and the data and declared model in words.
    study_text
        The study file, shown at the end.
    run
        What the page says of the run that made it, where that was no command.
    conditions
        Material and temperature, for the title.
    overlays
        Curves that the study asks for beside the models.

    Returns
    -------
    The page.
    """
    pictures = [
        waterfall_picture(result),
        runs_picture(result, overlays),
        lissajous_picture(result, overlays),
        free_form_picture(result),
        loop_residual_map(result),
        residual_picture(result),
        rivals_picture(result),
        reading_picture(result),
        run_error_picture(result),
        ranking_picture(result),
        by_mode_picture(result),
        next_test_picture(result),
    ]
    drawn = [p for p in pictures if p is not None]
    for one in drawn:
        folder.write(f"figures/{safe_name(one.name)}.svg", one.svg)
    content = json.dumps(result.to_json(), indent=2, allow_nan=False, ensure_ascii=False)
    content += "\n"
    folder.write("loop.json", content)
    folder.write("equations.tex", loop_tex(result))
    predictions = write_predictions(loop_predictions(result, overlays), folder)
    page = render(
        "loop.html",
        data={PREDICTIONS: predictions, "loop.json": content},
        name=f"{name}, {conditions}" if conditions else name,
        summary=summary,
        result=result,
        questions=QUESTIONS,
        sentences=loop_verdict(result),
        error_rows=_error_rows(result) + [_overlay_row(result, one) for one in overlays],
        recorded=in_words(record.quantity for record in result.records),
        noise_range=_noise_range(result),
        run_rows=_run_rows(result),
        explanations=_explanations(result),
        inclusion=_inclusion(result),
        next_tests=_next_tests(result),
        stages=[_stage(stage, i) for i, stage in enumerate(result.stages)],
        declared_effects=_declared_effects(result),
        rankings=[_ranking(ranking) for ranking in result.rankings],
        folds=[_fold(fold) for fold in result.folds],
        law=_law(result),
        remaining=[(_REMAINING.get(key, key), value) for key, value in _flatten(result.remaining)],
        readings=[
            (f"Of the {name} model", reading.sentences)
            for name, reading in zip(("declared", "augmented"), result.readings, strict=True)
            if name == "declared" or result.stages
        ],
        pictures=drawn,
        run=run
        or made_by(
            folder.fingerprint,
            f"discover close-loop {name}.toml",
            ("loop.json", "predictions.csv", "equations.tex", "figures/*.svg"),
            study_text,
        ),
    )
    return folder.write("report.html", page)


def _overlay_row(result: LoopResult, overlay: Overlay) -> dict[str, Any]:
    """Return the mean error of an overlay where it covers a run."""
    row: dict[str, Any] = {"model": f"overlay: {overlay.label}"}
    for name, held_out in (("fit", False), ("held_out", True)):
        errors = [
            float(np.sqrt(np.mean((curve - r.measured) ** 2) / np.mean(r.measured**2)))
            for r in result.records
            if r.held_out is held_out
            and (curve := overlay.of(r.name, r.quantity)) is not None
            and np.all(np.isfinite(curve))
            and np.any(r.measured)
        ]
        row |= {name: float(np.mean(errors)) if errors else None, f"{name}_range": errors}
    return row


def _error_rows(result: LoopResult) -> list[dict[str, Any]]:
    """Return the mean error of each model and the range over the runs behind it."""

    def errors(held_out: bool, model: int) -> list[float]:
        return [float(r.errors[model]) for r in result.records if r.held_out is held_out]

    names = ["declared", *(f"+ {effect_title(stage.effect)}" for stage in result.stages)]
    pairs = [result.error_before, *(stage.error for stage in result.stages)]
    rows = [
        {
            "model": name,
            "fit": pair.fit,
            "fit_range": errors(False, model),
            "held_out": pair.held_out,
            "held_out_range": errors(True, model),
        }
        for model, (name, pair) in enumerate(zip(names, pairs, strict=True))
    ]
    if result.folds:
        before, after = (
            [getattr(f, f"error_{w}") for f in result.folds] for w in ("before", "after")
        )
        rows[0]["held_out_range"] = before
        rows.append(
            {
                "model": "as found without each run",
                "fit": None,
                "fit_range": None,
                "held_out": result.error_after.held_out,
                "held_out_range": after,
            }
        )
    return rows


def _run_rows(result: LoopResult) -> list[dict[str, Any]]:
    return [
        {
            "name": record.name,
            "held_out": record.held_out,
            "samples": record.time.size,
            "end": float(record.time[-1]) if record.is_transient else None,
            "rate": float(np.max(np.abs(record.rate))),
            "stress": float(np.sqrt(np.mean(record.measured**2))),
            "before": float(record.errors[0]),
            "after": float(record.errors[-1]),
        }
        for record in result.records
    ]


def loop_tex(result: LoopResult) -> str:
    """Return what each stage added as LaTeX."""
    lines = ["% Written by discover: what was added to the declared model, stage by stage."]
    for stage in result.stages:
        values = ", ".join(
            f"{name} = {p.value:.6g} {p.unit} [{p.ci95[0]:.6g}, {p.ci95[1]:.6g}]"
            for name, p in stage.parameters.items()
        )
        lines.append(
            f"% {stage.effect} ({stage.kind}): {values}\n"
            f"\\begin{{equation}}\n  {stage.equation}\n\\end{{equation}}"
        )
    return "\n".join(lines) + "\n"


def _noise_range(result: LoopResult) -> list[float] | None:
    """Return the noise of each fitted run; None where it was given or comes from another residual.

    The noise of a loop is a mean over the fitted runs, either of their residuals as they are or of
    the part of them that changes from sample to sample.
    """
    residuals = [r.relative_residual[-1] for r in result.records if not r.held_out]
    for of_run in (lambda values: float(np.sqrt(np.mean(values**2))), fast_part):
        noise = [of_run(values) for values in residuals]
        if noise and np.isclose(np.mean(noise), result.noise_floor, rtol=1e-3):
            return noise
    return None


def _symbols(stage: Stage) -> dict[str, str]:
    """Return the typeset symbol of each parameter, as the equation has it."""
    try:
        parameters = make_effect(stage.effect).parameters
    except InputError:  # an effect that somebody gave as an object
        return {}
    return {p.name: formula(p.symbol, f"{safe_name(stage.effect)}_{p.name}") for p in parameters}


def _stage(stage: Stage, number: int) -> dict[str, Any]:
    symbols = _symbols(stage)
    return {
        "name": stage.effect,
        "effect": effect_title(stage.effect),
        "kind": KINDS[stage.kind],
        "formula": formula(stage.equation, f"formula{number}"),
        "parameters": [
            {
                "name": named(name, p) if isinstance(p, ConstantByMode) else name,
                "symbol": symbols.get(name, "–"),
                "value": p.value,
                "ci95": p.ci95,
                "unit": p.unit,
            }
            for name, p in stage.parameters.items()
        ],
        "aliases": ", ".join(map(effect_title, stage.aliases)),
        "source": stage.source,
        "check": stage.check,
        "error": stage.error,
    }


def _explanations(result: LoopResult) -> list[dict[str, Any]]:
    """Return the explanations as lines of a table; none where there is only one that is certain."""
    chosen = result.explanations.holding([stage.effect for stage in result.stages])
    return [
        {
            "effects": effects_title(one.effects),
            "twins": "; ".join(map(effects_title, one.twins)),
            "probability": one.probability,
            "error": one.error,
            "chosen": one is chosen,
        }
        for one in result.explanations.likeliest_first
    ]


def _inclusion(result: LoopResult) -> str:
    """Return in words how probable each effect is to be in the explanation, and each kind."""
    told = result.explanations

    def listed(pairs) -> str:
        return ", ".join(f"{name} {percent(p)}" for name, p in pairs)

    kinds = {KINDS[kind]: p for kind, p in told.inclusion_by_kind.items()}
    effects = [(effect_title(name), p) for name, p in told.inclusion.items()][:_MOST_INCLUDED]
    if not effects:
        return ""
    return f"Something {listed(kinds.items())}; of the effects, {listed(effects)}."


_MOST_INCLUDED = 8
_MOST_TESTS = 8


def _next_tests(result: LoopResult) -> list[dict[str, Any]]:
    """Return the tests that tell most of which explanation is right, as lines of a table."""
    following = result.next_tests
    titles = [effects_title(effects) for effects in following.explanations]
    return [
        {
            "title": one.title,
            "quantity": FIGURE_SYMBOLS[one.quantity],
            "share": one.nats / following.open_nats,
            "pairs": "; ".join(f"{titles[i]} from {titles[j]}" for i, j in one.pairs[:_MOST_PAIRS]),
            "more": max(len(one.pairs) - _MOST_PAIRS, 0),
        }
        for one in following.tests[:_MOST_TESTS]
    ]


_MOST_PAIRS = 2


def _declared_effects(result: LoopResult) -> list[dict[str, Any]]:
    return [
        {"effect": effect_title(one.effect), "name": name, **asdict(parameter)}
        for one in result.declared_effects
        for name, parameter in one.parameters.items()
    ]


def _law(result: LoopResult) -> str:
    """Return the augmented law typeset; empty where it cannot be written out."""
    try:
        equation = result.equation()
        return law_element(equation.terms, equation.linear_relaxation, equation.named)
    except InputError:
        return ""


def _fold(fold: Fold) -> dict[str, Any]:
    return {
        "run": fold.run,
        "error_before": fold.error_before,
        "error_after": fold.error_after,
        "effects": ", ".join(map(effect_title, fold.effects)) or "none",
    }


def _ranking(ranking, shown: int = 12) -> list[dict[str, Any]]:
    return [
        {
            "effect": effect_title(c.effect),
            "kind": KINDS[c.kind],
            "score": c.score,
            "reduction": c.reduction,
            "error": c.error,
            "left_out_error": c.left_out_error,
            "aliases": ", ".join(map(effect_title, c.aliases)),
        }
        for c in ranking[:shown]
    ]


_SHARES = ("error", "floor")
"""Last words of what is a share of the root-mean-square stress."""


_REMAINING = {
    "structured": "structure left in the residual",
    "error": "error on the fitted runs",
    "noise floor": "noise",
    "linear error": "error of the linear sweep",
    "autocorrelation": "correlation of neighbouring residuals",
    "outliers": "outliers, which did not count",
    "outlier times s": "their times in s",
    "probability": "probability of such a residual, were it noise",
    "resolution": "numerical error of the prediction, relative",
    "noise known": "noise can be told from structure",
    "carries over": "runs held out are explained too",
    "without fluid": "records show nothing of the fluid",
    "not judging": "runs held out that cannot judge",
    "worst run": "run missed most",
    "worst run error": "its error",
    "description": "in words",
}
"""What is said of the residual, for those who do not read the JSON."""


def _flatten(content: Any, prefix: str = "") -> list[tuple[str, str]]:
    if isinstance(content, dict):
        rows = []
        for key, value in content.items():
            rows += _flatten(value, f"{prefix}{' / ' if prefix else ''}{key}".replace("_", " "))
        return rows
    if isinstance(content, list | tuple):
        return [(prefix, ", ".join(_cell(item) for item in content) or "none")]
    if isinstance(content, float) and prefix.endswith(_SHARES):
        return [(prefix, percent(content))]
    return [(prefix, _cell(content))]


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return significant(float(value), 3) if isinstance(value, float) else str(value)
