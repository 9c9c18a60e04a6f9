"""``[report] overlay``: a literature law, or the user's own model, beside the other curves."""

import numpy as np
import pytest
from independent import authors
from independent.homogeneous import UNIT

from discover.comparison.flows import Flow
from discover.dataset import Dataset, Run
from discover.errors import InputError
from discover.laws import Fluid, make_law
from discover.loop import ErrorPair, LoopResult, RunRecord
from discover.protocols import start_up
from discover.report.loop.report import write_loop
from discover.report.overlay import comparison_overlays, loop_overlays, read_overlays
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
