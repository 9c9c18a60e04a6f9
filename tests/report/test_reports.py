"""What a comparison says: its JSON, and the report, which stands alone and escapes names."""

import html
import json
import re
import runpy
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from fewer_hypotheses import few_candidates
from standing_alone import SCRIPT, stands_alone

from discover.comparison import compare
from discover.comparison.flows import FlowBand
from discover.laws import Fluid, make_law
from discover.learners import LearnerResult, RecoveredTerm
from discover.report.comparison.report import write_comparison
from discover.report.comparison.tables import error_rows, learner_lines
from discover.report.page import safe_name
from discover.report.plots import comparison as plots
from discover.report.plots.style import SPARSE, style_sheet
from discover.report.wording import percent
from discover.study import RunFolder, parse_study


def trained(learner, study, model, runs, seed=0, progress=None):
    law = make_law("giesekus", {"alpha": 0.2})
    known = {"coefficient_penalised": 0.19, "latex": r"\sigma\cdot\sigma"}
    term = RecoveredTerm("sigma.sigma", 0.2, ci95=(0.199, 0.201), **known)
    message = "ended <b>well</b>"
    details = {"bad": float("nan")}
    return LearnerResult(learner, law, (term,), 1.0, details, message), Fluid.dimensionless(law)


@pytest.fixture(scope="module")
def comparison():
    study = parse_study(
        {
            "data": {"synthetic": {"law": "giesekus", "parameters": {"alpha": 0.2}, "samples": 21}},
            "compare": {"high_deborah": [1.5], "library": {"degree": 0}},
        }
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("discover.comparison.learning.train", trained)
        few_candidates(patch, ("giesekus_mobility", "ptt_linear", "stress_gain"))
        return replace(compare(study), name="<script>alert(1)</script>")


@pytest.fixture(scope="module")
def folder(comparison, tmp_path_factory):
    written = RunFolder(tmp_path_factory.mktemp("report"), "x")
    write_comparison(comparison, written, True, "[data] # <img src=x>")
    return written.path


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text("utf-8")


def test_json_is_the_contract(comparison):
    content = json.loads(json.dumps(comparison.to_json(), allow_nan=False))
    assert set(content["learners"]) == {"tensor_sindy", "tbnn_ude"}
    learner = content["learners"]["tensor_sindy"]
    assert {"terms", "errors", "train_seconds"} <= set(learner)
    assert set(learner["errors"]) == {"laos_3_1.5", "laos_2_1", "startup_2"}
    assert set(learner["errors"]["laos_2_1"]) == {"sigma12", "N1", "N2"}
    term = learner["terms"][0]
    assert term["term"] == "sigma.sigma"
    # the learner's term, fitted again as a hypothesis; these data have no noise
    low, high = term["ci95"]
    assert low <= 0.2 <= high
    assert high - low < 1e-3
    assert term["coefficient_penalised"] == 0.19
    assert {"discrepancy", "adequate", "use", "posterior"} <= set(content)
    assert content["use"]["law"] == "giesekus"
    assert content["adequate"] is True
    assert learner["intervals_hold"] == "if_the_law_is_in_the_library"
    assert learner["probability"] > 0.5
    assert "N2" in content["undetermined"]
    assert content["verdict"] == "explained"
    assert set(content["lack_of_fit"]) == set(content["learners"])
    said = {s["quantity"]: s["determined"] for s in content["statements"]}
    assert set(said.values()) <= {"no", "if_the_law_is_in_the_library"}
    assert content["undetermined"] == [q for q, value in said.items() if value == "no"]
    assert content["rivals"]
    for rival in content["rivals"]:
        assert {"terms", "errors_to_chosen", "separated_by"} <= set(rival)


def test_the_page_stands_alone_with_unique_identifiers_and_one_that_needs_the_network_is_told(page):
    identifiers = re.findall(r'\bid="([^"]+)"', page)
    assert len(identifiers) == len(set(identifiers))
    references = re.findall(r"url\(#([^)]+)\)", page) + re.findall(r'href="#([^"]+)"', page)
    assert set(references) <= set(identifiers)
    assert stands_alone(page)
    assert "&lt;script&gt;alert(1)" in page
    assert "&lt;img src=x&gt;" in page
    assert "<b>well</b>" not in page
    # negative control of the check
    assert not stands_alone('<img src="https://example.org/a.png">')
    assert not stands_alone("<script>1</script>")
    assert stands_alone(f"<script>{SCRIPT}</script>")
    assert not stands_alone(f"<script>{SCRIPT} fetch('https://example.org')</script>")


def test_the_page_has_pictures_tables_and_the_run_that_made_it_once_at_its_foot(page):
    names = ("flow_laos_3_1.5", "flow_laos_2_1", "flow_startup_2", "high_deborah")
    for name in (*names, "pipkin_error", "training"):
        assert f'<figure id="{name}">' in page
    for text in ("penalised", "debiased", "95 % interval", "σ₁₂", "N₂", "not determined"):
        assert text in page
    assert "prefers-color-scheme: dark" in page
    assert page.count("a hash of the study") == 1
    assert "Made by" not in page
    made = page[page.index('<h2 id="made"') :]
    assert "discover compare" in made
    assert "jax " in made


def test_every_picture_is_well_formed_named_in_every_curve_and_has_a_text_alternative(folder, page):
    pictures = {file.stem: file.read_text("utf-8") for file in (folder / "figures").glob("*.svg")}
    assert len(pictures) >= 6
    for svg in pictures.values():
        ElementTree.fromstring(svg.split("?>", 1)[1].split(">", 1)[1])
    assert "<figcaption></figcaption>" not in page
    for name in ("flow_laos_3_1.5", "flow_laos_2_1", "flow_startup_2"):
        for label in ("truth", "before", "sparse regression", "neural network", "N₁", "σ₁₂"):
            assert label in pictures[name]
    for label in ("elastic Lissajous curve", "viscous Lissajous curve", "strain γ"):
        assert label in pictures["flow_laos_3_1.5"]
    assert "<svg" in page
    assert without_text(page) == []
    assert without_text('<svg role="img" aria-label="">') != []  # negative control


def test_a_picture_is_the_same_bytes_every_time_and_follows_light_and_dark(comparison):
    first, second = (
        plots.flow_picture(comparison, comparison.unseen_flows[0]).svg for _ in range(2)
    )
    assert first == second
    drawn = plots.training_picture(comparison)
    text = drawn.adaptive
    ElementTree.fromstring(text.split("?>", 1)[1].split(">", 1)[1])
    assert "prefers-color-scheme: dark" in text
    assert "var(--sparse)" in text
    assert SPARSE not in text.replace(style_sheet(), "")
    assert SPARSE in drawn.svg  # for programs that know no variables


def test_a_curve_that_ran_away_is_left_out(comparison):
    flow = comparison.unseen_flows[0]
    outcome = comparison.outcomes["tbnn_ude"]
    lost = replace(outcome, predictions={**outcome.predictions, flow.key: None})
    without = replace(comparison, outcomes={**comparison.outcomes, "tbnn_ude": lost})
    labels = [label for label, _, _ in plots.curves(without, flow)]
    assert "neural network" not in labels
    assert "sparse regression" in labels
    assert "neural network" not in plots.flow_picture(without, flow).svg
    everywhere = dict.fromkeys(outcome.predictions)
    none = replace(outcome, predictions=everywhere)
    without = replace(comparison, outcomes={**comparison.outcomes, "tbnn_ude": none})
    assert texts_of(plots.error_map_picture(without).svg).count("–") == 3 * 16


def test_what_each_learner_found_is_a_line_of_whole_sentences(comparison):
    for one in (comparison, replace(comparison, truth=()), replace(comparison, truth=None)):
        lines = learner_lines(one)
        assert [line.split(" ")[0] for line in lines] == ["Sparse", "The"]
        assert "σ·σ" in lines[0]
        for line in lines:
            assert line.endswith(".")
            for sentence in line[:-1].split(". "):
                assert sentence[0].isupper() or sentence[0] in "σγ", line
                assert sentence.count(";") <= 3, sentence  # one that nobody reads to its end


def texts_of(svg):
    return [html.unescape(text) for text in re.findall(r"<text[^>]*>([^<]*)</text>", svg)]


def test_the_pipkin_map_of_error_holds_the_errors_of_the_result(comparison):
    drawn = plots.error_map_picture(comparison)
    shown = texts_of(drawn.svg)
    before = comparison.error_map("before")
    assert len(before) == 16
    for errors in before.values():
        for value in errors.values():
            assert percent(value).removesuffix(" %") in shown
    # in the linear corner the known part is nearly enough, and it fails where the flow is strong
    assert before[0.5, 2.0]["sigma12"] < 0.02
    assert before[4.0, 0.25]["sigma12"] > 1.0
    assert max(comparison.error_map("tensor_sindy")[4.0, 0.25].values()) < 1e-5
    kept = comparison.to_json()["pipkin"]["before"]
    assert {(row["Wi"], row["De"]): row["N1"] for row in kept} == {
        place: errors["N1"] for place, errors in before.items()
    }


def without_text(page):
    """Pictures of a page that say nothing to those who do not see them."""
    pictures = re.findall(r"<(?:svg|img)\b[^>]*>", page)
    return [p for p in pictures if not re.search(r'(?:aria-label|alt)="[^"]+"', p)]


def test_errors_of_the_sparse_law_have_the_band_of_its_parameters(comparison, page):
    table = page[page.index('<table id="error-table"') :]
    table = table[: table.index("</table>")]
    # three flows, one learner; σ12 and N1, for N2 is not determined
    assert [s.quantity for s in comparison.statements if s.undetermined] == ["N2"]
    assert table.count("± ") == 6
    flow = comparison.unseen_flows[0]
    one = np.ones(flow.times.size)
    middle, low, high = (
        dict.fromkeys(("sigma12", "N1", "N2"), factor * one) for factor in (1.0, 0.9, 1.1)
    )
    banded = replace(comparison, bands={flow.key: FlowBand(middle, low, high)})
    widths = [cell["half_width"] for cell in error_rows(banded)[0]["cells"]]
    assert widths[:3] == widths[6:] == [None] * 3  # before, and one network
    assert widths[3:5] == pytest.approx([0.1] * 2)
    assert widths[5] is None  # N2 is not determined


def test_the_readme_s_script_draws_what_is_said_and_strain_integrates_the_rate(comparison):
    script = Path(__file__).parents[2] / "docs" / "picture.py"
    drawn = runpy.run_path(str(script))["draw"](comparison)
    assert drawn.name == "lissajous"
    assert {"truth", "sparse regression", "neural network"} <= set(texts_of(drawn.svg))
    flow = next(f for f in comparison.flows_of("training") if f.name == "laos_2_0.5")
    wanted = 2.0 / 0.5 * np.sin(0.5 * flow.times)
    np.testing.assert_allclose(flow.strain, wanted, atol=2e-2)  # 21 samples


def test_an_ellipse_has_no_third_harmonic_and_file_names_stay_in_the_folder():
    phase = np.linspace(0.0, 2.0 * np.pi, 121)
    assert plots.third_harmonic(np.cos(phase + 0.3)) < 1e-12
    assert plots.third_harmonic(np.cos(phase) + 0.1 * np.cos(3 * phase)) == pytest.approx(0.1)
    assert "/" not in safe_name("../../etc/passwd")
    assert safe_name("flow_laos_3_1.5") == "flow_laos_3_1.5"


def test_a_comparison_shows_itself_as_tables(comparison):
    terms, errors = comparison.terms_table(), comparison.errors_table()
    # to what the integration promises
    assert terms.loc["sigma.sigma"].tolist() == pytest.approx([0.2] * len(terms.columns), rel=1e-4)
    flow = comparison.unseen_flows[0].name
    wanted = comparison.errors("before", comparison.unseen_flows[0])["N1"]
    assert errors.loc[(flow, "N1"), "before"] == wanted
    assert errors.loc[(flow, "N1"), "tensor_sindy"] < wanted
    shown = comparison._repr_html_()
    assert "<table" in shown
    for statement in comparison.statements:
        assert statement.quantity in shown
    rivals = comparison.rivals_table()
    assert len(rivals) == len(comparison.rivals)
    assert set(rivals.columns) >= {"law", "told_by"} or not len(rivals)


@pytest.mark.slow
def test_reports_leave_a_notebook_its_pictures():
    """Reports once changed matplotlib's backend, and a notebook showed no picture from then on."""
    code = "import matplotlib; matplotlib.use('agg'); import discover.report.comparison.report; "
    code += "import discover.report.loop, discover.report.mathtext as m, sys; "
    code += "assert '<svg' in m.formula('x^2', 'a'); print(matplotlib.get_backend()); "
    code += "print('matplotlib.pyplot' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["agg", "False"]


def test_a_picture_says_which_quantity_is_not_determined(comparison):
    assert comparison.undetermined == ["N2"]
    (flow, *_) = (f for f in comparison.flows if f.kind == "test" and f.oscillatory)
    said = "not determined by these data"
    drawn = plots.flow_picture(comparison, flow)
    assert texts_of(drawn.svg).count(said) == 1
    assert comparison.placement(flow).text in drawn.caption
    assert f"{flow.title}, beyond range" in texts_of(drawn.svg)
    decided = replace(comparison, statements=())
    assert said not in texts_of(plots.flow_picture(decided, flow).svg)
