"""What pictures of a report show: axes, legends, cycles, overlays."""

import os
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from independent import authors
from independent.homogeneous import UNIT
from matplotlib.backends.backend_agg import FigureCanvasAgg

from discover.comparison.flows import Flow
from discover.dataset import Dataset, Run
from discover.errors import InputError
from discover.laws import Fluid, make_law
from discover.loop import ErrorPair, LoopResult, RunRecord
from discover.protocols import measured_rate, oscillatory_shear, start_up
from discover.report.loop.report import write_loop
from discover.report.mathtext import formula
from discover.report.overlay import comparison_overlays, loop_overlays, read_overlays
from discover.report.plots.comparison.flows import last_cycle
from discover.report.plots.style import figure, legend_above, picture, runs_through_decades
from discover.report.predictions import loop_predictions
from discover.study import RunFolder, fingerprint, read_study

RATE, TIME = 2.0, np.linspace(0.2, 2.0, 10)
STRESS = np.ones(10)
RUN = Run("a.csv", TIME, start_up(RATE), np.full(10, RATE), STRESS)
# the loop left the last samples out
RECORD = RunRecord(
    "a.csv", False, TIME[:8], RATE * TIME[:8], TIME[:8], np.full(8, RATE), STRESS[:8],
    np.stack([0.9 * STRESS[:8]]), np.array([0.1]),
)  # fmt: skip
MODES = Fluid(make_law("ucm"), [3.0], [0.5])
CONSTANTS = {"k": 0.8, "n": 0.4}
LAW = '{ law = "white_metzner", parameters = { k = 0.8, n = 0.4 }, label = "of the book" }'
MINE = "run,time_s,quantity,value\na.csv,0.5,sigma12,1.0\na.csv,1.5,sigma12,3.0\n"


def study(tmp_path, overlay, mine=MINE):
    (tmp_path / "mine.csv").write_text(mine)
    file = tmp_path / "s.toml"
    file.write_text(f'[data]\nsynthetic = {{ law = "ucm" }}\n[report]\noverlay = [{overlay}]\n')
    return read_study(file)


def test_a_law_is_drawn_as_its_authors_have_it_in_the_modes_of_the_declared_model(tmp_path):
    wanted = authors.stress(authors.white_metzner, CONSTANTS, RATE * UNIT["shear"], TIME, 0.5)
    sources = read_overlays(study(tmp_path, LAW))
    (found,) = loop_overlays(sources, [RECORD], Dataset("d", (RUN,)), MODES)
    # what the fixed steps of a loop cost, 1e-6, with room
    np.testing.assert_allclose(found.of("a.csv", "sigma12"), 3.0 * wanted[:8, 0, 1], rtol=1e-4)
    flow = Flow("a.csv", "training", RUN.protocol, TIME, RUN.rate, {})
    (found,) = comparison_overlays(sources, [flow], MODES)
    n1 = 3.0 * (wanted[:, 0, 0] - wanted[:, 1, 1])
    np.testing.assert_allclose(found.curves[flow.key]["N1"], n1, rtol=1e-4)
    # negative control: modes of its own are another curve
    own = LAW.replace("label", "modulus_Pa = 6.0, relaxation_time_s = 0.5, label")
    (other,) = comparison_overlays(read_overlays(study(tmp_path, own)), [flow], MODES)
    np.testing.assert_allclose(other.curves[flow.key]["N1"], 2.0 * n1, rtol=1e-4)


def test_a_file_is_straight_between_its_points_and_says_nothing_beyond(tmp_path):
    sources = read_overlays(study(tmp_path, '{ file = "mine.csv" }'))
    (found,) = loop_overlays(sources, [RECORD], Dataset("d", (RUN,)), MODES)
    inside = (TIME[:8] >= 0.5) & (TIME[:8] <= 1.5)
    wanted = np.where(inside, 1.0 + 2.0 * (TIME[:8] - 0.5), np.nan)
    np.testing.assert_allclose(found.of("a.csv", "sigma12"), wanted)
    nothing = ErrorPair(0.0, None)
    result = LoopResult("no_effect_needed", nothing, nothing, 0.0, (), {}, (), (RECORD,))
    table = loop_predictions(result, (found,))
    assert set(table["source"]) == {"declared", "mine"}
    page = write_loop(result, RunFolder(tmp_path / "out", "x"), "name", "", overlays=(found,))
    text = page.read_text("utf-8")
    assert "overlay: mine" in text
    assert "without effects of the instrument" in text


