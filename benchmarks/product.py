"""The product under test, asked by a study file as a user asks it, without the pages it draws."""

import csv
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from independent.folders import write_study

CONFIDENT = ("explained", "effects_added", "no_effect_needed")
COLUMNS = {"time": "time_s", "value": "value", "low": "low95", "high": "high95",
           "measured": "measured"}  # fmt: skip
Predictions = dict[tuple[str, str, str], dict[str, np.ndarray]]


@contextmanager
def without_pages() -> Iterator[None]:
    """Write JSON and predictions alone: to draw a page takes as long as to decide."""
    from discover.report import predictions as lines
    from discover.report.comparison import report as comparison_report
    from discover.report.loop import report as loop_report

    def loop(result, folder, *_, **__):
        result.write_json(folder.path / "loop.json")
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


def predictions(folder: Path, *roles: str) -> Predictions:
    """Return what is predicted of fitted and held-out runs, by run, quantity and source."""
    roles = roles or ("fit", "held_out")
    lists: dict[tuple[str, str, str], list[tuple[float, ...]]] = defaultdict(list)
    with (folder / "out" / "predictions.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["role"] in roles:
                values = (row.get(k) for k in COLUMNS.values())
                key = row["run"], row["quantity"], row["source"]
                lists[key].append(tuple(float(v) if v else np.nan for v in values))
    return {key: dict(zip(COLUMNS, np.array(rows).T, strict=True)) for key, rows in lists.items()}
