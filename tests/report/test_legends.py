"""A legend stands inside its picture, in as few rows as the figure is wide for."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from discover.report.plots.style import figure, legend_above

SHORT = ["data", "sparse", "network", "dense"]
LONG = [
    "declared (known part alone)",
    "sparse regression",
    "dense library",
    "laws and named effects that fit σ$_{12}$, no claim beyond them",
    "left open by the data (95 %, with rivals)",
]


def drawn(labels):
    """The legend's extent and the figure's, in pixels, as matplotlib lays them out."""
    with figure(1, 3) as (drawing, axes):
        for label in labels:
            axes[0, 0].plot([0.0, 1.0], label=label)
        legend_above(drawing, axes)
        FigureCanvasAgg(drawing).draw()
        return drawing.legends[0].get_window_extent(), drawing.bbox


@pytest.mark.parametrize("labels", [SHORT, LONG])
def test_no_legend_is_cut_off(labels):
    legend, whole = drawn(labels)
    assert whole.x0 <= legend.x0 < legend.x1 <= whole.x1


def test_what_fits_stands_in_one_row_and_what_does_not_in_two():
    rows = [drawn(labels)[0].height for labels in (SHORT, LONG)]
    assert 1.5 * rows[0] < rows[1] < 4.0 * rows[0]
