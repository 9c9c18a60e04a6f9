"""The residual of each explanation of a closed loop, side by side."""

import numpy as np

from discover.loop import LoopResult
from discover.report.plots.loop.runs import FIT_COLOUR, HELD_COLOUR
from discover.report.plots.style import (
    INK,
    Picture,
    legend_above,
    make_logarithmic,
    panels_of,
    picture,
    runs_through_decades,
)
from discover.report.wording import percent
from discover.statistics.projection import rms
from discover.words import effect_title

_MOST_RIVALS, _COLUMNS = 6, 3


def rivals_picture(result: LoopResult) -> Picture | None:
    """Return the residual against time of each explanation; None where there is one alone.

    The likeliest are shown, on one scale.
    """
    told = result.explanations.likeliest_first
    records = [r for r in result.records if r.is_transient and r.by_explanation is not None]
    if len(told) < 2 or not records:
        return None
    shown = told[:_MOST_RIVALS]
    chosen = result.explanations.holding([stage.effect for stage in result.stages])
    with panels_of(len(shown), _COLUMNS, width=10.0, height=2.1) as (drawing, axes, panels):
        limit = 0.0
        for place, (panel, one) in enumerate(zip(panels, shown, strict=True)):
            for record in records:
                assert record.by_explanation is not None
                size = rms(record.measured) or 1.0
                relative = 100.0 * (record.by_explanation[place] - record.measured) / size
                panel.plot(
                    record.time, relative, lw=0.9, alpha=0.8,
                    color=HELD_COLOUR if record.held_out else FIT_COLOUR,
                    label="held out" if record.held_out else "fitted",
                )  # fmt: skip
                limit = max(limit, float(np.percentile(np.abs(relative), 98)))
            names = "\n+ ".join(map(effect_title, one.effects)) or "the declared model alone"
            found = ", found by the search" if one is chosen else ""
            panel.set_title(f"{names}\n({percent(one.probability)}{found})", fontsize=8)
            panel.axhline(0.0, color=INK, lw=0.6)
            if all(runs_through_decades(r.time, r.rate) for r in records):
                make_logarithmic(panel.xaxis)
        for panel in panels:
            panel.set_ylim(-1.1 * limit - 1e-9, 1.1 * limit + 1e-9)
        for panel in panels[-axes.shape[1] :]:  # below which there is none
            panel.set_xlabel("time (s)")
        for panel in axes[:, 0]:
            panel.set_ylabel("residual (% of rms)")
        legend_above(drawing, axes)
        left = f" The {_MOST_RIVALS} likeliest of {len(told)}." if len(told) > _MOST_RIVALS else ""
        return picture(
            drawing,
            "rivals",
            "Prediction minus measurement of every run by each explanation, over the run's "
            "root-mean-square, on one scale; over each panel its effects and their probability."
            + left,
        )
