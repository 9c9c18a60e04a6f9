"""Pictures of what a closed loop leaves: residuals, errors, and constants by mode."""

from collections.abc import Mapping

import numpy as np

from discover.answer.sentences import flows_of
from discover.loop import LoopResult
from discover.loop.by_quantity import FASTER
from discover.loop.parts import ConstantByMode
from discover.report.plots import style as look
from discover.report.plots.loop import runs
from discover.report.wording import percent
from discover.words import effect_title, listed, readable, significant


def residual_picture(result: LoopResult) -> look.Picture:
    """Return the residual against time and strain, before and after."""
    records = [record for record in result.records if record.is_transient]
    only_states = not records
    records = records or list(result.records)
    start_ups = only_states or all(map(runs.through_decades, records))
    labels = (
        (runs.along_in_common(records), runs.axis_label(records))
        if only_states
        else ("time (s)", "strain")
    )
    models = runs.models_of(records)
    with look.figure(len(models), 2, height=2.4) as (drawing, axes):
        for row, (stage, title) in enumerate(models):
            limit = 0.0
            for place, record in enumerate(records):
                relative = 100.0 * record.relative_residual[stage]
                style = {
                    "color": runs.HELD_COLOUR if record.held_out else runs.FIT_COLOUR,
                    "lw": 0.9,
                    "alpha": 0.8,
                    "label": "held out" if record.held_out else "fitted",
                }
                other = record.measured if only_states else record.strain
                along = (record.along[1], other)
                axes[row, 0].plot(along[0], relative, gid=f"run{place}-{row}0", **style)
                # a logarithmic axis has no place for strains against the positive direction
                along_1 = np.abs(along[1]) if start_ups else along[1]
                axes[row, 1].plot(along_1, relative, gid=f"run{place}-{row}1", **style)
                limit = max(limit, float(np.percentile(np.abs(relative), 98)))
            for panel, label in zip(axes[row], labels, strict=True):
                if start_ups:
                    look.make_logarithmic(panel.xaxis)
                panel.set_xlabel(label if row == len(models) - 1 else "")
                panel.axhline(0.0, color=look.INK, lw=0.6)
                panel.set_ylim(-1.1 * limit - 1e-9, 1.1 * limit + 1e-9)
            axes[row, 0].set_ylabel(f"residual (% of rms {runs.symbol_of(records)})")
            axes[row, 0].set_title(title, loc="left")
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            "residual",
            "Prediction minus measurement, over each run's root-mean-square stress, against "
            + ("what was varied and what was measured" if only_states else "time and strain")
            + "."
            + " Note the different scales above and below." * (len(models) > 1)
            + " It should look like noise around zero; anything else is a missing effect.",
            switched=tuple(record.name for record in records),
        )


def waterfall_picture(result: LoopResult) -> look.Picture:
    """Return the errors after each stage."""
    labels = ["starting model", *(f"+ {effect_title(stage.effect)}" for stage in result.stages)]
    pairs = [result.error_before, *(stage.error for stage in result.stages)]
    # from top to bottom and no wider than a phone shows with legible letters
    with look.figure(1, 1, width=5.2, height=1.1 + 0.42 * len(labels)) as (drawing, axes):
        panel = axes[0, 0]
        positions = np.arange(len(labels))
        held_out = [p.held_out for p in pairs if p.held_out is not None]
        judged = len(held_out) == len(pairs)
        series = [
            ("fitted runs", runs.FIT_COLOUR, [p.fit for p in pairs], -0.19 if judged else 0.0)
        ]
        if judged:
            series.append(("held-out runs", runs.HELD_COLOUR, held_out, 0.19))
        for label, colour, values, shift in series:
            heights = 100.0 * np.array(values, dtype=float)
            bars = panel.barh(positions + shift, heights, 0.36, color=colour, label=label)
            panel.bar_label(bars, [percent(h / 100.0) for h in heights], fontsize=8, padding=2)
            _draw_ranges(panel, result, held_out=label != "fitted runs", shift=shift)
        panel.axvline(100.0 * result.noise_floor, color=look.GREEN, lw=1.2, ls="--", label="noise")
        look.make_percentage(panel.xaxis)
        heights = [100.0 * value for _, _, values, _ in series for value in values]
        panel.set_xlim(0.4 * min(*heights, 100.0 * result.noise_floor or 1.0), 2.0 * max(heights))
        panel.set_yticks(positions, labels)
        panel.set_ylim(max(len(labels), 2) - 0.4, -0.6)  # a bar alone would fill the picture
        panel.set_xlabel("relative error (%)")
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            "waterfall",
            "Error after each effect added: root mean square of prediction minus measurement over "
            "the root-mean-square stress, noise included, mean over runs."
            + _only_held_out(result)
            + " Lines: from the best run to the worst." * (len(result.records) > 1),
        )


