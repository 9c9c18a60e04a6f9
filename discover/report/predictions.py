"""``predictions.csv``: every curve that a report draws, one line a sample."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES, Flow
from discover.loop import LoopResult, RunRecord
from discover.study.run_folder import RunFolder

COLUMNS = (
    "run",
    "role",
    "time_s",
    "strain",
    "rate_1_s",
    "quantity",
    "source",
    "value",
    "low95",
    "high95",
    "measured",
)

PREDICTIONS = "predictions.csv"

POSTERIOR = "posterior"
"""Source of what all laws that the data allow predict together, with its band."""

_ROLES = {"training": "fit", "held_out": "held_out", "test": "prediction"}
_ROLES["high_deborah"] = "prediction"
_SOURCES = {"before": "declared"}
_NO_CLAIM = (np.nan, np.nan)


def comparison_predictions(comparison: Comparison) -> pd.DataFrame:
    """Return the curves of a comparison: declared law, learners and posterior, in every flow.

    Times in s, rates in 1/s, stresses in Pa. ``low95`` and ``high95`` are the 95 % band of the
    posterior; the sparse law has it in runs that it did not see, where the quantity is determined
    (the band of a fitted run is that of its own loading, which this law has not), else NaN, as has
    ``measured`` where nothing was. Flows over which only errors are mapped are left out, and a law
    has no line in a flow that it cannot be integrated through.
    """
    curves: dict[str, Mapping[str, Any]] = {"before": comparison.before}
    curves |= {name: outcome.predictions for name, outcome in comparison.outcomes.items()}
    curves[POSTERIOR] = {key: band.middle for key, band in comparison.bands.items()}
    rows = []
    for flow in comparison.flows:
        for who, predictions in curves.items() if flow.kind in _ROLES else ():
            predicted, limits = predictions.get(flow.key), _limits(comparison, who, flow)
            for quantity in QUANTITIES if flow.records_shear_stress else QUANTITIES[:1]:
                if predicted is None or quantity not in predicted:
                    continue
                recorded = quantity if flow.records_shear_stress else flow.protocol.quantity
                rows.append((
                    flow.name, _ROLES[flow.kind], flow.times, flow.strain, flow.rate, recorded,
                    _SOURCES.get(who, who), predicted[quantity], *limits.get(quantity, _NO_CLAIM),
                    _measured(flow, quantity),
                ))  # fmt: skip
    return _table(rows)


def loop_predictions(result: LoopResult) -> pd.DataFrame:
    """Return the curves of a closed loop, by the declared model and by the augmented one.

    Units as in `comparison_predictions`. Where nothing was added there is only the declared model.
    The limits hold where 95 % of the measurements should lie by all explanations together; they
    stand with the model that was found.
    """
    return _table([row for record in result.records for row in _rows_of(record)])


def write_predictions(table: pd.DataFrame, folder: RunFolder) -> str:
    """Write a table of predictions into a folder of results, and return its text."""
    # nine digits: more than any measurement has, and than the integration promises
    text = table.to_csv(index=False, float_format="%.9g", lineterminator="\n")
    folder.write(PREDICTIONS, text)
    return text


def _rows_of(record: RunRecord) -> Iterator[tuple]:
    sources = {"declared": record.predicted[0]}
    if len(record.predicted) > 1:
        sources["augmented"] = record.predicted[-1]
    for source, predicted in sources.items():
        band = record.band if source == [*sources][-1] else None
        yield (
            record.name, "held_out" if record.held_out else "fit", record.time, record.strain,
            record.rate, record.quantity, source, predicted,
            *(_NO_CLAIM if band is None else band), record.measured,
        )  # fmt: skip


def _limits(comparison: Comparison, who: str, flow: Flow) -> Mapping[str, tuple[Any, Any]]:
    """Return the band of predictions in a flow, by quantity; empty for no claim."""
    if who == POSTERIOR:
        band = comparison.bands.get(flow.key)
    elif who == "tensor_sindy" and comparison.determined_terms and flow.kind != "training":
        band = comparison.determined_band(flow)
    else:
        band = None
    if band is None:
        return {}
    return {quantity: (band.low[quantity], band.high[quantity]) for quantity in band.middle}


def _measured(flow: Flow, quantity: str) -> Any:
    """Return what was measured of a quantity; the truth of computed data is no measurement."""
    if quantity == "sigma12" and flow.measured is not None:
        return flow.measured
    return np.nan if flow.is_truth else flow.reference.get(quantity, np.nan)


def _table(rows: Sequence[tuple]) -> pd.DataFrame:
    """Return rows of scalars and columns, in the order of `COLUMNS`, as one table."""
    parts = [pd.DataFrame(dict(zip(COLUMNS, row, strict=True))) for row in rows]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(COLUMNS))
