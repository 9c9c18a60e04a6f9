"""The report on a closed loop: page, tables, figures, JSON and LaTeX."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from discover.answer.modes_in_words import reduced_to
from discover.laws.registry import LAWS
from discover.loop.loop_result import LoopResult
from discover.loop.parts import LawFit
from discover.loop.sentences import EXPLAINED, MOST_NAMES, doubted, several, untested_by
from discover.plain_numbers import json_text
from discover.protocols.kinematics import ONLY_STATES
from discover.report.first_screen import answer_screen
from discover.report.page import made_by, render, safe_name
from discover.report.plots.loop.residual import (
    by_mode_picture,
    residual_picture,
    waterfall_picture,
)
from discover.report.plots.loop.runs import (
    free_form_picture,
    lissajous_picture,
    next_test_picture,
    runs_picture,
)
from discover.report.predictions import PREDICTIONS, loop_predictions, write_predictions
from discover.report.wording import SMALL_FAULTS, free_form_sentence, percent, sentence
from discover.statistics.noise_model import rms
from discover.statistics.whiteness import sample_to_sample_noise
from discover.study.run_folder import RunFolder
from discover.words import effect_title, listed, significant


def write_loop(
    result: LoopResult,
    folder: RunFolder,
    name: str,
    summary: str,
    study_text: str = "",
    run: dict | None = None,
    conditions: str = "",
) -> Path:
    """Write ``report.html``, ``loop.json``, ``equations.tex``, ``predictions.csv`` and the figures.

    Returns the page. `summary`: the data and declared model in words. `run`: what the page says of
    the run that made it, where that was no command. `conditions`: material and temperature.
    """
    pictures = [runs_picture(result)]
    if result.verdict != "no_signal":
        pictures = [
            waterfall_picture(result),
            *pictures,
            lissajous_picture(result),
            free_form_picture(result),
            residual_picture(result),
            by_mode_picture(result.by_mode, result.verdict == "unexplained"),
            next_test_picture(result),
        ]
    drawn = [p for p in pictures if p is not None]
    for one in drawn:
        folder.write(f"figures/{safe_name(one.name)}.svg", one.svg)
    content = json_text(result.to_json())
    folder.write("loop.json", content)
    folder.write("equations.tex", loop_tex(result))
    predictions = write_predictions(loop_predictions(result), folder)
    page = render(
        "loop.html",
        data={PREDICTIONS: predictions, "loop.json": content},
        name=name,
        conditions=conditions,
        summary=summary,
        result=result,
        screen=answer_screen(result.answer),
        sentences=loop_verdict(result),
        error_rows=error_rows(result),
        noise_range=noise_range(result),
        inclusion=inclusion(result),
        kinds=KINDS,
        remaining=remaining_rows(result),
        small_faults=SMALL_FAULTS,
        reference=reduced_to(result.temperature_C)
        * any(one.shift != 1.0 for one in result.records),
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


KINDS = {"constitutive": "in the fluid", "kinematic": "in the flow", "signal": "in the instrument"}

_LOOP = {
    "effects_added": "Your model is missing an effect; with it the data are fitted to the noise",
    "no_effect_needed": "Your model fits the data to the noise; nothing is missing",
    "unexplained": "A systematic residual remains that no candidate explains",
    "no_signal": "No signal: the data hold no more than noise",
}

_OPEN = "Your model is missing an effect, but the data do not identify it"

_UNTESTED = {
    "effects_added": "Fitted, not tested: with the added effects your model describes",
    "no_effect_needed": "Fitted, not tested: with its constants fitted your model describes",
}

_ALIKE = 0.05  # Probability of a law from which on these runs do not exclude it
_MEASURED = {"flows": "what was measured", "states": "the states that were measured"}

_SLOW = 0.5  # Correlation from which noise and a slow effect look alike for some samples on end


def loop_verdict(result: LoopResult) -> list[str]:
    """Return the verdict on a closed loop: what was found, then how sure that is."""
    return [what_was_found(result), how_sure(result)]


def what_was_found(result: LoopResult) -> str:
    """Return how the declared model stands; effects and constants have a section of their own."""
    names = several([effect_title(stage.effect) for stage in result.stages])
    if result.verdict == "no_signal":
        why = (
            f"{names} alone would explain them, without any fluid"
            if names
            else "the stress does not follow what was imposed"
        )
        return f"{_LOOP['no_signal']}: {why}."
    parts = []
    if result.laws:
        parts.append(_law_chosen(result.laws))
    stands = _LOOP[result.verdict] if doubted(result) is None else _OPEN
    if result.verdict == "unexplained" and result.free_form:
        stands = free_form_sentence(result.free_form[0])
    if untested := untested_by(result):
        stands = f"{_UNTESTED[result.verdict]} {_MEASURED[untested]}"
    return sentence([stands, *parts])


def _law_chosen(laws: Sequence[LawFit]) -> str:
    """Return which law was taken of several, and from which these runs do not tell it."""
    best, *others = laws
    alike = [LAWS[one.law].title for one in others if (one.probability or 0.0) > _ALIKE]
    told = f"; these runs do not exclude {several(alike)}" if alike else ""
    ends = f" ({several(best.at_end)} at an end of its range)" if best.at_end else ""
    return f"of {len(laws)} laws {best.title}{ends} was taken{told}"


def how_sure(result: LoopResult) -> str:
    """Return what these data do not decide, and what did not count."""
    sentences = []
    if result.held_in_band is not None:
        share = percent(result.held_in_band)
        sentences.append(f"{share} of the held-out samples lie inside the 95 % band.")
    if untested_by(result) == "states":
        sentences.append(ONLY_STATES)
    if (deviation := result.remaining.get("loading_deviation")) and result.verdict in EXPLAINED:
        sentences.append(
            f"Each run has a loading factor, fitted jointly ({percent(deviation)} scatter); "
            "that of a held-out run is unknown."
        )
    if steps := result.remaining.get("step_instants"):
        runs = listed([*steps]) if len(steps) <= MOST_NAMES else f"{len(steps)} runs"
        sentences.append(
            f"The rate of {runs} steps between two samples: the instants are fitted jointly, "
            "those of a held-out run to that run."
        )
    if count := result.remaining.get("outliers", 0):
        sentences.append(f"{count} {'outliers were' if count > 1 else 'outlier was'} excluded.")
    return " ".join([*sentences, *(sentence([doubt]) for doubt in _what_tests_it(result))])


def _what_tests_it(result: LoopResult) -> Iterator[str]:
    """Tell what no run tests, and how probable it is that something else is right."""
    together = result.remaining.get("autocorrelation") or 0.0
    if result.verdict in EXPLAINED and together > _SLOW:
        yield (
            f"the residual is smooth (lag-1 correlation {together:.2g}); it is taken for noise, "
            "but a slowly varying effect would look the same"
        )
    untested = untested_by(result)
    if untested == "flows":
        yield ("no run was held out, and there are as few flows as fitted constants")
    elif result.error_before.held_out is None:
        yield "no run was held out"
    if doubted(result) is not None:
        none = percent(result.explanations.unexplained_probability)
        yield f"probability that no candidate is right: {none}"


def error_rows(result: LoopResult) -> list[dict[str, Any]]:
    """Return the mean error of each model and the range over the runs behind it."""

    def errors(held_out: bool, model: int) -> list[float]:
        return [float(r.errors[model]) for r in result.records if r.held_out is held_out]

    names = ["starting model", *(f"+ {effect_title(stage.effect)}" for stage in result.stages)]
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


def noise_range(result: LoopResult) -> list[float] | None:
    """Return the noise of each fitted run; None where it was given or comes from another residual.

    The noise of a loop is a mean over the fitted runs, either of their residuals as they are or of
    the part of them that changes from sample to sample.
    """
    residuals = [r.relative_residual[-1] for r in result.records if not r.held_out]
    for of_run in (rms, sample_to_sample_noise):
        noise = [of_run(values) for values in residuals]
        if noise and np.isclose(np.mean(noise), result.noise_floor, rtol=1e-3):
            return noise
    return None


def inclusion(result: LoopResult) -> str:
    """Return in words how probable each effect is to be in the explanation, and each kind."""
    told = result.explanations

    def listed(pairs) -> str:
        return ", ".join(f"{name} {percent(p)}" for name, p in pairs)

    kinds = {KINDS[kind]: p for kind, p in told.inclusion_by_kind.items()}
    likely = [(name, p) for name, p in told.inclusion.items() if p >= _LEAST_INCLUDED]
    effects = [(effect_title(name), p) for name, p in likely][:_MOST_INCLUDED]
    if not effects:
        return ""
    return f"{listed(effects)} (any effect {listed(kinds.items())})."


_MOST_INCLUDED, _LEAST_INCLUDED = 8, 0.005


# Last words of what is a share of the root-mean-square stress
_SHARES = ("error", "floor", "gain", "clock")


# What is said of the residual, for those who do not read the JSON
_REMAINING = {
    "structured": "systematic residual",
    "error": "error on the fitted runs",
    "noise floor": "noise",
    "linear error": "error of the linear sweep",
    "autocorrelation": "lag-1 correlation of the noise",
    "outliers": "outliers (excluded)",
    "outlier times s": "their times in s",
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


def remaining_rows(result: LoopResult) -> list[tuple[str, str]]:
    """Return what is said of the residual, as names and values."""
    # factors of loadings have a table of their own
    content = {
        key: value
        for key, value in result.remaining.items()
        if key != "loading" and (value or key not in ("outliers", "without_fluid"))
    }
    said = {"none", "None", "", "{}"}  # a row that says nothing is none
    return [(_REMAINING.get(k, k), value) for k, value in _flatten(content) if value not in said]


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
