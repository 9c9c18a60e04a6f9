"""Oscillations over Wi and De: errors, and curves that become elliptical."""

from collections.abc import Mapping

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES
from discover.learners.registry import learner_title
from discover.report.plots import style as look
from discover.report.plots.comparison.flows import curves, units
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS


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
