"""The tables of a closed loop's page, as rows."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from discover.effects import make_effect
from discover.equations.spelling.markup import law_element
from discover.errors import InputError
from discover.inference.by_mode.constants import ConstantByMode
from discover.loop.loop_result import LoopResult
from discover.loop.parts import CandidateScore, Fold, Stage
from discover.report.loop.verdict import KINDS, named
from discover.report.mathtext import formula
from discover.report.overlay import Overlay
from discover.report.page import safe_name
from discover.report.plots.loop.errors import MOST_RANKED
from discover.report.wording import percent
from discover.statistics.projection import rms
from discover.statistics.residual import fast_part
from discover.words import FIGURE_SYMBOLS, effect_title, effects_title, significant


def overlay_row(result: LoopResult, overlay: Overlay) -> dict[str, Any]:
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


def error_rows(result: LoopResult) -> list[dict[str, Any]]:
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
                "model": "runs left out in turn",
                "fit": None,
                "fit_range": None,
                "held_out": result.error_after.held_out,
                "held_out_range": after,
            }
        )
    return rows


def run_rows(result: LoopResult) -> list[dict[str, Any]]:
    """Return what each run holds, and its errors before and after."""
    return [
        {
            "name": record.name,
            "held_out": record.held_out,
            "samples": record.time.size,
            "end": float(record.time[-1]) if record.is_transient else None,
            "rate": float(np.max(np.abs(record.rate))),
            "stress": rms(record.measured),
            "before": float(record.errors[0]),
            "after": float(record.errors[-1]),
        }
        for record in result.records
    ]


def noise_range(result: LoopResult) -> list[float] | None:
    """Return the noise of each fitted run; None where it was given or comes from another residual.

    The noise of a loop is a mean over the fitted runs, either of their residuals as they are or of
    the part of them that changes from sample to sample.
    """
    residuals = [r.relative_residual[-1] for r in result.records if not r.held_out]
    for of_run in (rms, fast_part):
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


def stage_row(stage: Stage, number: int) -> dict[str, Any]:
    """Return what a stage added; its `number` tells its formula's marks from those of others."""
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
                "left_open": name in stage.left_open,
            }
            for name, p in stage.parameters.items()
        ],
        "aliases": ", ".join(map(effect_title, stage.aliases)),
        "source": stage.source,
        "check": stage.check,
        "error": stage.error,
    }


def explanations(result: LoopResult) -> list[dict[str, Any]]:
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


def inclusion(result: LoopResult) -> str:
    """Return in words how probable each effect is to be in the explanation, and each kind."""
    told = result.explanations

    def listed(pairs) -> str:
        return ", ".join(f"{name} {percent(p)}" for name, p in pairs)

    kinds = {KINDS[kind]: p for kind, p in told.inclusion_by_kind.items()}
    effects = [(effect_title(name), p) for name, p in told.inclusion.items()][:_MOST_INCLUDED]
    if not effects:
        return ""
    return f"{listed(effects)} (any effect {listed(kinds.items())})."


_MOST_INCLUDED = 8


_MOST_TESTS = 8


def next_tests(result: LoopResult) -> list[dict[str, Any]]:
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


def declared_effects(result: LoopResult) -> list[dict[str, Any]]:
    """Return the parameters of the effects that the study declares."""
    return [
        {"effect": effect_title(one.effect), "name": name, **asdict(parameter)}
        for one in result.declared_effects
        for name, parameter in one.parameters.items()
    ]


def law(result: LoopResult) -> str:
    """Return the augmented law typeset; empty where it cannot be written out in one equation.

    What a state of the whole fluid does is typeset with the stage that added it.
    """
    try:
        equation = result.equation()
    except InputError:
        return ""
    if equation.states:
        return ""
    return law_element(equation.terms, equation.linear_relaxation, equation.named)


def fold_row(fold: Fold) -> dict[str, Any]:
    """Return what was found without a run."""
    return {
        "run": fold.run,
        "error_before": fold.error_before,
        "error_after": fold.error_after,
        "effects": ", ".join(map(effect_title, fold.effects)) or "none",
    }


def ranking_rows(ranking: Sequence[CandidateScore]) -> list[dict[str, Any]]:
    """Return the best candidates of a stage."""
    return [
        {
            "effect": effect_title(c.effect),
            "kind": KINDS[c.kind],
            "score": c.score,
            "evidence": c.evidence,
            "error": c.error,
        }
        for c in ranking[:MOST_RANKED]
    ]


_SHARES = ("error", "floor", "gain", "clock")
"""Last words of what is a share of the root-mean-square stress."""


_REMAINING = {
    "structured": "systematic residual",
    "error": "error on the fitted runs",
    "noise floor": "noise",
    "linear error": "error of the linear sweep",
    "autocorrelation": "lag-1 correlation of the noise",
    "outliers": "outliers (excluded)",
    "outlier times s": "their times in s",
    "probability": "p-value of the residual, if noise",
    "untested": "not tested for lack of",
    "without fluid": "no signal of the fluid",
    "worst run": "worst run",
    "worst run error": "its error",
    "bench / stress gain": "stress gain, fitted jointly",
    "bench / clock": "relaxation times, relative shift, fitted jointly",
    "bench / rate gain": "rate gain, fitted jointly",
    "bench / tool compliance": "tool compliance, fitted jointly, 1/Pa",
    "bench / time delay": "delay, fitted jointly, s",
    "loading deviation": "assumed scatter of loading, relative",
    "description": "summary",
}
"""What is said of the residual, for those who do not read the JSON."""


def remaining_rows(result: LoopResult) -> list[tuple[str, str]]:
    """Return what is said of the residual, as names and values."""
    # factors of loadings have a table of their own
    content = {key: value for key, value in result.remaining.items() if key != "loading"}
    said = {"none", "None", "", "{}"}  # a row that says nothing is none
    return [(_REMAINING.get(k, k), value) for k, value in _flatten(content) if value not in said]


def loadings(result: LoopResult) -> list[dict[str, Any]]:
    """Return the factors of loadings, run by run; none where runs are none of their own."""
    found = result.remaining.get("loading") or {}
    return [{"run": name, **one} for name, one in found.items()]


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
