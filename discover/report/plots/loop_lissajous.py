"""Lissajous curves of the oscillating runs of a closed loop: measured, before and after."""

import numpy as np

from discover.closed_loop.reading import oscillation
from discover.closed_loop.result import LoopResult, RunRecord
from discover.report.plots.loop import short_title
from discover.report.plots.style import (
    BEFORE,
    NETWORK,
    SPARSE,
    TRUTH,
    Picture,
    figure,
    legend_above,
    picture,
)

_MOST = 4


def lissajous_picture(result: LoopResult) -> Picture | None:
    """Return σ12 against strain and against rate in the last cycle, or None without oscillation.

    The widest runs are shown, those held out before those fitted.
    """
    found = [(r, w) for r in result.records if (w := oscillation(r)) is not None]
    found.sort(key=lambda pair: (not pair[0].held_out, -float(np.ptp(pair[0].strain))))
    shown = found[:_MOST]
    if not shown:
        return None
    with figure(2, len(shown), width=10.0, height=2.3) as (drawing, axes):
        for column, (record, frequency) in enumerate(shown):
            last = last_cycle(record, frequency)
            strain = record.strain[last]
            strain = strain - 0.5 * (strain.max() + strain.min())
            for panel, along in ((axes[0, column], strain), (axes[1, column], record.shear_rate)):
                across = along if along is strain else along[last]
                _draw(panel, record, across, last)
            axes[0, column].set_title(short_title(record), fontsize=8)
            axes[0, column].set_xlabel("strain γ")
            axes[1, column].set_xlabel("γ̇ (1/s)")
        axes[0, 0].set_ylabel("elastic: σ₁₂ (Pa)")
        axes[1, 0].set_ylabel("viscous: σ₁₂ (Pa)")
        legend_above(drawing, axes)
        left = f" The {_MOST} widest of {len(found)} runs." if len(found) > _MOST else ""
        return picture(
            drawing,
            "lissajous",
            "Elastic (above) and viscous (below) Lissajous curves of the last cycle, errors of the "
            f"run before and after over each.{left}",
        )


def _draw(panel, record: RunRecord, across, last) -> None:
    panel.plot(
        across, record.measured[last], "o", ms=2.5, mfc="none", mew=0.7, color=TRUTH,
        label="measured",
    )  # fmt: skip
    panel.plot(
        across, record.predicted[0][last], "-.", lw=1.1, color=BEFORE, label="declared model"
    )
    panel.plot(
        across, record.predicted[-1][last], lw=1.5, color=SPARSE if record.held_out else NETWORK,
        label="augmented, held out" if record.held_out else "augmented, fitted",
    )  # fmt: skip
    stress = record.measured[last]
    low, high = float(stress.min()), float(stress.max())
    margin = 0.6 * (high - low) or 1.0
    panel.set_ylim(low - margin, high + margin)


def last_cycle(record: RunRecord, frequency: float) -> np.ndarray:
    """Return which samples of a run lie in its last cycle, a little more so that it closes."""
    return record.time >= record.time[-1] - 2.0 * np.pi / frequency * 1.02
