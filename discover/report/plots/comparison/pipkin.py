"""Maps over the Pipkin diagram: how strongly the flow pulls, against how fast it changes.

The diagram is that of Pipkin 1972, Lectures on Viscoelasticity Theory: De across, Wi upwards.
"""

from collections.abc import Mapping

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES
from discover.learners.registry import learner_title
from discover.report.plots.style import INK, NETWORK, TRUTH, Picture, figure, legend_above, picture
from discover.report.wording import percent
from discover.words import FIGURE_SYMBOLS

_STRONGEST = 0.55  # more would drown the number in the cell
_TOLD = 10.0  # a larger relative error is no more than that in a cell
_LOWEST, _HIGHEST = 1e-4, 1.0
"""Relative errors at which the colour of a cell begins and ends."""

Cells = Mapping[tuple[float, float], float | None]


def error_map_picture(comparison: Comparison) -> Picture | None:
    """Return the error of the known part and of each learner over Wi and De."""
    if not comparison.flows_of("pipkin"):
        return None
    rows = {"before": "before", **{n: learner_title(n) for n in comparison.outcomes}}
    with figure(len(rows), 3, width=10.0, height=2.5) as (drawing, axes):
        for row, (who, title) in zip(axes, rows.items(), strict=True):
            table = comparison.error_map(who)
            for panel, quantity in zip(row, QUANTITIES, strict=True):
                cells = {place: errors[quantity] for place, errors in table.items()}
                _draw_cells(panel, cells, NETWORK)
                panel.set_title(f"{FIGURE_SYMBOLS[quantity]}, {title}")
                _mark_training(panel, comparison, cells)
        _label(axes)
        legend_above(drawing, axes)
        return picture(
            drawing,
            "pipkin_error",
            "Pipkin map of error: relative L2 error in one late cycle of γ̇ = Wi cos(De t), N₂'s "
            "relative to N₁; a dash where the law diverges. Open circles: flows whose σ₁₂ the "
            "learners saw. Away from them a law is an extrapolation.",
        )


def _draw_cells(panel, cells: Cells, colour: str) -> None:
    """Draw one number a cell, the deeper the larger on a logarithmic scale."""
    weissenberg, deborah = _axes_of(cells)
    for (wi, de), value in cells.items():
        x, y = deborah.index(de), weissenberg.index(wi)
        strength = 0.0 if value is None else _strength(value)
        panel.bar(x, 1.0, 1.0, y - 0.5, color=colour, alpha=strength * _STRONGEST, linewidth=0)
        text = "∞" if value == np.inf else percent(value).replace(" %", "")
        if value is not None and _TOLD < value < np.inf:
            text = f"> {100 * _TOLD:.0f}"  # a rival on its way to running away
        panel.text(x, y - 0.12, text, ha="center", va="center", fontsize=8, color=INK)
    panel.set_xticks(range(len(deborah)), [f"{v:g}" for v in deborah])
    panel.set_yticks(range(len(weissenberg)), [f"{v:g}" for v in weissenberg])
    panel.set_xlim(-0.5, len(deborah) - 0.5)
    panel.set_ylim(-0.5, len(weissenberg) - 0.5)
    panel.grid(False)


def _strength(value: float) -> float:
    span = np.log(_HIGHEST / _LOWEST)
    return float(np.clip(np.log(max(value, 1e-300) / _LOWEST) / span, 0.0, 1.0))


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
                x, y + 0.28, "o", ms=4.5, mfc="none", mew=1.0, color=TRUTH,
                label="trained on (σ₁₂)",
            )  # fmt: skip


def _label(axes) -> None:
    for panel in axes[-1]:
        panel.set_xlabel("De = λω")
    for panel in axes[:, 0]:
        panel.set_ylabel("Wi = λγ̇₀")
    for panel in axes.ravel():
        panel.annotate(
            "%", (1.0, 1.02), xycoords="axes fraction", ha="right", fontsize=8, color=INK
        )
