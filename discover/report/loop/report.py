"""The report on a closed loop: page, figures, JSON and LaTeX."""

from pathlib import Path

from discover.loop.loop_result import LoopResult
from discover.plain_numbers import json_text
from discover.protocols.kinematics import in_words
from discover.report.loop import tables
from discover.report.loop.tables import loop_verdict
from discover.report.page import answer_screen, made_by, render, safe_name
from discover.report.plots.loop.residual import (
    by_mode_picture,
    residual_picture,
    waterfall_picture,
)
from discover.report.plots.loop.runs import (
    AS_DECLARED,
    WITH_EFFECTS,
    free_form_picture,
    lissajous_picture,
    next_test_picture,
    runs_picture,
)
from discover.report.predictions import PREDICTIONS, loop_predictions, write_predictions
from discover.report.wording import SMALL_FAULTS
from discover.study.run_folder import RunFolder
from discover.words import FIGURE_SYMBOLS


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

    `name`, `summary`: title, and the data and declared model in words. `study_text`: the study
    file, shown at the end. `run`: what the page says of the run that made it, where that was no
    command. `conditions`: material and temperature, for the title.

    Returns the page.
    """
    pictures = [
        waterfall_picture(result),
        runs_picture(result),
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
        error_rows=tables.error_rows(result),
        recorded=in_words(record.quantity for record in result.records),
        noise_range=tables.noise_range(result),
        inclusion=tables.inclusion(result),
        kinds=tables.KINDS,
        symbols=FIGURE_SYMBOLS,
        remaining=tables.remaining_rows(result),
        small_faults=SMALL_FAULTS,
        readings=[
            (f"{name[:1].upper()}{name[1:]}", reading.sentences)
            for name, reading in zip((AS_DECLARED, WITH_EFFECTS), result.readings, strict=True)
            if name == AS_DECLARED or result.stages
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