def _only_held_out(result: LoopResult) -> str:
    """Return which flows are in the mean of held-out runs alone, and whether faster runs are."""
    fitted = [record for record in result.records if not record.held_out]
    held = [record for record in result.records if record.held_out]
    known = {record.flow for record in fitted}
    others = [flows_of([one]) for one in dict.fromkeys(r.flow for r in held) if one not in known]
    fastest = max((record.fastest for record in fitted), default=0.0)
    faster = any(record.flow in known and record.fastest > FASTER * fastest for record in held)
    parts = [*["faster runs"] * faster, *others]
    return f" Held-out runs include {listed(parts)}." if parts else ""


def _draw_ranges(panel, result: LoopResult, held_out: bool, shift: float) -> None:
    """Draw the range over the runs behind each mean."""
    errors = [r.errors for r in result.records if r.held_out is held_out]
    if len(errors) < 2:
        return
    table = 100.0 * np.stack(errors)
    places = np.arange(table.shape[1]) + shift - 0.19  # next to the label of the bar
    panel.hlines(places, table.min(axis=0), table.max(axis=0), color=look.INK, lw=1.2)


# whether a constant is left open, colour and filling of its mark, and what that is called
_KINDS = (
    (False, look.NETWORK, look.NETWORK, "fitted"),
    (True, look.BEFORE, "none", "not determined by these data"),
)


def by_mode_picture(
    constants: Mapping[str, ConstantByMode], is_unexplained: bool
) -> look.Picture | None:
    """Return each constant by mode with its band; None where there is none.

    `constants`: by name of the parameter, the effect or the term. `is_unexplained`: whether a law
    with these constants leaves more than noise.
    """
    if not constants:
        return None
    panels = []
    for name, constant in constants.items():
        told = [(mode.relaxation_time_s, *mode.ci95) for mode in constant.modes if mode.ci95]
        bands = []
        if told:
            times, low, high = np.array(sorted(told)).T
            bands = [(times, low, high, {"color": look.SHADE, "label": "95 % interval"})]
        points = {"marker": "o", "ms": 5.0, "ls": "none"}
        curves = []
        for left_open, colour, fill, label in _KINDS:
            shown = [mode for mode in constant.modes if mode.left_open is left_open]
            times = [mode.relaxation_time_s for mode in shown]
            style = {**points, "color": colour, "mfc": fill, "label": label}
            curves.append((times, [mode.value for mode in shown], style))
        label = look.literal(readable(effect_title(name)))
        settings = {"xscale": "log", "xlabel": "relaxation time (s)", "ylabel": label}
        panels.append(look.Panel(curves, settings, bands))
    said = " ".join(
        f"{readable(effect_title(name))} is free in each mode (evidence over one constant: "
        f"{significant(one.evidence[-1], 2)}); its values stand with the modes."
        for name, one in constants.items()
    )
    nearest = " The law leaves more than noise: these values come nearest." * is_unexplained
    caption = f"{said}{nearest} Intervals take it that the law is the fluid's."
    return look.row_of_panels("by_mode", caption, panels, 9.0, 2.8)
