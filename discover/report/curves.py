"""Every run, measured and as a result has it: one figure for all kinds of results."""

from contextlib import AbstractContextManager
from functools import singledispatch
from io import BytesIO
from typing import Any

from matplotlib.figure import Figure

from discover.comparison.comparison import Comparison
from discover.errors import InputError
from discover.fitting import NamedLawFit
from discover.learners.run_prediction import RunPrediction
from discover.loop.loop_result import LoopResult
from discover.loop.run_record import record_runs
from discover.report.plots.comparison.flows import drawn_records
from discover.report.plots.loop.runs import FITTED_LAW, drawn_runs

Drawn = AbstractContextManager[Figure]
"""A figure while the style of the pages holds."""


@singledispatch
def drawn(result: Any) -> Drawn:
    """Return the runs of a result with what it predicts of each; InputError if it holds none."""
    raise TypeError(type(result).__name__)


@drawn.register
def _(result: NamedLawFit) -> Drawn:
    return drawn_runs(_some(result.records), FITTED_LAW)


@drawn.register
def _(result: LoopResult) -> Drawn:
    return drawn_runs(_some(result.records))


@drawn.register
def _(result: RunPrediction) -> Drawn:
    if not hasattr(result, "runs_"):
        raise InputError(
            f"There is no run to draw: {type(result).__name__} is not fitted, or comes from a "
            "file, which holds no data. Fit it, or draw what predict(data) returns."
        )
    runs = list(result.runs_)
    pairs = zip(runs, result._predict_runs(runs), strict=True)
    records = [record_runs([run], values[None, None], False)[0] for run, values in pairs]
    return drawn_runs(_some(records), FITTED_LAW)


@drawn.register
def _(result: Comparison) -> Drawn:
    flows = [
        flow
        for flow in result.flows
        if flow.is_record and (flow.measured is not None or "sigma12" in flow.reference)
    ]
    return drawn_records(result, _some(flows))


def _some(runs: Any) -> Any:
    if not runs:
        raise InputError("There is no run to draw: the result holds no record. Give one with data.")
    return runs


def curves_figure(result: Any) -> Figure:
    """Return every run of a result as a figure of matplotlib, for a notebook.

    Raises InputError if the result holds no run.
    """
    with drawn(result) as drawing:
        # drawn here, where the style of the pages holds
        drawing.savefig(BytesIO(), format="svg")
        return drawing
