"""Pictures of the runs of a closed loop: data and predictions."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from discover.loop import LoopResult, RunRecord
from discover.protocols.kinematics import MODULI
from discover.report.plots import style as look
from discover.report.wording import free_form_sentence, percent, recorded_symbol
from discover.words import FIGURE_SYMBOLS, effects_title

Samples = slice | np.ndarray
"""Which samples of a run, as an index."""


FIT_COLOUR, HELD_COLOUR = look.NETWORK, look.SPARSE
"""Of runs fitted and held out."""


_LONGEST_NAME = 30  # of a run over its panel, in characters

THOUSANDS = 1e4
"""In Pa, from which digits would crowd an axis."""


def through_decades(record: RunRecord) -> bool:
    """Return whether a run goes through decades of time, as start-ups do."""
    at_rest = record.control == "stress"  # in creep the stress is constant, and not the rate
    return look.runs_through_decades(
        record.time, np.ones_like(record.time) if at_rest else record.rate
    )


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


def _what_is_drawn(records: Sequence[RunRecord]) -> str:
    found = {record.quantity for record in records}
    kinds = {quantity: FIGURE_SYMBOLS[quantity] for quantity in FIGURE_SYMBOLS if quantity in found}
    tension = kinds.pop("tensile_stress", "")
    told = [f"{' or '.join(kinds.values())} in shear"] * bool(kinds)
    told += [f"{tension} in extension"] * bool(tension)
    what = "Recorded is" if found & set(MODULI) else "Stress is"
    return f" {what} {', '.join(told)}." * (len(found) > 1)


def runs_picture(result: LoopResult) -> look.Picture:
    """Return every run: measured, the law as declared, and with effects; without a law measured."""
    records, predicted = result.records, " and predicted"
    if result.verdict == "no_signal":
        records, predicted = (
            [
                replace(r, predicted=r.predicted[:0], errors=r.errors[:0], band=None)
                for r in records
            ],
            "",
        )
    with drawn_runs(records) as drawing:
        return look.picture(
            drawing,
            "runs",
            f"Measured{predicted}, run by run."
            + _OF_BAND * any(r.band is not None for r in records)
            + " Runs in orange were held out of all fits." * any(r.held_out for r in records)
            + _what_is_drawn(records),
        )


_OF_BAND = " Shaded: where 95 % of repeated measurements should lie, noise included."

AS_DECLARED, WITH_EFFECTS = "starting model", "with effects"
"""The two models of a closed loop, as pictures name them."""

FITTED_LAW = "", "law"
"""Names of a law's prediction alone, whatever it started from."""


