"""Pictures of the runs of a closed loop: data and predictions."""

from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import EngFormatter

from discover.loop import LoopResult, RunRecord
from discover.protocols.kinematics import MODULI
from discover.report.overlay import Overlay
from discover.report.plots.cycles import shade_between
from discover.report.plots.style import (
    BEFORE,
    NETWORK,
    OVERLAY_STYLES,
    SPARSE,
    TRUTH,
    Picture,
    label_rows,
    legend_above,
    literal,
    make_logarithmic,
    panels_of,
    picture,
    runs_through_decades,
)
from discover.report.wording import percent, recorded_symbol
from discover.words import FIGURE_SYMBOLS

Samples = slice | np.ndarray
"""Which samples of a run, as an index."""


FIT_COLOUR, HELD_COLOUR = NETWORK, SPARSE
"""Of runs fitted and held out."""


_LONGEST_NAME = 30  # of a run over its panel, in characters

THOUSANDS = 1e4
"""In Pa, from which digits would crowd an axis."""


def through_decades(record: RunRecord) -> bool:
    """Return whether a run goes through decades of time, as start-ups do."""
    at_rest = record.control == "stress"  # in creep the stress is constant, and not the rate
    return runs_through_decades(record.time, np.ones_like(record.time) if at_rest else record.rate)


def symbol_of(records: Sequence[RunRecord]) -> str:
    """Return the symbol of what was recorded."""
    return recorded_symbol(record.quantity for record in records)


def axis_label(records: Sequence[RunRecord]) -> str:
    """Return the symbol of what was recorded, with its unit."""
    symbol = symbol_of(records)
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
    with panels_of(len(records), width=10.0, height=2.2) as (drawing, axes, panels):
        for panel, record in zip(panels, records, strict=True):
            every = max(1, record.time.size // 60)
            draw_run(panel, record, record.along[1], slice(None, None, every), slice(None))
            draw_overlays(panel, record, overlays, record.along[1], slice(None))
            low, high = float(np.min(record.measured)), float(np.max(record.measured))
            shown = np.clip(record.predicted, low - (high - low), high + 0.6 * (high - low))
            low, high = min(low, float(shown.min())), max(high, float(shown.max()))
            margin = 0.05 * (high - low) or 1.0
            panel.set_ylim(low - margin, high + margin)
            if through_decades(record):
                make_logarithmic(panel.xaxis)
            if not record.is_transient:
                _as_flow_curve(panel, record)
            elif high > THOUSANDS:
                panel.yaxis.set_major_formatter(EngFormatter(sep=""))  # 200k
            panel.set_title(short_title(record), fontsize=8)
        below = {panel for panel in axes[-1]}
        for panel, record in zip(panels, records, strict=True):
            if panel in below or not record.is_transient:
                panel.set_xlabel(record.along[0])
        label_rows(axes, [axis_label([record]) for record in records])
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

    `panel`: axes of matplotlib. `along`: what the stress is drawn against, shape (n,). `marked`,
    `shown`: which samples are marked as measured, and between which the models are drawn.
    """
    if record.band is not None:
        low, high = record.band[:, shown]
        shade_between(
            panel, along[shown], low, high, alpha=0.18, lw=0,
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
    """Return the models that a picture shows, by their place among the stages."""
    augmented = [(-1, "augmented model")] * any(len(r.predicted) > 1 for r in records)
    return [(0, "declared model"), *augmented]


def short_title(record: RunRecord) -> str:
    """Return the name of a run, and below it its errors before and after."""
    name = literal(shortened(record.name))
    if record.flow != "shear" and record.flow not in name:
        name = f"{name}, {record.flow}"
    errors = record.errors[[0, -1]] if len(record.errors) > 1 else record.errors
    return f"{name}\n{' → '.join(map(percent, errors))}"


def shortened(name: str) -> str:
    """Return the name of a run as it fits over a panel: its beginning and its end."""
    for modulus in MODULI:
        name = name.replace(f".csv ({modulus})", f" {FIGURE_SYMBOLS[modulus]}")
    name = name.removesuffix(".csv")
    if len(name) <= _LONGEST_NAME:
        return name
    end = _LONGEST_NAME // 2
    return f"{name[: _LONGEST_NAME - end - 1]}…{name[-end:]}"
