"""``predictions.csv``: what a report draws, as numbers that others can read."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from discover.comparison import Flow, LearnerOutcome
from discover.comparison.comparison import Comparison
from discover.comparison.flows import FlowBand
from discover.loop import ErrorPair, LoopResult, RunRecord
from discover.protocols.protocol import in_flow, oscillatory_shear
from discover.report.predictions import (
    COLUMNS,
    comparison_predictions,
    loop_predictions,
    write_predictions,
)
from discover.study import RunFolder

TIME = np.linspace(0.0, 2.0, 5)
STRESS = np.sin(TIME)


def record(name, held_out, stages, **more):
    predicted = np.stack([(1.0 + 0.1 * i) * STRESS for i in range(stages)])
    told = TIME, TIME, TIME, np.ones(5), STRESS, predicted, np.zeros(stages)
    return RunRecord(name, held_out, *told, **more)


def loop(*records, stages=1):
    records = records or (record("a.csv", False, stages), record("b.csv", True, stages))
    nothing = ErrorPair(0.0, 0.0)
    return LoopResult("no_effect_needed", nothing, nothing, 0.0, (), {}, (), records)


def flow(kind, is_truth, measured=None):
    reference = {"sigma12": STRESS, "N1": 2.0 * STRESS}
    return Flow(
        f"{kind}.csv", kind, oscillatory_shear(1.0, 1.0), TIME, np.cos(TIME), reference, measured,
        is_truth,
    )  # fmt: skip


def comparison(flows, predictions, bands=None):
    outcome = LearnerOutcome("tensor_sindy", (), 0.0, predictions=predictions)
    return Comparison(
        name="made up", data_summary="", known_part="", flows=flows, before=predictions,
        outcomes={"tensor_sindy": outcome}, posterior=loop(), bands=bands or {},
        shares={"tensor_sindy": 1.0},
    )  # fmt: skip


def of(flows, factor=1.0):
    stresses = {name: factor * STRESS for name in ("sigma12", "N1", "N2")}
    return {flow.key: stresses for flow in flows}


def test_a_file_holds_every_sample_of_every_curve_and_reads_back_augmented_where_added(tmp_path):
    folder = RunFolder(tmp_path, "x")
    write_predictions(loop_predictions(loop(stages=3)), folder)
    table = pd.read_csv(tmp_path / "predictions.csv")
    assert tuple(table.columns) == COLUMNS
    assert len(table) == 2 * 2 * len(TIME)
    augmented = table[(table["run"] == "b.csv") & (table["source"] == "augmented")]
    assert set(augmented["role"]) == {"held_out"}
    np.testing.assert_allclose(augmented["value"], 1.2 * STRESS, rtol=1e-8)
    np.testing.assert_allclose(augmented["measured"], STRESS, rtol=1e-8)
    assert set(loop_predictions(loop())["source"]) == {"declared"}  # the control


def test_computed_truth_is_no_measurement_but_noisy_records_are():
    noisy = STRESS + 0.1
    flows = [flow("training", True, noisy), flow("test", True), flow("held_out", False)]
    table = comparison_predictions(comparison(flows, of(flows)))
    measured = table.groupby(["role", "quantity"])["measured"].agg(lambda v: v.notna().all())
    assert measured["fit", "sigma12"]
    assert measured["held_out", "sigma12"]
    assert measured["held_out", "N1"]
    assert not measured["held_out", "N2"]
    assert not measured["fit", "N1"]
    assert not measured["prediction", "sigma12"]


def test_bands_stand_where_a_claim_is_made_and_nowhere_else():
    flows = [flow("training", True, STRESS), flow("test", True)]
    middle, low, high = (
        dict.fromkeys(("sigma12", "N1", "N2"), STRESS + off) for off in (0.0, -0.5, 0.5)
    )
    band = FlowBand(middle, low, high)
    table = comparison_predictions(comparison(flows, of(flows), {flows[1].key: band}))
    claimed = table.dropna(subset=["low95", "high95"])
    assert set(claimed["role"]) == {"prediction"}
    assert set(claimed["source"]) == {"tensor_sindy", "posterior"}
    np.testing.assert_allclose(claimed["high95"] - claimed["low95"], 1.0)
    # a fitted run's band is of its own loading: it stands with the posterior, which has that
    table = comparison_predictions(comparison(flows, of(flows), {flows[0].key: band}))
    assert set(table.dropna(subset=["low95"])["source"]) == {"posterior"}


@pytest.mark.parametrize("missing", [None, {}])
def test_a_law_that_runs_away_has_no_line_and_spoils_no_other(missing):
    flows = [flow("training", True, STRESS), flow("test", True)]
    predictions = of(flows)
    predictions[flows[1].key] = None
    if missing is not None:
        del predictions[flows[1].key]
    table = comparison_predictions(comparison(flows, predictions))
    assert set(table["role"]) == {"fit"}


def test_what_is_recorded_in_extension_is_called_a_tensile_stress():
    pull = record("pull.csv", False, 1, flow="uniaxial", quantity="tensile_stress")
    assert set(loop_predictions(loop(pull))["quantity"]) == {"tensile_stress"}
    shear = flow("held_out", False)
    uniaxial = in_flow(oscillatory_shear(1.0, 1.0), "uniaxial")
    flows = (shear, replace(shear, name="pull.csv", protocol=uniaxial))
    table = comparison_predictions(comparison(flows, of(flows)))
    kinds = {name: set(rows["quantity"]) for name, rows in table.groupby("run")}
    assert kinds == {"held_out.csv": {"sigma12", "N1", "N2"}, "pull.csv": {"tensile_stress"}}
