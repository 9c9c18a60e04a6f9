"""Every run, measured and as a result has it: one figure for all kinds of results."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from discover.comparison.comparison import Comparison
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.learners.run_prediction import RunPrediction
from discover.loop.loop_result import LoopResult
from discover.loop.run_record import RunRecord, record_runs
from discover.report.plots.loop.runs import FIT_COLOUR, HELD_COLOUR, shortened
from discover.report.plots.style import (
    BEFORE,
    TRUTH,
    label_rows,
    learner_style,
    legend_above,
    literal,
    make_logarithmic,
    panels_of,
    runs_through_decades,
)
from discover.report.wording import percent, recorded_symbol
from discover.statistics.noise.noise_model import rms

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Drawn = tuple[str, Float[np.ndarray, " n"], Mapping[str, Any]]
"""A prediction: label, values and style of its line."""

_MOST_MARKED = 60
"""Samples of a run that are marked."""


@dataclass(frozen=True)
class Curves:
    """One run as a panel shows it.

    `label`, `along`: what it is drawn against, in words with the unit, and its values, shape (n,).
    """

    name: str  # of the run
    label: str
    along: Float[np.ndarray, " n"]
    quantity: str  # what was recorded
    measured: Float[np.ndarray, " n"]  # its values, shape (n,)
    lines: Sequence[Drawn]  # the predictions; the error of the last stands above the panel
    states: bool = False  # whether samples are steady or periodic states
    decades: bool = False  # whether it goes through decades of time

    @property
    def title(self) -> str:
        """Name, and the relative error of the last line."""
        error = rms(self.lines[-1][1] - self.measured) / (rms(self.measured) or 1.0)
        return f"{literal(shortened(self.name))}\n{percent(float(error))}"

    @property
    def ordinate(self) -> str:
        """Symbol and unit of what was recorded."""
        symbol = recorded_symbol([self.quantity])
        return symbol if self.quantity == "strain" else f"{symbol} (Pa)"


@singledispatch
def curves_of(result: Any) -> list[Curves]:
    """Return the runs of a result with what it predicts of each."""
    raise TypeError(type(result).__name__)


@curves_of.register
def _(result: NamedLawFit) -> list[Curves]:
    return [_of_record(one, "law") for one in result.records]


@curves_of.register
def _(result: LoopResult) -> list[Curves]:
    return [_of_record(one, "model found") for one in result.records]


def _of_record(record: RunRecord, name: str) -> Curves:
    colour = HELD_COLOUR if record.held_out else FIT_COLOUR
    role = "held out" if record.held_out else "fitted"
    found = (f"{name}, {role}", record.predicted[-1], {"lw": 1.5, "color": colour})
    start = ("starting model", record.predicted[0], {"lw": 1.1, "ls": "-.", "color": BEFORE})
    label, along = record.along
    at_rest = record.control == "stress"  # in creep the stress is constant, and not the rate
    rate = np.ones_like(record.time) if at_rest else record.rate
    return Curves(
        record.name, label, along, record.quantity, record.measured,
        [start, found] if len(record.predicted) > 1 else [found],
        not record.is_transient,
        record.is_transient and runs_through_decades(record.time, rate),
    )  # fmt: skip


@curves_of.register
def _(result: RunPrediction) -> list[Curves]:
    if not hasattr(result, "runs_"):
        raise InputError(
            f"There is no run to draw: {type(result).__name__} is not fitted, or comes from a "
            "file, which holds no data. Fit it, or draw what predict(data) returns."
        )
    predicted = result._predict_runs(list(result.runs_))
    pairs = zip(result.runs_, predicted, strict=True)
    records = [record_runs([run], values[None, None], False)[0] for run, values in pairs]
    return [_of_record(one, "law") for one in records]


@curves_of.register
def _(result: Comparison) -> list[Curves]:
    found = []
    for flow in result.flows:
        record = flow.measured if flow.kind == "training" else flow.reference.get("sigma12")
        if not flow.is_record or record is None:
            continue
        lines = [
            (name, predicted["sigma12"], learner_style(name))
            for name, outcome in result.outcomes.items()
            if (predicted := outcome.predictions[flow.key]) is not None
        ]
        label, along = flow.drawn
        decades = not flow.is_of_states and runs_through_decades(flow.times, flow.rate)
        quantity = flow.protocol.quantity
        if lines:
            found.append(
                Curves(
                    flow.name, label, along, quantity, np.asarray(record), lines,
                    flow.is_of_states, decades,
                )
            )  # fmt: skip
    return found


def draw_curves(curves: Sequence[Curves], drawing, axes, panels) -> None:
    """Draw runs, one in each panel, with one legend."""
    for panel, one in zip(panels, curves, strict=True):
        every = max(1, len(one.along) // _MOST_MARKED)
        panel.plot(
            one.along[::every], one.measured[::every], "o", ms=2.5, mfc="none", mew=0.7,
            color=TRUTH, label="measured",
        )  # fmt: skip
        for label, values, style in one.lines:
            panel.plot(one.along, values, label=label, **style)
        if one.states:
            panel.set_xscale("log")
            if np.all(one.measured > 0.0) and np.all(one.lines[-1][1] > 0.0):
                panel.set_yscale("log")
        elif one.decades:
            make_logarithmic(panel.xaxis)
        panel.set_xlabel(one.label)
        panel.set_title(one.title, fontsize=8)
    label_rows(axes, [one.ordinate for one in curves])
    legend_above(drawing, axes)


def curves_figure(result: Any) -> "Figure":
    """Return every run of a result as a figure of matplotlib, for a notebook.

    Raises InputError if the result holds no run.
    """
    curves = curves_of(result)
    if not curves:
        raise InputError("There is no run to draw: the result holds no record.")
    with panels_of(len(curves), width=10.0, height=2.2) as (drawing, axes, panels):
        draw_curves(curves, drawing, axes, panels)
        # drawn here, where the style of the pages holds
        drawing.savefig(BytesIO(), format="svg")
        return drawing
