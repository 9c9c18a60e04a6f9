"""Pictures of a closed loop: data and predictions, residuals, waterfall, ranking."""

from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import EngFormatter

from discover.closed_loop import LoopResult, RunRecord
from discover.closed_loop.results.reading import differences
from discover.protocols.kinematics import MODULI
from discover.report.overlay import Overlay
from discover.report.plots.style import (
    BEFORE,
    GREEN,
    INK,
    NETWORK,
    OVERLAY_STYLES,
    SPARSE,
    TRUTH,
    Picture,
    figure,
    legend_above,
    literal,
    make_logarithmic,
    make_percentage,
    picture,
    runs_through_decades,
)
from discover.report.wording import FIGURE_SYMBOLS, effect_title, percent, recorded_symbol

Samples = slice | np.ndarray
"""Which samples of a run, as an index."""

FIT_COLOUR, HELD_COLOUR = NETWORK, SPARSE
"""Of runs fitted and held out."""

THOUSANDS = 1e4
"""In Pa, from which digits would crowd an axis."""
_UNITS = {"the largest shear rate": "1/s", "the largest stress": "Pa", "the duration": "s"}


def _through_decades(record: RunRecord) -> bool:
    at_rest = record.control == "stress"  # in creep the stress is constant, and not the rate
    return runs_through_decades(record.time, np.ones(1) if at_rest else record.rate)


def _recorded(records: Sequence[RunRecord]) -> str:
    return recorded_symbol(record.quantity for record in records)


def _label(records: Sequence[RunRecord]) -> str:
    symbol = _recorded(records)
    return symbol if all(r.quantity == "strain" for r in records) else f"{symbol} (Pa)"


def along_in_common(records: Sequence[RunRecord]) -> str:
    """Return what records are drawn against, in words for the axis of all of them."""
    return " or ".join(dict.fromkeys(record.along[0] for record in records))


def _as_flow_curve(panel, record: RunRecord) -> None:
    """Draw states with logarithmic axes, from a little below the least that was seen."""
    seen = record.measured[record.measured > 0.0]
    panel.set_xscale("log")
    if seen.size == record.measured.size:
        panel.set_yscale("log")
        panel.set_ylim(0.5 * float(np.min(seen)), 3.0 * float(np.max(seen)))


def _what_is_drawn(records: Sequence[RunRecord]) -> str:
    found = {record.quantity for record in records}
    kinds = {quantity: FIGURE_SYMBOLS[quantity] for quantity in FIGURE_SYMBOLS if quantity in found}
    tension = kinds.pop("tensile_stress", "")
    told = [f"{' or '.join(kinds.values())} in shear"] * bool(kinds)
    told += [f"{tension} in extension"] * bool(tension)
    what = "Recorded is" if found & set(MODULI) else "Stress is"
    return f" {what} {', '.join(told)}." * (len(found) > 1)


