"""Bands of learners are drawn, each with its name; the curves are written by hand."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from discover.comparison.judging.bands.dense_library import DENSE, NAMED_BESIDE
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from matplotlib.path import Path

from discover.comparison.comparison import Comparison
from discover.protocols import start_up
from discover.report.plots.comparison.flows import _condition, _draw_band
from discover.report.plots.cycles import shade_between

TIMES = np.arange(5.0)
FLOW = Flow("startup", "test", start_up(2.0), TIMES, np.full(5, 2.0), {})
EMPTY = (np.zeros(0), np.zeros(0))


@pytest.mark.parametrize(
    ("learner", "detail", "label"),
    [
        ("tensor_dense", None, "laws that fit σ₁₂, no claim beyond them"),
        (
            "tensor_dense",
            NAMED_BESIDE,
            "laws and named effects that fit σ₁₂, no claim beyond them",
        ),
        ("tbnn_ude", None, "networks that fit as well"),
    ],
)
def test_the_band_of_a_learner_is_shaded_under_its_name(learner, detail, label):
    bands = {FLOW.key: {"N1": (0.0 * TIMES, TIMES)}}
    details = {} if detail is None else {detail: [FLOW.key]}
    outcomes = {learner: LearnerOutcome(learner, (), 1.0, EMPTY, details, bands=bands)}
    comparison = Comparison("", "", "", [FLOW], {}, outcomes, None, None, (), ())
    drawing, panel = plt.subplots()
    _draw_band(panel, comparison, FLOW, "N1", TIMES >= 0)
    assert [shade.get_label() for shade in panel.collections] == [label]
    plt.close(drawing)


@pytest.mark.parametrize("drawn", [True, False])
def test_a_picture_says_what_the_dense_band_takes_for_granted_where_it_is_drawn(drawn):
    bands = {FLOW.key: {"N1": (0.0 * TIMES, TIMES)} if drawn else None}
    outcomes = {DENSE: LearnerOutcome(DENSE, (), 1.0, EMPTY, bands=bands)}
    comparison = Comparison("", "", "", [FLOW], {}, outcomes, None, None, (), ())
    said = _condition(comparison, FLOW)
    assert ("no claim about any other" in said) == drawn


def test_a_band_along_a_closed_curve_is_shaded_where_it_goes_and_nowhere_else():
    # x = sin t, y = cos t: a ring. A fill between its two edges as a whole shades the middle too.
    angle = np.linspace(0.0, 2.0 * np.pi * 1.02, 200)
    along, middle = np.sin(angle), np.cos(angle)
    drawing, panel = plt.subplots()
    shade_between(panel, along, middle - 0.1, middle + 0.1, alpha=0.2)
    (shade,) = panel.patches
    drawing.canvas.draw()
    shaded = np.zeros((40, 40), dtype=bool)
    grid = np.linspace(-0.95, 0.95, 40)
    path = shade.get_path()
    for piece in path.to_polygons(closed_only=True):
        for i, x in enumerate(grid):
            shaded[i] |= Path(piece).contains_points(np.stack([np.full(40, x), grid], axis=-1))
    edge = np.sqrt(1.0 - grid**2)[:, None]
    distance = np.minimum(np.abs(grid - edge), np.abs(grid + edge))
    assert np.all(shaded[distance < 0.09])
    assert not np.any(shaded[distance > 0.11])
    plt.close(drawing)
