"""The product under test, asked by a study file as a user asks it, without the pages it draws."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from independent.folders import write_study

CONFIDENT = ("explained", "effects_added", "no_effect_needed")
COLUMNS = {"time_s": "time", "value": "value", "low95": "low", "high95": "high"}
Predictions = dict[tuple[str, str, str], dict[str, np.ndarray]]


@contextmanager
def without_pages() -> Iterator[None]:
    """Write JSON and predictions alone: to draw a page takes as long as to decide."""
    from discover.report import loop as loop_report
    from discover.report import predictions as lines
    from discover.report.comparison import report as comparison_report

    def loop(result, folder, *_, **__):
        folder.write("loop.json", json.dumps(result.to_json()) + "\n")
        lines.write_predictions(lines.loop_predictions(result), folder)

    def comparison(result, folder, *_, **__):
        folder.write("comparison.json", json.dumps(result.to_json()) + "\n")
        lines.write_predictions(lines.comparison_predictions(result), folder)

    with (
        patch.object(loop_report, "write_loop", loop),
        patch.object(comparison_report, "write_comparison", comparison),
    ):
        yield


def answer(folder: Path, question: str, sections: Mapping[str, Mapping[str, Any]]) -> dict:
    """Return the JSON that a command writes of a study with these sections."""
    from discover.batch.run import run_close_loop, run_compare

    study = write_study(folder / f"{question}.toml", sections)
    execute = run_close_loop if question == "close-loop" else run_compare
    with without_pages():
        execute(study, folder / "out", None, True, lambda text, fraction: None)
    name = "loop.json" if question == "close-loop" else "comparison.json"
    return json.loads((folder / "out" / name).read_text(encoding="utf-8"))


def predictions(folder: Path) -> Predictions:
    """Return what is predicted of fitted and held-out runs, by run, quantity and source."""
    rows = pd.read_csv(folder / "out" / "predictions.csv", float_precision="round_trip")
    rows = rows[rows["role"].isin(["fit", "held_out"])].rename(columns=COLUMNS)
    groups = rows.groupby(["run", "quantity", "source"], sort=False)
    return {key: {name: some[name].to_numpy(float) for name in COLUMNS.values()}
            for key, some in groups}  # fmt: skip
