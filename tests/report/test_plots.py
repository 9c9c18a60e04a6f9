"""What pictures of a report show: axes, legends, cycles."""

import os
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from discover.report.mathtext import formula
from discover.report.plots import style


@pytest.fixture(autouse=True, scope="module")
def panels():
    """Place panels as users see them."""


DRAW = """
from discover.report.plots import keep_out_of_the_working_directory
keep_out_of_the_working_directory()
from discover.report.mathtext import formula
from discover.report.plots.style import figure, picture
with figure(1, 1) as (drawing, axes):
    axes[0, 0].plot([1, 2, 3], label="a")
    axes[0, 0].legend()
    print(picture(drawing, "a", "b").svg)
print(formula(r"\\lambda\\dot\\gamma", "f"))
"""
LOUD = "lines.linewidth: 13\naxes.facecolor: red\nfont.size: 30\ntext.usetex: True\n"


def drawn():
    with style.figure(1, 1) as (drawing, axes):
        axes[0, 0].plot([1, 2, 3], label="a")
        axes[0, 0].legend()
        svg = style.picture(drawing, "a", "b").svg
    return svg, formula(r"\lambda\dot\gamma", "f")


def test_what_a_session_asked_matplotlib_for_is_not_on_a_page_and_stays_as_it_was():
    calm = drawn()
    asked = {"lines.linewidth": 13.0, "font.size": 30.0, "xtick.major.size": 20.0}
    with mpl.rc_context(asked):
        assert drawn() == calm
        assert {name: mpl.rcParams[name] for name in asked} == asked


def drawn_in(folder):
    command = [sys.executable, "-P", "-c", DRAW]
    done = subprocess.run(command, cwd=folder, capture_output=True, timeout=60, check=True)
    return done.stdout


@pytest.fixture(scope="module")
def calm():
    return "".join(f"{part}\n" for part in drawn()).encode()


# no such file is read, whatever is in it: that of a pipe would never end
@pytest.mark.parametrize(
    "kind", ["pipe", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("loud", "broken"))]
)
def test_a_matplotlibrc_in_the_working_directory_changes_no_picture(tmp_path, calm, kind):
    file = tmp_path / "matplotlibrc"
    if kind == "pipe":
        os.mkfifo(file)
    else:
        file.write_bytes(LOUD.encode() if kind == "loud" else b"font.size: \xff\xfe\n")
    assert len(calm) > 1000
    assert drawn_in(tmp_path) == calm


TIMES = np.linspace(0.0, 31.4, 1001)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_last_cycle_is_one_period_long(noise):
    rate = 2.0 * np.cos(1.5 * TIMES) + noise * np.random.default_rng(0).standard_normal(TIMES.size)
    last = style.last_cycle(TIMES, rate)
    period = 2.0 * np.pi / 1.5
    assert np.ptp(TIMES[last]) == pytest.approx(1.02 * period, rel=0.03)
    assert last[-1]


def test_a_start_up_and_noisy_steps_have_no_cycle():
    assert style.last_cycle(TIMES, np.full(TIMES.size, 2.0)) is None
    assert style.last_cycle(TIMES, np.random.default_rng(0).standard_normal(TIMES.size)) is None


SHORT = ["data", "sparse", "network", "dense"]
LONG = [
    "declared (known part alone)",
    "sparse regression",
    "dense library",
    "laws and named effects that fit σ$_{12}$, no claim beyond them",
    "left open by the data (95 %, with rivals)",
]


def drawn_legend(labels):
    """The legend's extent and the figure's, in pixels, as matplotlib lays them out."""
    with style.figure(1, 3) as (drawing, axes):
        for label in labels:
            axes[0, 0].plot([0.0, 1.0], label=label)
        style.legend_above(drawing, axes)
        FigureCanvasAgg(drawing).draw()
        return drawing.legends[0].get_window_extent(), drawing.bbox


@pytest.mark.parametrize("labels", [SHORT, LONG])
def test_no_legend_is_cut_off(labels):
    legend, whole = drawn_legend(labels)
    assert whole.x0 <= legend.x0 < legend.x1 <= whole.x1


def test_what_fits_stands_in_one_row_and_what_does_not_in_two():
    rows = [drawn_legend(labels)[0].height for labels in (SHORT, LONG)]
    assert 1.5 * rows[0] < rows[1] < 4.0 * rows[0]


DECADES = np.geomspace(1e-3, 60.0, 65)


def test_steps_whose_rate_rises_are_drawn_through_decades_as_start_ups_and_even_samples_in_time():
    assert style.runs_through_decades(DECADES, np.full(65, 10.0))
    assert style.runs_through_decades(DECADES, 10.0 * (1.0 - np.exp(-DECADES / 2e-3)))
    even = np.linspace(0.0, 60.0, 601)
    assert not style.runs_through_decades(even, np.cos(even))
    assert not style.runs_through_decades(even, 10.0 * (1.0 - np.exp(-even)))
    # and so is what lasts no decade and a half
    assert not style.runs_through_decades(np.geomspace(1.0, 20.0, 50), np.full(50, 1.0))
