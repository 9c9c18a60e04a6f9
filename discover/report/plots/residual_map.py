"""Maps of residuals: one row for each run, time or strain across, colour and depth for the size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.patches import Patch

from discover.comparison.comparison import Comparison
from discover.dataset.run import sizes_of
from discover.learners.registry import learner_title
from discover.loop.loop_result import LoopResult
from discover.report.plots.comparison.flows import units
from discover.report.plots.loop.runs import along_in_common, models_of, shortened
from discover.report.plots.style import (
    INK,
    NETWORK,
    SPARSE,
    Picture,
    figure,
    literal,
    make_logarithmic,
    picture,
    runs_through_decades,
)
from discover.report.wording import percent

_LEVELS = 6
_TOO_HIGH, _TOO_LOW = SPARSE, NETWORK


@dataclass(frozen=True)
class ResidualRow:
    """The residual of one run.

    `values`: prediction minus data over the run's root-mean-square stress, shape (n,).
    """

    name: str
    along: Float[np.ndarray, " n"]  # time or strain, increasing, shape (n,)
    values: Float[np.ndarray, " n"]


def loop_residual_map(result: LoopResult) -> Picture | None:
    """Return the residual of every run before and after, over time or strain.

    None for a single run, of which the residual is drawn already.
    """
    transients = [record for record in result.records if record.is_transient]
    states = not transients
    records = sorted(
        transients or result.records, key=lambda r: (r.held_out, np.max(np.abs(r.rate)))
    )
    if len(records) == 1:
        return None
    started = states or all(runs_through_decades(r.time, r.rate) for r in records)
    panels = {}
    for stage, title in models_of(records):
        panels[title] = [
            ResidualRow(
                f"{shortened(r.name)}{' (held out)' if r.held_out else ''}",
                r.along[1] if states else r.strain if started else r.time,
                r.relative_residual[stage],
            )
            for r in records
        ]
    label = along_in_common(records) if states else "strain" if started else "time (s)"
    return _draw(panels, label, started, "from slow to fast")


def comparison_residual_map(comparison: Comparison) -> Picture | None:
    """Return the residual of σ12 in the training runs: of the known part, and of each learner."""
    flows = [flow for flow in comparison.flows_of("training") if flow.measured is not None]
    if not flows:
        return None
    # what goes on in time and what does not share no axis
    axis = next((f.drawn[0] for f in flows if not f.is_of_states), flows[0].drawn[0])
    flows = [flow for flow in flows if flow.drawn[0] == axis]
    everyone = {"before": comparison.before}
    everyone |= {learner_title(n): o.predictions for n, o in comparison.outcomes.items()}
    panels = {}
    for title, predictions in everyone.items():
        rows = []
        for flow in flows:
            prediction, measured = predictions[flow.key], flow.measured
            if prediction is not None and measured is not None:
                values = (prediction["sigma12"] - measured) / sizes_of(measured, flow.protocol)
                if not np.all(np.isfinite(values)):
                    continue
                rows.append(ResidualRow(flow.title, flow.along, values))
        if rows:
            panels[title] = rows
    if max(map(len, panels.values()), default=0) < 2:  # streaks are seen across runs
        return None
    states = all(flow.is_of_states for flow in flows)
    paces = [np.ones_like(f.times) if f.records_strain else f.rate for f in flows]
    logarithmic = states or all(
        runs_through_decades(f.times, pace) for f, pace in zip(flows, paces, strict=True)
    )
    _, time_label, rate_label = units(comparison)
    label = {"time (s)": time_label, "shear rate (1/s)": rate_label}.get(axis, axis)
    return _draw(panels, label, logarithmic, "in the order of the data")


def _draw(
    panels: dict[str, list[ResidualRow]], label: str, logarithmic: bool, order: str
) -> Picture:
    rows = max(len(panel) for panel in panels.values())
    with figure(1, len(panels), width=10.0, height=1.3 + 0.2 * rows) as (drawing, axes):
        names: list[str] = []
        for panel, (title, mine) in zip(axes[0], panels.items(), strict=True):
            limit = scale_of(mine)
            for place, row in enumerate(mine):
                _draw_row(panel, len(mine) - 1 - place, row, limit, logarithmic)
            if logarithmic:
                make_logarithmic(panel.xaxis)
            # where a panel lacks a run that ran away, its names are its own
            here = [literal(row.name) for row in mine][::-1]
            panel.set_yticks(range(len(mine)), here if here != names else [""] * len(here))
            names = here
            panel.tick_params(axis="y", labelsize=8, length=0)
            panel.set_ylim(-0.6, len(mine) - 0.4)
            panel.set_title(f"{title} (colour scale ±{percent(limit)})")
            panel.set_xlabel(label)
            panel.grid(False)
        drawing.legend(
            [Patch(color=_TOO_HIGH), Patch(color=_TOO_LOW)],
            ["predicted too high", "predicted too low"],
            loc="outside upper center",
            ncols=2,
        )
        return picture(
            drawing,
            "residual_map",
            f"Residual map: one row for each run, {order}. Prediction minus data over the run's "
            "root-mean-square stress; colour scale: square root of the residual. Vertical streaks "
            "common to several runs point to a missing effect; noise looks like speckle.",
        )


def scale_of(rows: Sequence[ResidualRow]) -> float:
    """Return the relative residual that is drawn deepest: all but 2 % of the samples are below."""
    values = np.abs(np.concatenate([row.values for row in rows]))
    return float(np.percentile(values, 98.0)) or 1e-12


def levels(values: Float[np.ndarray, " n"], limit: float) -> np.ndarray:
    """Return the level of each value, from −`_LEVELS` to `_LEVELS`, as its square root.

    The root lets a small residual be seen next to a large one.
    """
    root = np.sign(values) * np.sqrt(np.abs(values) / limit)
    return np.clip(np.rint(_LEVELS * root), -_LEVELS, _LEVELS).astype(int)


def _draw_row(panel, place: int, row: ResidualRow, limit: float, logarithmic: bool) -> None:
    """Draw a run as stripes; neighbours of one level are one stripe."""
    if logarithmic:
        kept = row.along > 0
        row = ResidualRow(row.name, row.along[kept], row.values[kept])
    middle = 0.5 * (row.along[1:] + row.along[:-1])
    edges = np.concatenate([row.along[:1], middle, row.along[-1:]])
    level = levels(row.values, limit)
    starts = np.flatnonzero(np.diff(level, prepend=level[0] + 1))
    stops = np.append(starts[1:], level.size)
    for colour, sign in ((_TOO_HIGH, 1), (_TOO_LOW, -1)):
        for depth in range(1, _LEVELS + 1):
            spans = [
                (edges[a], edges[b] - edges[a])
                for a, b in zip(starts, stops, strict=True)
                if level[a] == sign * depth
            ]
            if spans:
                panel.broken_barh(
                    spans, (place - 0.42, 0.84), facecolor=colour, alpha=depth / _LEVELS, lw=0
                )
    panel.plot([edges[0], edges[-1]], [place - 0.5] * 2, color=INK, lw=0.3)