@contextmanager
def drawn_runs(
    records: Sequence[RunRecord], names: tuple[str, str] = (AS_DECLARED, WITH_EFFECTS)
) -> Iterator[Figure]:
    """Yield a figure with a panel for each run.

    `names`: of the first and the last prediction; without the first the last alone is drawn.
    """
    if not names[0]:
        records = [replace(r, predicted=r.predicted[-1:], errors=r.errors[-1:]) for r in records]
    with look.panels_of(len(records), width=10.0, height=2.2) as (drawing, axes, panels):
        for panel, record in zip(panels, records, strict=True):
            every = max(1, record.time.size // 60)
            draw_run(panel, record, record.along[1], slice(None, None, every), slice(None), names)
            low, high = float(np.min(record.measured)), float(np.max(record.measured))
            shown = np.clip(record.predicted, low - (high - low), high + 0.6 * (high - low))
            low, high = float(np.min(shown, initial=low)), float(np.max(shown, initial=high))
            margin = 0.05 * (high - low) or 1.0
            panel.set_ylim(low - margin, high + margin)
            if through_decades(record):
                look.make_logarithmic(panel.xaxis)
            if not record.is_transient:
                # from a little below the least that was seen
                seen = record.measured[record.measured > 0.0]
                panel.set_xscale("log")
                if seen.size == record.measured.size:
                    panel.set_yscale("log")
                    panel.set_ylim(0.5 * float(np.min(seen)), 3.0 * float(np.max(seen)))
            elif high > THOUSANDS:
                panel.yaxis.set_major_formatter(EngFormatter(sep=""))  # 200k
            panel.set_title(short_title(record), fontsize=8, linespacing=1.5)
        below = {panel for panel in axes[-1]}
        for panel, record in zip(panels, records, strict=True):
            if panel in below or not record.is_transient:
                panel.set_xlabel(record.along[0])
        look.label_rows(axes, [axis_label([record]) for record in records])
        look.legend_above(drawing, axes)
        yield drawing


def draw_run(
    panel, record: RunRecord, along: np.ndarray, marked: Samples, shown: Samples,
    names: tuple[str, str] = (AS_DECLARED, WITH_EFFECTS),
) -> None:  # fmt: skip
    """Draw the measured stress, the law as declared and with effects against what is given.

    `marked`, `shown`: which samples are marked as measured, and between which models are drawn.
    """
    colour = HELD_COLOUR if record.held_out else FIT_COLOUR
    if record.band is not None:
        label = "95 % prediction band"
        style = {"color": colour, "alpha": 0.18, "lw": 0, "label": label}
        look.shade_between(panel, along[shown], *record.band[:, shown], **style)
    style = {"ms": 2.5, "mfc": "none", "mew": 0.7, "color": look.TRUTH, "label": "measured"}
    panel.plot(along[marked], record.measured[marked], "o", **style)
    if names[0] and len(record.predicted):
        style = {"lw": 1.1, "color": look.BEFORE, "label": names[0]}
        panel.plot(along[shown], record.predicted[0][shown], "-.", **style)
    if len(record.predicted) > 1 or not names[0]:
        label = f"{names[1]}, {'held out' if record.held_out else 'fitted'}"
        panel.plot(along[shown], record.predicted[-1][shown], lw=1.5, color=colour, label=label)


def models_of(records: Sequence[RunRecord]) -> list[tuple[int, str]]:
    """Return the models that a picture shows, by their place among the stages."""
    augmented = [(-1, WITH_EFFECTS)] * any(len(r.predicted) > 1 for r in records)
    return [(0, AS_DECLARED), *augmented]


def short_title(record: RunRecord) -> str:
    """Return the name of a run, and below it its errors before and after."""
    name = look.literal(shortened(record.name))
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


_MOST_DRAWN = 4


def lissajous_picture(result: LoopResult) -> look.Picture | None:
    """Return σ12 against strain and against rate in the last cycle, or None without oscillation.

    The widest runs are shown, those held out before those fitted.
    """
    found = [
        (r, last) for r in result.records if (last := look.last_cycle(r.time, r.rate)) is not None
    ]
    found.sort(key=lambda pair: (not pair[0].held_out, -float(np.ptp(pair[0].strain))))
    shown = found[:_MOST_DRAWN]
    if not shown:
        return None
    with look.figure(2, len(shown), width=10.0, height=2.3) as (drawing, axes):
        for column, (record, last) in enumerate(shown):
            strain = look.about_middle(record.strain, last)
            for panel, along in ((axes[0, column], strain), (axes[1, column], record.rate)):
                if not np.all(last):
                    panel.plot(
                        along, record.measured, ".", ms=1.2, alpha=0.5, color=look.MEASURED,
                        label="measured, all cycles", zorder=1,
                    )  # fmt: skip
                draw_run(panel, record, along, last, last)
                low, high = float(record.measured.min()), float(record.measured.max())
                margin = 0.6 * (high - low) or 1.0
                panel.set_ylim(low - margin, high + margin)
            axes[0, column].set_title(short_title(record), fontsize=8, linespacing=1.5)
            axes[0, column].set_xlabel("strain γ")
            axes[1, column].set_xlabel("γ̇ (1/s)")
        axes[0, 0].set_ylabel("elastic: σ₁₂ (Pa)")
        axes[1, 0].set_ylabel("viscous: σ₁₂ (Pa)")
        look.legend_above(drawing, axes)
        left = (
            f" The {_MOST_DRAWN} widest of {len(found)} runs." if len(found) > _MOST_DRAWN else ""
        )
        return look.picture(
            drawing,
            "lissajous",
            "Elastic (above) and viscous (below) Lissajous curves: models in the last cycle, "
            f"measurements in all of them, faint. Over each the errors of the run.{left}",
        )


_AXES = {
    "recorded_stress": ("true stress (Pa)", "recorded less true stress (Pa)"),
    "drift": ("time on the instrument's clock (s)", "recorded less true stress (Pa)"),
    "rate": ("shear rate (1/s)", "recorded less true stress (Pa)"),
    "response": ("lag (s)", "response of the transducer (1/s)"),
    "network": ("strain", "relative change of the stress"),
    "slip": ("stress (Pa)", "rate taken by slip (1/s)"),
}


def free_form_picture(result: LoopResult) -> look.Picture | None:
    """Return each free function with its band; None where there is none."""
    panels = []
    for one in result.free_form:
        along, up = _AXES[one.slot]
        band = one.grid, one.low95, one.high95, {"color": look.SHADE, "label": "95 % band"}
        curve = one.grid, one.value, {"color": look.NETWORK, "lw": 1.5, "label": "free function"}
        zero = one.grid[[0, -1]], [0.0, 0.0], {"color": "0.6", "lw": 0.6}
        labels = {"xlabel": along, "ylabel": up}
        panels.append(look.Panel([curve, zero], labels, [band]))
    said = "; ".join(map(free_form_sentence, result.free_form))
    caption = f"Effect without a name: {said}. The bands assume that it depends on this alone."
    return look.row_of_panels("free_form", caption, panels, 9.0, 2.8) if panels else None


def next_test_picture(result: LoopResult) -> look.Picture | None:
    """Return the predictions of all explanations in the best test; None where none decides."""
    following = result.next_tests
    best = following.best
    if best is None:
        return None
    curves = []
    lines = zip(following.explanations, following.probabilities, best.curves, strict=True)
    for i, (effects, probability, curve) in enumerate(lines):
        style = look.RIVAL_STYLES[(i - 1) % len(look.RIVAL_STYLES)] if i else look.CHOSEN_STYLE
        label = f"{effects_title(effects)} ({percent(probability)})"
        curves.append((best.samples, curve, {**style, "lw": 1.4 if i else 2.0, "label": label}))
    unit = "" if best.quantity == "strain" else " (Pa)"
    settings = {
        "ylabel": FIGURE_SYMBOLS[best.quantity] + unit,
        "xlabel": "shear rate (1/s)" if best.is_flow_curve else "time (s)",
    }
    if best.is_flow_curve or best.quantity in MODULI:
        settings |= {"xscale": "log", "yscale": "log"}
    caption = (
        f"What to measure next: {best.title}. Curves: predictions of the explanations, all of "
        f"which fit these data. Assumed noise: {percent(following.noise)}."
    )
    return look.row_of_panels(
        "next_test", caption, [look.Panel(curves, settings)], 7.0, 3.2, columns=1
    )
