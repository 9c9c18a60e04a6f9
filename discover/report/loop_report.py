"""The report on a closed loop: page, figures, JSON and LaTeX."""

import json
from pathlib import Path
from typing import Any

from discover.closed_loop.loop import ONLY_NOISE
from discover.closed_loop.result import Fold, LoopResult, Stage
from discover.equations.mathml import law_element
from discover.errors import InputError
from discover.report.comparison_report import safe_name
from discover.report.mathtext import formula
from discover.report.page import render
from discover.report.plots.loop import (
    ranking_picture,
    reading_picture,
    residual_picture,
    run_error_picture,
    runs_picture,
    waterfall_picture,
)
from discover.report.wording import interval, percent, significant, spoken
from discover.study.run_folder import RunFolder

_VERDICTS = {
    "effects_added": "The declared model lacked something, and adding it explains the data",
    "no_effect_needed": "The declared model explains the data; no effect earned its place",
    "unexplained": "What is left still has structure that no candidate explains",
}
_KINDS = {
    "constitutive": "in the fluid",
    "kinematic": "in the flow that the fluid felt",
    "signal": "in the instrument's signal",
}


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop, a few sentences."""
    before, after = result.error_before, result.error_after
    sentences = [_VERDICTS[result.verdict] + "."]
    if result.verdict == "no_effect_needed" and after.fit > ONLY_NOISE:
        sentences = ["The records hold hardly anything but noise, so they say nothing of any law."]
    for stage in result.stages:
        values = ", ".join(
            f"{name} = {significant(p.value, 3)} {p.unit}".rstrip() + f" ({interval(p.ci95)})"
            for name, p in stage.parameters.items()
        )
        text = f"Added {_KINDS[stage.kind]}: {spoken(stage.effect)}, {values}."
        if stage.aliases:
            others = ", ".join(map(spoken, stage.aliases))
            text += f" These data cannot tell it from {others}."
        sentences.append(text)
    change = f"Error on fitted runs: {percent(before.fit)} before, {percent(after.fit)} after"
    if before.held_out is not None:
        unseen = "runs that no fit saw"
        if result.folds:
            unseen = "each run by a search that did not see it"
        change += (
            f"; on {unseen}: {percent(before.held_out)} before, {percent(after.held_out)} after"
        )
    sentences.append(f"{change}. The noise is about {percent(result.noise_floor)}.")
    return sentences


def write_loop(
    result: LoopResult, folder: RunFolder, name: str, summary: str, study_text: str = ""
) -> Path:
    """Write ``report.html``, ``loop.json``, ``equations.tex`` and ``figures/*.svg``.

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

    Returns
    -------
    The page.
    """
    pictures = [
        waterfall_picture(result),
        runs_picture(result),
        residual_picture(result),
        reading_picture(result),
        run_error_picture(result),
        ranking_picture(result),
    ]
    drawn = [p for p in pictures if p is not None]
    for one in drawn:
        folder.write(f"figures/{safe_name(one.name)}.svg", one.svg)
    content = json.dumps(result.to_json(), indent=2, allow_nan=False, ensure_ascii=False)
    folder.write("loop.json", content + "\n")
    folder.write("equations.tex", loop_tex(result))
    page = render(
        "loop.html",
        name=name,
        summary=summary,
        result=result,
        verdict=loop_verdict(result),
        stages=[_stage(stage, i) for i, stage in enumerate(result.stages)],
        rankings=[_ranking(ranking) for ranking in result.rankings],
        folds=[_fold(fold) for fold in result.folds],
        law=_law(result),
        remaining=_flatten(result.remaining),
        readings=[
            (f"Of the {name} model", reading.sentences)
            for name, reading in zip(("declared", "augmented"), result.readings, strict=True)
        ],
        pictures=drawn,
        study_text=study_text,
    )
    return folder.write("report.html", page)


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


def _stage(stage: Stage, number: int) -> dict[str, Any]:
    return {
        "effect": spoken(stage.effect) if "sigma" in stage.effect else stage.effect,
        "kind": _KINDS[stage.kind],
        "formula": formula(stage.equation, f"formula{number}"),
        "parameters": [
            {"name": name, "value": p.value, "ci95": p.ci95, "unit": p.unit}
            for name, p in stage.parameters.items()
        ],
        "aliases": ", ".join(map(spoken, stage.aliases)),
        "source": stage.source,
        "check": stage.check,
        "error": stage.error,
    }


def _law(result: LoopResult) -> str:
    """Return the augmented law typeset; empty where it is no sum of library terms."""
    try:
        equation = result.equation()
    except InputError:
        return ""
    return law_element(equation.terms, equation.linear_relaxation)


def _fold(fold: Fold) -> dict[str, Any]:
    return {
        "run": fold.run,
        "error_before": fold.error_before,
        "error_after": fold.error_after,
        "effects": ", ".join(map(spoken, fold.effects)) or "none",
    }


def _ranking(ranking, shown: int = 12) -> list[dict[str, Any]]:
    return [
        {
            "effect": spoken(c.effect),
            "kind": _KINDS[c.kind],
            "score": c.score,
            "reduction": c.reduction,
            "error": c.error,
            "left_out_error": c.left_out_error,
            "aliases": ", ".join(map(spoken, c.aliases)),
        }
        for c in ranking[:shown]
    ]


_SHARES = ("error", "floor")
"""Last words of what is a share of the root-mean-square stress."""


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