def test_results_belong_to_the_same_study_until_an_overlay_changes(tmp_path):
    without = study(tmp_path, "")
    (tmp_path / "plain.toml").write_text('[data]\nsynthetic = { law = "ucm" }\n')
    assert fingerprint(without) == fingerprint(read_study(tmp_path / "plain.toml"))
    first = fingerprint(study(tmp_path, '{ file = "mine.csv" }'))
    assert first != fingerprint(without)
    assert first != fingerprint(study(tmp_path, '{ file = "mine.csv" }', MINE.replace("3.0", "4")))


@pytest.mark.parametrize(
    ("overlay", "mine", "words"),
    [
        ('{ law = "giesekus", mobility = 0.3 }', MINE, "unknown key"),
        ('{ law = "giesekus", file = "mine.csv" }', MINE, "either law"),
        ("{ label = 'mine' }", MINE, "either law"),
        ('{ law = "nobody" }', MINE, "unknown law"),
        ('{ law = "giesekus" }', MINE, "entry 1: The law 'giesekus' needs"),
        ('{ law = "ucm", modulus_Pa = [1.0, 2.0] }', MINE, "go together"),
        ('{ law = "ucm", label = "augmented" }', MINE, "names a curve of the report"),
        ('{ law = "ucm" }, { law = "ucm" }', MINE, "two entries with the label"),
        ('{ file = "none.csv" }', MINE, "none.csv"),
        ('{ file = "mine.csv" }', "run,time_s,value\na,1,1\n", "no column quantity"),
        ('{ file = "mine.csv" }', MINE + "a.csv,0.1,sigma12,1\n", "must increase"),
        (
            '{ file = "mine.csv" }',
            "run,time_s,quantity,value,source\na,1,sigma12,1,x\na,2,sigma12,1,y\n",
            "several sources",
        ),
        ('{ file = "mine.csv" }', MINE.replace("a.csv", "b.csv"), "No run of the overlay 'mine'"),
    ],
)
def test_what_is_no_overlay_is_refused_in_one_sentence(tmp_path, overlay, mine, words):
    def drawn():
        sources = read_overlays(study(tmp_path, overlay, mine))
        loop_overlays(sources, [RECORD], Dataset("d", (RUN,)), MODES)

    with pytest.raises(InputError, match=words):
        drawn()


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
    with figure(1, 1) as (drawing, axes):
        axes[0, 0].plot([1, 2, 3], label="a")
        axes[0, 0].legend()
        svg = picture(drawing, "a", "b").svg
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
def calm(tmp_path_factory):
    return drawn_in(tmp_path_factory.mktemp("calm"))


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


@pytest.mark.parametrize("measured", [True, False])
def test_the_last_cycle_is_one_period_long(measured):
    rate = 2.0 * np.cos(1.5 * TIMES)
    noisy = rate + 0.02 * np.random.default_rng(0).standard_normal(TIMES.size)
    flow = measured_rate(TIMES, noisy) if measured else oscillatory_shear(2.0, 1.5)
    seen = noisy if measured else rate
    last = last_cycle(Flow("a", "held_out", flow, TIMES, seen, {}, oscillatory=True))
    period = 2.0 * np.pi / 1.5
    assert np.ptp(TIMES[last]) == pytest.approx(1.02 * period, rel=0.03)
    assert last[-1]


def test_a_rate_that_does_not_oscillate_is_shown_whole():
    rate = np.full(TIMES.size, 2.0)
    flow = Flow("a", "held_out", measured_rate(TIMES, rate), TIMES, rate, {}, oscillatory=True)
    assert np.all(last_cycle(flow))


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
    with figure(1, 3) as (drawing, axes):
        for label in labels:
            axes[0, 0].plot([0.0, 1.0], label=label)
        legend_above(drawing, axes)
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


def test_a_step_whose_measured_rate_rises_is_drawn_through_decades_as_a_start_up_is():
    assert runs_through_decades(DECADES, np.full(65, 10.0))
    assert runs_through_decades(DECADES, 10.0 * (1.0 - np.exp(-DECADES / 2e-3)))


def test_even_samples_of_a_rate_that_changes_are_drawn_in_plain_time():
    even = np.linspace(0.0, 60.0, 601)
    assert not runs_through_decades(even, np.cos(even))
    assert not runs_through_decades(even, 10.0 * (1.0 - np.exp(-even)))
    # and so is what lasts no decade and a half
    assert not runs_through_decades(np.geomspace(1.0, 20.0, 50), np.full(50, 1.0))
