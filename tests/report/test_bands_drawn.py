"""Bands of learners are drawn, each with its name; the curves are written by hand."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from discover.comparison.comparison import Comparison
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.protocols import start_up
from discover.report.plots.comparison.flows import _draw_band

TIMES = np.arange(5.0)
FLOW = Flow("startup", "test", start_up(2.0), TIMES, np.full(5, 2.0), {})
EMPTY = (np.zeros(0), np.zeros(0))


@pytest.mark.parametrize(
    ("learner", "label"),
    [
        ("tensor_dense", "95 % of the dense library's laws"),
        ("tbnn_ude", "networks that fit as well"),
    ],
)
def test_the_band_of_a_learner_is_shaded_under_its_name(learner, label):
    bands = {FLOW.key: {"N1": (0.0 * TIMES, TIMES)}}
    outcomes = {learner: LearnerOutcome(learner, (), 1.0, EMPTY, bands=bands)}
    comparison = Comparison("", "", "", [FLOW], {}, outcomes, None, None, (), ())
    drawing, panel = plt.subplots()
    _draw_band(panel, comparison, FLOW, "N1", TIMES >= 0)
    assert [shade.get_label() for shade in panel.collections] == [label]
    plt.close(drawing)