def runs_picture(result: LoopResult, overlays: Sequence[Overlay] = ()) -> Picture:
    """Return every run: measured, declared model, augmented model, and overlays."""
    records = result.records
    columns = min(4, len(records))
    rows = -(-len(records) // columns)
    with figure(rows, columns, width=10.0, height=2.2) as (drawing, axes):
        for panel in axes.ravel()[len(records) :]:
            panel.set_visible(False)
        for panel, record in zip(axes.ravel(), records, strict=False):
            every = max(1, record.time.size // 60)
            draw_run(panel, record, record.along[1], slice(None, None, every), slice(None))
            draw_overlays(panel, record, overlays, record.along[1], slice(None))
            low, high = float(np.min(record.measured)), float(np.max(record.measured))
            shown = np.clip(record.predicted, low - (high - low), high + 0.6 * (high - low))
            low, high = min(low, float(shown.min())), max(high, float(shown.max()))
            margin = 0.05 * (high - low) or 1.0
            panel.set_ylim(low - margin, high + margin)
            if _through_decades(record):
                make_logarithmic(panel.xaxis)
            if not record.is_transient:
                _as_flow_curve(panel, record)
            elif high > THOUSANDS:
                panel.yaxis.set_major_formatter(EngFormatter(sep=""))  # 200k
            panel.set_title(short_title(record), fontsize=8)
        below = {panel for panel in axes[-1]}
        for panel, record in zip(axes.ravel(), records, strict=False):
            if panel in below or not record.is_transient:
                panel.set_xlabel(record.along[0])
        for place, (panel, record) in enumerate(zip(axes.ravel(), records, strict=False)):
            # once a row, unless something else is recorded
            if place % columns == 0 or record.quantity != records[place - 1].quantity:
                panel.set_ylabel(_label([record]))
        legend_above(drawing, axes)
        return picture(
            drawing,
            "runs",
            "Every run in the window of the loop."
            + " Runs in orange were held out: no fit saw them." * any(r.held_out for r in records)
            + _what_is_drawn(records)
            + " Overlaid laws are the study's, fitted to nothing and without effects of the "
            "instrument." * bool(overlays),
        )


def draw_run(panel, record: RunRecord, along: np.ndarray, marked: Samples, shown: Samples) -> None:
    """Draw the measured stress, the declared and the augmented model of one run.

    Parameters
    ----------
    panel
        Axes of matplotlib.
    record
        The run.
    along
        What the stress is drawn against, shape (n,).
    marked, shown
        Which samples are marked as measured, and between which the models are drawn.
    """
    if record.band is not None and record.is_transient:
        low, high = record.band[:, shown]
        panel.fill_between(
            along[shown], low, high, alpha=0.18, lw=0,
            color=HELD_COLOUR if record.held_out else FIT_COLOUR,
            label="95 % of measurements, all explanations",
        )  # fmt: skip
    panel.plot(
        along[marked], record.measured[marked], "o", ms=2.5, mfc="none", mew=0.7, color=TRUTH,
        label="measured",
    )  # fmt: skip
    panel.plot(
        along[shown], record.predicted[0][shown], "-.", lw=1.1, color=BEFORE,
        label="declared model",
    )  # fmt: skip
    if len(record.predicted) == 1:  # nothing was added
        return
    panel.plot(
        along[shown], record.predicted[-1][shown], lw=1.5,
        color=HELD_COLOUR if record.held_out else FIT_COLOUR,
        label="augmented, held out" if record.held_out else "augmented, fitted",
    )  # fmt: skip


def draw_overlays(
    panel, record: RunRecord, overlays: Sequence[Overlay], along: np.ndarray, shown: Samples
) -> None:
    """Draw the curves that the study asks for in one run; arguments as in `draw_run`."""
    for overlay, style in zip(overlays, OVERLAY_STYLES, strict=False):
        curve = overlay.of(record.name, record.quantity)
        if curve is not None:
            panel.plot(along[shown], curve[shown], label=literal(overlay.label), **style)


def models_of(records: Sequence[RunRecord]) -> list[tuple[int, str]]:
    """Return the models that a picture shows, by their place among the stages.

    Parameters
    ----------
    records
        Of one loop. Where nothing was added there is the declared model alone.
    """
    augmented = [(-1, "augmented model")] * any(len(r.predicted) > 1 for r in records)
    return [(0, "declared model"), *augmented]


def short_title(record: RunRecord) -> str:
    """Return the name of a run, and below it its errors before and after."""
    name = literal(shortened(record.name))
    if record.flow != "shear" and record.flow not in name:
        name = f"{name}, {record.flow}"
    errors = record.errors[[0, -1]] if len(record.errors) > 1 else record.errors
    return f"{name}\n{' → '.join(map(percent, errors))}"


def shortened(name: str, longest: int = 30) -> str:
    """Return the name of a run as it fits over a panel: its beginning and its end.

    Parameters
    ----------
    name
        Of the run, which may be a file's.
    longest
        Most characters.
    """
    for modulus in MODULI:
        name = name.replace(f".csv ({modulus})", f" {FIGURE_SYMBOLS[modulus]}")
    name = name.removesuffix(".csv")
    if len(name) <= longest:
        return name
    end = longest // 2
    return f"{name[: longest - end - 1]}…{name[-end:]}"


def residual_picture(result: LoopResult) -> Picture:
    """Return the residual against time and strain, before and after."""
    records = [record for record in result.records if record.is_transient]
    only_states = not records
    records = records or list(result.records)
    start_ups = only_states or all(map(_through_decades, records))
    labels = (along_in_common(records), _label(records)) if only_states else ("time (s)", "strain")
    models = models_of(records)
    with figure(len(models), 2, height=2.4) as (drawing, axes):
        for row, (stage, title) in enumerate(models):
            limit = 0.0
            for place, record in enumerate(records):
                relative = 100.0 * record.relative_residual[stage]
                style = {
                    "color": HELD_COLOUR if record.held_out else FIT_COLOUR,
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
                    make_logarithmic(panel.xaxis)
                panel.set_xlabel(label if row == len(models) - 1 else "")
                panel.axhline(0.0, color=INK, lw=0.6)
                panel.set_ylim(-1.1 * limit - 1e-9, 1.1 * limit + 1e-9)
            axes[row, 0].set_ylabel(f"residual (% of rms {_recorded(records)})")
            axes[row, 0].set_title(title, loc="left")
        legend_above(drawing, axes)
        return picture(
            drawing,
            "residual",
            "Prediction minus measurement, over each run's root-mean-square stress, against "
            + ("what was varied and what was measured" if only_states else "time and strain")
            + "."
            + " Note the different scales above and below." * (len(models) > 1)
            + " What is left should look like noise around zero; anything else is an effect still "
            "missing.",
            switched=tuple(record.name for record in records),
        )


def reading_picture(result: LoopResult) -> Picture | None:
    """Return on what the residual depends, before and after."""
    readings = [(result.readings[0], "declared", BEFORE)]
    if result.stages:
        readings.append((result.readings[1], "augmented", FIT_COLOUR))
    if not readings[0][0].collapses:
        return None
    waves = any(reading.waves for reading, _, _ in readings)
    with figure(1, 3 if waves else 2, width=10.0, height=2.8) as (drawing, axes):
        names = [c.coordinate for c in readings[0][0].collapses]
        for shift, (reading, label, colour) in zip((-0.2, 0.2), readings, strict=False):
            shares = {c.coordinate: 100.0 * c.share for c in reading.collapses}
            places = np.arange(len(names)) + shift
            axes[0, 0].barh(
                places, [shares.get(n, 0.0) for n in names], 0.36, color=colour, label=label
            )
        axes[0, 0].set_yticks(range(len(names)), [f"along {name}" for name in names])
        axes[0, 0].set_xlim(0.0, 100.0)
        axes[0, 0].set_xlabel("squared residual in common (%)")
        _draw_run_by_run(axes[0, 1], result)
        if waves:
            _draw_waves(axes[0, 2], readings)
        legend_above(drawing, axes)
        caption = (
            "Left: how much of the squared residual the runs share when drawn against each "
            "coordinate, judged run by run from the others. Right of it: the error of each run."
        )
        if waves:
            caption += (
                " Far right: parts of the residual of each oscillating run: fundamental in phase "
                "with the strain and with the rate, higher harmonics, drift."
            )
        return picture(drawing, "reading", caption)


def _draw_run_by_run(panel, result: LoopResult) -> None:
    """Draw the error of each run against what its residual follows, or the largest shear rate."""
    varied = differences(result.records)
    followed = [trend.quantity for trend in result.readings[1].trends]
    name = next(iter([*followed, *varied]), None)
    if name is None:
        panel.set_visible(False)
        return
    values = varied[name]
    for (model, label), colour in zip(
        models_of(result.records), (BEFORE, FIT_COLOUR), strict=False
    ):
        label = label.removesuffix(" model")
        errors = [100.0 * float(record.errors[model]) for record in result.records]
        panel.plot(values, errors, "o", ms=4.0, color=colour, label=label)
    if np.min(values) > 0 and np.max(values) > 10.0 * np.min(values):
        panel.set_xscale("log")
    make_percentage(panel.yaxis)
    unit = f" ({_UNITS[name]})" if name in _UNITS else ""
    panel.set_xlabel(literal(name.replace("_", " ")) + unit)
    panel.set_ylabel("relative error (%)")


def _draw_waves(panel, readings) -> None:
    parts = ("elastic", "viscous", "odd", "even", "drift")
    for shift, (reading, label, colour) in zip((-0.15, 0.15), readings, strict=False):
        for place, part in enumerate(parts):
            sizes = [100.0 * abs(getattr(wave, part)) for wave in reading.waves]
            panel.plot([place + shift] * len(sizes), sizes, "o", ms=4.0, color=colour, label=label)
    panel.set_xticks(range(len(parts)), parts, rotation=30)
    panel.set_ylabel("residual (% of fundamental)")


def waterfall_picture(result: LoopResult) -> Picture:
    """Return the errors after each stage."""
    labels = ["declared", *(f"+ {effect_title(stage.effect)}" for stage in result.stages)]
    pairs = [result.error_before, *(stage.error for stage in result.stages)]
    with figure(1, 1, width=8.0, height=2.8) as (drawing, axes):
        panel = axes[0, 0]
        positions = np.arange(len(labels))
        held_out = [p.held_out for p in pairs if p.held_out is not None]
        judged = len(held_out) == len(pairs)
        series = [("fitted runs", FIT_COLOUR, [p.fit for p in pairs], -0.19 if judged else 0.0)]
        if judged:
            series.append(("held-out runs", HELD_COLOUR, held_out, 0.19))
        for label, colour, values, shift in series:
            heights = 100.0 * np.array(values, dtype=float)
            bars = panel.bar(positions + shift, heights, 0.36, color=colour, label=label)
            panel.bar_label(bars, [percent(h / 100.0) for h in heights], fontsize=8, padding=2)
            _draw_ranges(panel, result, held_out=label != "fitted runs", shift=shift)
        panel.axhline(100.0 * result.noise_floor, color=GREEN, lw=1.2, ls="--", label="noise")
        make_percentage(panel.yaxis)
        heights = [100.0 * value for _, _, values, _ in series for value in values]
        panel.set_ylim(0.4 * min(*heights, 100.0 * result.noise_floor or 1.0), 2.0 * max(heights))
        panel.set_xticks(positions, labels)
        panel.set_xlim(-0.6, max(len(labels), 2) - 0.4)  # a bar alone would fill the picture
        if len(labels) > 4:  # long names side by side would run into one another
            panel.tick_params(axis="x", labelsize=8, labelrotation=15)
        panel.set_ylabel("relative error (%)")
        legend_above(drawing, axes)
        return picture(
            drawing,
            "waterfall",
            "Error after each effect added: root mean square of prediction minus measurement over "
            "the root-mean-square stress, mean over runs."
            + " Lines: from the best run to the worst."
            * (len(result.records) > 1),
        )


def _draw_ranges(panel, result: LoopResult, held_out: bool, shift: float) -> None:
    """Draw the range over the runs behind each mean."""
    errors = [r.errors for r in result.records if r.held_out is held_out]
    if len(errors) < 2:
        return
    table = 100.0 * np.stack(errors)
    places = np.arange(table.shape[1]) + shift - 0.16  # beside the label of the bar
    panel.vlines(places, table.min(axis=0), table.max(axis=0), color=INK, lw=1.2)


def ranking_picture(result: LoopResult, shown: int = 12) -> Picture | None:
    """Return what each candidate would remove of the residual, stage by stage."""
    rankings = [ranking for ranking in result.rankings if ranking]
    if not rankings:
        return None
    columns = min(3, len(rankings))
    rows = -(-len(rankings) // columns)
    with figure(rows, columns, width=10.0, height=3.0) as (drawing, axes):
        for panel in axes.ravel()[len(rankings) :]:
            panel.set_visible(False)
        for number, (panel, ranking) in enumerate(zip(axes.ravel(), rankings, strict=False)):
            best = ranking[:shown][::-1]
            chosen = result.stages[number].effect if number < len(result.stages) else None
            panel.barh(
                [effect_title(c.effect) for c in best],
                [100.0 * max(c.reduction, 0.0) for c in best],
                color=[GREEN if c.effect == chosen else BEFORE for c in best],
            )
            panel.set_xlim(0, 100)
            kept = any(c.effect == chosen for c in best)
            said = "" if kept else ": taken later" if chosen else ": none added"
            panel.set_title(f"stage {number + 1}{said}")
            panel.set_xlabel("squared residual removed (%)")
            panel.tick_params(axis="y", labelsize=7.5)
        return picture(
            drawing,
            "ranking",
            "What each candidate, tried alone, would remove of the squared residual of the fitted "
            "runs; in green the one that was added. It is chosen by evidence and by runs left out, "
            "so it need not be the longest bar; at the end the effects are examined again, and "
            "another may take the place of one.",
        )


def run_error_picture(result: LoopResult) -> Picture:
    """Return the error of every run before and after, or of the declared model alone."""
    records = result.records
    model = "augmented" if any(len(r.errors) > 1 for r in records) else "declared"
    with figure(1, 1, width=8.0, height=0.8 + 0.22 * len(records)) as (drawing, axes):
        panel = axes[0, 0]
        for position, record in enumerate(records[::-1]):
            before, after = 100.0 * record.errors[0], 100.0 * record.errors[-1]
            colour = HELD_COLOUR if record.held_out else FIT_COLOUR
            panel.plot([before, after], [position] * 2, color=colour, lw=1.0)
            if model == "augmented":
                panel.plot(before, position, "o", mfc="none", color=BEFORE, label="declared")
            label = f"{model}, {'held out' if record.held_out else 'fitted'}"
            panel.plot(after, position, "o", color=colour, label=label)
        panel.set_yticks(range(len(records)), [literal(shortened(r.name)) for r in records[::-1]])
        panel.set_ylim(-0.6, len(records) - 0.4)
        make_percentage(panel.xaxis)
        panel.set_xlabel("relative error (%)")
        legend_above(drawing, axes)
        told = "before and after" if model == "augmented" else "of the declared model"
        return picture(drawing, "run_errors", f"Residual by run: error {told}.")
