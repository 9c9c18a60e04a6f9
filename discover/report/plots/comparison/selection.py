"""The way from the empty to the dense law, and errors over Wi and De."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES
from discover.learners.registry import learner_title
from discover.report.plots import style as look
from discover.report.plots.comparison.flows import curves, units
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS, readable

_MOST_BARS = 8


def selection_picture(details: Mapping[str, Any]) -> look.Picture | None:
    """Return the selection path: misfits, evidence, and how probable each term is.

    `details`: of the sparse learner's result: ``path``, ``inclusion``.
    """
    path = details.get("path") or []
    if len(path) < 2:
        return None
    sizes = [row["size"] for row in path]
    probable = list((details.get("inclusion") or {}).items())[:_MOST_BARS]
    with look.figure(1, 3 if probable else 2, width=10.0, height=3.0) as (drawing, axes):
        left, middle = axes[0, 0], axes[0, 1]
        left.semilogy(
            sizes,
            [_percentage(row["misfit"]) for row in path],
            color=look.TRUTH,
            marker=".",
            label="runs fitted",
        )
        if any(row["held_out"] is not None for row in path):
            left.semilogy(
                sizes,
                [_percentage(row["held_out"]) for row in path],
                color=look.PURPLE,
                marker=".",
                linestyle="--",
                label="runs left out",
            )
        left.set_ylabel("misfit (%)")
        look.make_percentage(left.yaxis)
        evidence = np.array([row["log_evidence"] for row in path])
        middle.plot(sizes, np.max(evidence) - evidence, color=look.BEFORE, marker=".")
        middle.set_yscale("symlog", linthresh=5.0)
        middle.set_ylabel("log odds behind the likeliest")
        likeliest = int(np.argmax(evidence))
        left.plot(
            sizes[likeliest], _percentage(path[likeliest]["misfit"]), marker="o", markersize=13,
            fillstyle="none", linestyle="none", color=look.SPARSE, label="likeliest",
        )  # fmt: skip
        for panel in (left, middle):
            panel.set_xlabel("number of terms")
            panel.set_xticks(sizes)
        if probable:
            bars, rows = axes[0, 2], probable[::-1]
            bars.barh([readable(name) for name, _ in rows], [100.0 * p for _, p in rows],
                      height=0.5, color=look.GREEN)  # fmt: skip
            bars.set_xlim(0.0, 100.0)
            bars.set_xlabel("probability of the term (%)")
        look.legend_above(drawing, axes, columns=4)
        return look.picture(
            drawing,
            "selection",
            "The best law of each size: its misfit, and its log odds behind the likeliest (linear "
            "below 5). A gap: a law that diverges in a run left out. Right: the probability that "
            "the law has each term, were it among those that were fitted.",
        )


def _percentage(share: float | None) -> float:
    """Return a share in per cent for a logarithmic axis; NaN, a gap, where there is none."""
    return np.nan if share is None else 100.0 * max(share, 1e-9)


def third_harmonic(stress: np.ndarray) -> float:
    """Return I₃/I₁ of one cycle, sampled evenly with the end equal to the beginning.

    Zero for an ellipse.
    """
    spectrum = np.abs(np.fft.rfft(stress[:-1]))
    return float(spectrum[3] / spectrum[1]) if spectrum[1] > 0 else 0.0


def high_deborah_picture(comparison: Comparison) -> look.Picture | None:
    """Return Lissajous curves that become elliptical as De grows."""
    stress_unit, _, rate_label = units(comparison)
    panels = []
    for flow in comparison.flows_of("high_deborah"):
        # the first sample is rest at t = 0, the others one late cycle
        drawn = [
            (flow.rate[1:], stresses["sigma12"][1:], {**style, "label": label})
            for label, style, stresses in curves(comparison, flow)
            if "sigma12" in stresses
        ]
        harmonic = third_harmonic(flow.reference["sigma12"][1:])
        deborah = float(np.max(np.asarray(flow.protocol.frequencies)))
        settings = {
            "title": f"De = {deborah:g}, I₃/I₁ = {100 * harmonic:.2g} %",
            "xlabel": f"shear rate {rate_label}",
            "ylabel": "" if panels else "σ₁₂" + stress_unit,
        }
        panels.append(look.Panel(drawn, settings))
    caption = (
        "γ̇ = 3 cos(De t), one cycle after the transient. As De grows the stress has no time to "
        "change the structure within a cycle, and the strain, 3/De, falls: the curve becomes an "
        "ellipse (quasi-linear LAOS) although the rate is large. A law that names the rate, such "
        "as Johnson–Segalman's, would bend it at any De if the strain were above one. I₃/I₁ is "
        "the third harmonic of the truth over the first."
    )
    return look.row_of_panels("high_deborah", caption, panels, 9.0, 2.8) if panels else None


_STRONGEST = 0.55  # more would drown the number in the cell
_TOLD = 10.0  # a larger relative error is no more than that in a cell
_LOWEST, _HIGHEST = 1e-4, 1.0  # Relative errors at which the colour of a cell begins and ends

Cells = Mapping[tuple[float, float], float | None]


def error_map_picture(comparison: Comparison) -> look.Picture | None:
    """Return the error of the known part and of each learner over Wi and De."""
    if not comparison.flows_of("pipkin"):
        return None
    rows = {"before": "before", **{n: learner_title(n) for n in comparison.outcomes}}
    with look.figure(len(rows), 3, width=10.0, height=2.5) as (drawing, axes):
        for row, (who, title) in zip(axes, rows.items(), strict=True):
            table = comparison.error_map(who)
            for panel, quantity in zip(row, QUANTITIES, strict=True):
                cells = {place: errors[quantity] for place, errors in table.items()}
                _draw_cells(panel, cells, look.NETWORK)
                panel.set_title(f"{FIGURE_SYMBOLS[quantity]}, {title}")
                _mark_training(panel, comparison, cells)
        _label(axes)
        look.legend_above(drawing, axes)
        return look.picture(
            drawing,
            "pipkin_error",
            "Pipkin map of error: relative L2 error in one late cycle of γ̇ = Wi cos(De t), N₂'s "
            "relative to N₁; a dash where the law diverges. Open circles: flows whose σ₁₂ the "
            "learners saw. Away from them a law is an extrapolation.",
        )


def _draw_cells(panel, cells: Cells, colour: str) -> None:
    """Draw one number a cell, the deeper the larger on a logarithmic scale."""
    weissenberg, deborah = _axes_of(cells)
    span = np.log(_HIGHEST / _LOWEST)
    for (wi, de), value in cells.items():
        x, y = deborah.index(de), weissenberg.index(wi)
        share = 0.0 if value is None else np.log(max(value, 1e-300) / _LOWEST) / span
        strength = float(np.clip(share, 0.0, 1.0))
        panel.bar(x, 1.0, 1.0, y - 0.5, color=colour, alpha=strength * _STRONGEST, linewidth=0)
        text = "∞" if value == np.inf else percent(value).replace(" %", "")
        if value is not None and _TOLD < value < np.inf:
            text = f"> {100 * _TOLD:.0f}"  # a rival on its way to running away
        panel.text(x, y - 0.12, text, ha="center", va="center", fontsize=8, color=look.INK)
    panel.set_xticks(range(len(deborah)), [f"{v:g}" for v in deborah])
    panel.set_yticks(range(len(weissenberg)), [f"{v:g}" for v in weissenberg])
    panel.set_xlim(-0.5, len(deborah) - 0.5)
    panel.set_ylim(-0.5, len(weissenberg) - 0.5)
    panel.grid(False)


def _axes_of(cells: Cells) -> tuple[list[float], list[float]]:
    return sorted({wi for wi, _ in cells}), sorted({de for _, de in cells})


def _mark_training(panel, comparison: Comparison, cells: Cells) -> None:
    """Mark the flows of training above the numbers, between cells where they lie on none."""
    weissenberg, deborah = (np.asarray(v) for v in _axes_of(cells))
    for flow in comparison.flows_of("training"):
        if flow.oscillatory and flow.frequency:
            x = np.interp(np.log(flow.frequency), np.log(deborah), np.arange(deborah.size))
            y = np.interp(np.log(flow.amplitude), np.log(weissenberg), np.arange(weissenberg.size))
            panel.plot(
                x, y + 0.28, "o", ms=4.5, mfc="none", mew=1.0, color=look.TRUTH,
                label="trained on (σ₁₂)",
            )  # fmt: skip


def _label(axes) -> None:
    for panel in axes[-1]:
        panel.set_xlabel("De = λω")
    for panel in axes[:, 0]:
        panel.set_ylabel("Wi = λγ̇₀")
    for panel in axes.ravel():
        panel.annotate(
            "%", (1.0, 1.02), xycoords="axes fraction", ha="right", fontsize=8, color=look.INK
        )
