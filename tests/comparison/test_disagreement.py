"""What is said where members, or learners, disagree; the curves are written by hand."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.disagreement import contested, disagreements, open_where_contested
from discover.comparison.judging.statements import IN_LIBRARY, Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand

from discover.protocols import start_up

TIMES = np.linspace(0.0, 4.0, 9)
FLOW = Flow("startup", "test", start_up(2.0), TIMES, np.full(9, 2.0), {})
CURVES = {"sigma12": 1.0 - np.exp(-TIMES), "N1": 1.0 - np.exp(-TIMES), "N2": 0.0 * TIMES}
EMPTY = (np.zeros(0), np.zeros(0))


def outcome(learner, n1=1.0, half_width=None, details=None):
    """A learner whose N1 is the true one times `n1`, with a band of this relative half-width."""
    curves = {**CURVES, "N1": n1 * CURVES["N1"]}
    bands = {}
    if half_width is not None:
        limits = {q: ((1 - half_width) * c, (1 + half_width) * c) for q, c in curves.items()}
        bands = {FLOW.key: {**limits, "sigma12": (curves["sigma12"], curves["sigma12"])}}
    return LearnerOutcome(
        learner, (), 1.0, EMPTY, details or {}, "", {FLOW.key: curves}, None, bands
    )


def band(half_width, reason=""):
    middle = np.stack([CURVES[q] for q in ("sigma12", "N1", "N2")], axis=1)
    low, high = (1 - half_width) * middle, (1 + half_width) * middle
    return {FLOW.key: PredictionBand(TIMES, middle, low, high, low, high, 0.0, reason)}


def test_learners_that_exclude_each_other_are_named_with_quantity_flow_and_size():
    outcomes = {
        "tensor_sindy": outcome("tensor_sindy"),
        "tbnn_ude": outcome("tbnn_ude", n1=1.16, half_width=0.02),
    }
    found = contested(outcomes, [FLOW], band(0.01))
    assert set(found) == {"N1"}
    assert "disagree on N1" in found["N1"]
    assert FLOW.title in found["N1"]
    assert "13 %" in found["N1"]  # 1.16 × 0.98 − 1.01
    assert found["N1"] in disagreements(outcomes, [FLOW], band(0.01))


def test_where_it_was_measured_the_measurement_says_who_is_wrong():
    outcomes = {
        "tensor_sindy": outcome("tensor_sindy"),
        "tbnn_ude": outcome("tbnn_ude", n1=1.16, half_width=0.02),
    }
    measured = replace(FLOW, reference={"N1": CURVES["N1"]})
    said = contested(outcomes, [measured], band(0.01))["N1"]
    assert said.endswith(
        "where sparse regression misses what was measured by 0 % and the network by 16 %."
    )
    # a truth that no rheometer gave is not among the data, nor is what was not measured
    for unknown in (replace(measured, is_truth=True), FLOW):
        assert contested(outcomes, [unknown], band(0.01))["N1"].endswith(
            "these data do not say which."
        )


def test_learners_within_their_bands_are_not_contested():
    outcomes = {
        "tensor_sindy": outcome("tensor_sindy"),
        "tbnn_ude": outcome("tbnn_ude", n1=1.16, half_width=0.2),
    }
    assert contested(outcomes, [FLOW], band(0.01)) == {}
    outcomes["tbnn_ude"] = outcome("tbnn_ude", n1=1.005)
    assert disagreements(outcomes, [FLOW], band(0.0)) == []


def test_networks_that_disagree_are_told_of_even_without_the_other_learner():
    said = disagreements({"tbnn_ude": outcome("tbnn_ude", half_width=0.16)}, [FLOW], {})
    assert len(said) == 1
    assert "±16 %" in said[0]
    assert "N1" in said[0]
    assert disagreements({"tbnn_ude": outcome("tbnn_ude", half_width=0.001)}, [FLOW], {}) == []
    assert disagreements({"tbnn_ude": outcome("tbnn_ude")}, [FLOW], {}) == []


def test_a_contested_quantity_is_not_determined():
    before = [Statement("N1", IN_LIBRARY, "It follows."), Statement("N2", IN_LIBRARY, "So too.")]
    after = open_where_contested(before, {"N1": "They disagree."})
    assert after[0].undetermined
    assert after[0].text == "They disagree. It follows."
    assert after[1] == before[1]


def test_a_missing_band_is_said():
    why = "the constants exchange each other, so they have no interval and no band"
    exchanged = outcome("tensor_sindy", details={"draws": {"method": "none", "reason": why}})
    (said,) = disagreements({"tensor_sindy": exchanged}, [FLOW], {})
    assert why in said
    runaway = band(np.nan, "40 % of the laws that fit run away in this flow")
    (said,) = disagreements({"tensor_sindy": outcome("tensor_sindy")}, [FLOW], runaway)
    assert "40 %" in said


def test_the_spread_of_members_survives_a_resume():
    kept = outcome("tbnn_ude", half_width=0.1)
    again = LearnerOutcome.from_state(kept.to_state())
    assert again.half_widths(FLOW) == kept.half_widths(FLOW)
    assert again.half_widths(FLOW)["N1"] == pytest.approx(0.1)
    np.testing.assert_array_equal(again.bands[FLOW.key]["N1"], kept.bands[FLOW.key]["N1"])
