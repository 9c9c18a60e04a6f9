"""Lissajous curves of the oscillating runs of a closed loop: measured, before and after."""

from collections.abc import Sequence

import numpy as np

from discover.loop.loop_result import LoopResult
from discover.loop.waves import oscillation
from discover.report.overlay import Overlay
from discover.report.plots.cycles import about_middle, in_last_cycle
from discover.report.plots.loop.runs import draw_overlays, draw_run, short_title
from discover.report.plots.style import MEASURED, Picture, figure, legend_above, picture

_MOST_DRAWN = 4


def lissajous_picture(result: LoopResult, overlays: Sequence[Overlay] = ()) -> Picture | None:
    """Return σ12 against strain and against rate in the last cycle, or None without oscillation.

    The widest runs are shown, those held out before those fitted.
    """
    found = [(r, w) for r in result.records if (w := oscillation(r)) is not None]
    found.sort(key=lambda pair: (not pair[0].held_out, -float(np.ptp(pair[0].strain))))
    shown = found[:_MOST_DRAWN]
    if not shown:
        return None
    with figure(2, len(shown), width=10.0, height=2.3) as (drawing, axes):
        for column, (record, frequency) in enumerate(shown):
            last = in_last_cycle(record.time, frequency)
            strain = about_middle(record.strain, last)
            for panel, along in ((axes[0, column], strain), (axes[1, column], record.rate)):
                if not np.all(last):
                    panel.plot(
                        along, record.measured, ".", ms=1.2, alpha=0.5, color=MEASURED,
                        label="measured, all cycles", zorder=1,
                    )  # fmt: skip
                draw_run(panel, record, along, last, last)
                draw_overlays(panel, record, overlays, along, last)
                _frame(panel, record.measured)
            axes[0, column].set_title(short_title(record), fontsize=8)
            axes[0, column].set_xlabel("strain γ")
            axes[1, column].set_xlabel("γ̇ (1/s)")
        axes[0, 0].set_ylabel("elastic: σ₁₂ (Pa)")
        axes[1, 0].set_ylabel("viscous: σ₁₂ (Pa)")
        legend_above(drawing, axes)
        left = (
            f" The {_MOST_DRAWN} widest of {len(found)} runs." if len(found) > _MOST_DRAWN else ""
        )
        return picture(
            drawing,
            "lissajous",
            "Elastic (above) and viscous (below) Lissajous curves: models in the last cycle, "
            f"measurements in all of them, faint. Over each the errors of the run.{left}",
        )


def _frame(panel, stress: np.ndarray) -> None:
    low, high = float(stress.min()), float(stress.max())
    margin = 0.6 * (high - low) or 1.0
    panel.set_ylim(low - margin, high + margin)
