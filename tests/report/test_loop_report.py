"""The report of a closed loop: what it contains, its verdict, that it stands alone."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from standing_alone import stands_alone

from discover.effects import make_effect
from discover.loop import CandidateScore, ErrorPair, FreeForm, LoopResult, RunRecord, Stage
from discover.loop.parts import (
    ConstantByMode,
    Explanation,
    Explanations,
    Fold,
    ModeConstant,
    StageParameter,
)
from discover.report.loop import loop_verdict, noise_range, remaining_rows, write_loop
from discover.report.page import render
from discover.report.plots.loop.residual import (
    residual_picture,
    waterfall_picture,
)
from discover.report.plots.loop.runs import lissajous_picture, runs_picture
from discover.study import RunFolder


def loop_result(held_out=0.2):
    time = np.geomspace(0.01, 10.0, 40)
    rate = np.ones(40)
    records = []
    for name, held in ((r"a<b>$\frac$.csv", False), ("c.csv", True)):
        measured = 1.0 - np.exp(-time)
        predicted = np.stack([1.4 * measured, 1.01 * measured])
        errors = np.array([0.4, 0.01])
        records.append(RunRecord(name, held, time, time, time, rate, measured, predicted, errors))
    stage = Stage(
        "stress_gain",
        "signal",
        {"gain": StageParameter(0.7, (0.69, 0.71), "")},
        ("rate_gain",),
        ErrorPair(0.01, held_out),
        50.0,
        r"\sigma \mathrel{+}= g\,\sigma",
        "a source",
        "a check",
    )
    candidate = CandidateScore("stress_gain", "signal", score=0.9, evidence=50.0, error=0.01)
    return LoopResult(
        "effects_added", ErrorPair(0.4, 0.4), ErrorPair(0.01, held_out), 0.005, (stage,),
        {"structured": False, "runs": ["a"]}, ((candidate,), (candidate,)), tuple(records),
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a report with all its pictures."""
    folder = tmp_path_factory.mktemp("loop")
    write_loop(loop_result(), RunFolder(folder, "x"), "<i>name", "data", "")
    return folder


def test_the_loop_report_holds_data_residual_ranking_and_errors(written):
    page = (written / "report.html").read_text("utf-8")
    assert stands_alone(page)
    assert "<i>name" not in page
    assert r"a&lt;b&gt;$\frac$.csv" in page
    names = ("waterfall", "runs", "residual")
    for name in names:
        assert f'<figure id="{name}">' in page
        assert (written / "figures" / f"{name}.svg").is_file()
    for text in (
        "do not distinguish it from",
        "rate gain",
        "<code>stress_gain</code>",
        "held-out runs",
        "0.69 to 0.71",
    ):
        assert text in page
    assert (written / "loop.json").is_file()
    assert r"\begin{equation}" in (written / "equations.tex").read_text()


def test_a_loop_without_held_out_runs_or_effects_still_reports(tmp_path, no_pictures):
    result = replace(
        loop_result(), stages=(), error_before=ErrorPair(0.01, None),
        error_after=ErrorPair(0.01, None), verdict="no_effect_needed", rankings=(),
    )  # fmt: skip
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    assert "nothing is missing" in page
    assert "with the added effects" not in page


def test_the_loop_report_shows_runs_held_out_in_turn_and_constants_with_units(
    tmp_path, no_pictures
):
    result = replace(
        loop_result(),
        folds=(Fold("only.csv", "unexplained", ("tr(sigma)*sigma",), 0.7, 0.123),),
        declared_parameters={"modulus_Pa": StageParameter(41.5, (41.0, 42.0), "Pa")},
    )
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    for text in ("runs left out in turn", "only.csv", "12 %", "tr(σ) σ"):
        assert text in page
    declared = page[page.index('<table id="declared"') :]
    row = declared[: declared.index("</table>")]
    assert all(text in row for text in ("modulus_Pa", "41.5", "41 to 42", ">Pa<"))
    contents = json.loads((tmp_path / "loop.json").read_text())
    assert contents["folds"][0]["effects"] == ["tr(sigma)*sigma"]
    assert contents["declared_parameters"]["modulus_Pa"]["unit"] == "Pa"


def test_the_page_says_which_modes_the_data_leave_open(tmp_path, no_pictures):
    modes = (ModeConstant(5.0, 0.1, (0.08, 0.12), False), ModeConstant(0.05, 0.6, None, True))
    found = ConstantByMode(0.15, (0.14, 0.16), "", 2.0, 3, (0.0, 12.3), modes)
    stage = Stage(
        "giesekus_mobility", "constitutive", {"alpha": found}, (), ErrorPair(0.01, 0.2), 50.0,
        "", "a source", "a check",
    )  # fmt: skip
    result = replace(loop_result(), stages=(stage,), verdict="unexplained")
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    table = page[page.index('<table id="by-mode-1"') :]
    rows = table[: table.index("</table>")].split("<tr>")[2:]
    assert "0.08 to 0.12" in rows[0]
    assert "not determined" not in rows[0]
    assert "not determined" in rows[1]
    assert "α (varies from mode to mode) at λ = 2 s" in page
    caption = page[page.index('<figure id="by_mode">') :]
    assert "(evidence over one constant: 12)" in caption
    assert "these values come nearest" in caption
    (written,) = json.loads((tmp_path / "loop.json").read_text())["stages"]
    assert written["parameters"]["alpha"]["modes"][1]["ci95"] is None


def test_a_loop_shows_itself_as_tables():
    result = loop_result()
    line = result.to_dataframe().iloc[0]
    assert (line["effect"], line["value"], line["low"], line["high"]) == (
        "stress_gain", 0.7, 0.69, 0.71,
    )  # fmt: skip
    assert result.errors_table().loc["after", "fit"] == result.error_after.fit
    assert "stress_gain" in result._repr_html_()
    assert result._repr_html_().startswith(f"<p>{result.answer.headline}</p>")


def test_every_verdict_is_whole_sentences():
    aliased = loop_result()
    verdicts = []
    for verdict in ("effects_added", "unexplained", "no_effect_needed"):
        for stages in (aliased.stages, ()):
            verdicts.append(loop_verdict(replace(aliased, verdict=verdict, stages=stages)))
    for sentences in verdicts:
        assert sentences[0]
        for answer in filter(None, sentences):
            assert answer.endswith(".")
            for sentence in answer[:-1].split(". "):
                assert sentence[0].isupper(), answer
                assert sentence.count(";") <= 3, sentence
    assert "To distinguish stress gain from rate gain, a check." in aliased.answer.next_test
    unaliased = replace(aliased.stages[0], aliases=())
    confirm = replace(aliased, stages=(unaliased,)).answer.next_test
    assert confirm == "To confirm stress gain, a check."


def test_what_passes_for_slow_noise_is_said_to_look_like_a_slow_effect():
    slow = {**loop_result().remaining, "autocorrelation": 0.9}
    told = "lag-1 correlation 0.9); it is taken for noise, but a slowly varying effect would look"
    assert told in loop_verdict(replace(loop_result(), remaining=slow))[1]
    # not of white noise, and not where the verdict is that something is missing
    white = {**slow, "autocorrelation": 0.05}
    assert "slowly" not in loop_verdict(replace(loop_result(), remaining=white))[1]
    missing = replace(loop_result(), verdict="unexplained", remaining=slow)
    assert "slowly" not in loop_verdict(missing)[1]


def said_of(probability, **inclusion):
    gain = Explanation(("stress_gain",), probability, ErrorPair(0.01, 0.2), {})
    told = Explanations((gain,), 1.0 - probability, inclusion)
    result = replace(loop_result(), explanations=told)
    return " ".join([*loop_verdict(result), *result.answer.lines])


def test_what_is_less_probable_than_not_is_not_said_to_explain_the_data():
    text = said_of(0.44, stress_gain=0.44)
    assert text.startswith("Your model is missing an effect, but the data do not identify it.")
    assert "Probability of this law 44 %." in text
    assert "Probability that no candidate is right: 56 %." in text
    assert "fitted to the noise" not in text
    sure = said_of(0.89, stress_gain=0.89)
    assert "with it the data are fitted to the noise." in sure
    assert "Probability" not in said_of(0.99, stress_gain=0.99)
    # in all that fits alike, of which no set has half
    assert "with it the data are fitted to the noise." in said_of(0.44, stress_gain=0.86)


def test_where_no_law_is_given_no_model_and_no_band_is_drawn():
    result = loop_result()
    banded = tuple(replace(r, band=np.stack([r.measured, r.measured])) for r in result.records)
    law = replace(result, records=banded)
    for verdict, drawn in (("effects_added", True), ("no_signal", False)):
        picture = runs_picture(replace(law, verdict=verdict))
        for said in ("starting model", "95 % prediction band", "1 %"):
            assert (said in picture.svg) is drawn
        assert ("predicted" in picture.caption) is drawn


def test_a_page_without_a_signal_has_no_section_on_laws(tmp_path, no_pictures):
    for verdict, told in (("effects_added", True), ("no_signal", False)):
        result = replace(loop_result(), verdict=verdict)
        page = write_loop(result, RunFolder(tmp_path, "x", True), "n", "d").read_text("utf-8")
        for section in ("before-after", "explanations", "effects", "ranking-table", "remaining"):
            assert (f'href="#{section}"' in page) is told
            assert (f'<h2 id="{section}"' in page) is told
        assert '<h2 id="run-table"' in page


def test_a_function_that_is_in_the_answer_is_told_beside_its_law():
    curve = np.zeros(2)
    found = FreeForm(
        "recorded_stress", "stress", "Pa", ("ptt_exponential",), curve, curve, curve, curve,
        "clipped", {"ptt_exponential": {"epsilon": (0.364, 0.346, 0.381)}}, in_answer=True,
    )  # fmt: skip
    unexplained = replace(loop_result(), verdict="unexplained", free_form=(found,))
    assert loop_verdict(unexplained)[0] == (
        "Exponential PTT with a record that is a function of the stress alone (close to the "
        "clipped form) leaves noise; that function has no name here."
    )
    # one beside which other laws are as likely leaves no noise for sure
    other = replace(unexplained, free_form=(replace(found, in_answer=False, nearest=None),))
    said = loop_verdict(other)[0]
    assert "(ε = 0.364, 95 % CI 0.346 to 0.381) with a record" in said
    assert "(close to no known form) explains the residual" in said


def test_the_verdict_of_an_unexplained_loop_begins_with_that_and_calls_nothing_added():
    unexplained = replace(loop_result(), verdict="unexplained")
    text = loop_verdict(unexplained)[0]
    assert text == "A systematic residual remains that no candidate explains."
    assert "dded" not in text


def test_where_nothing_was_added_the_verdict_names_the_hardest_test():
    clean = replace(
        loop_result(), verdict="no_effect_needed", stages=(), error_before=ErrorPair(0.01, 0.012),
        error_after=ErrorPair(0.01, 0.012), remaining={"linear_error": 0.02},
    )  # fmt: skip
    found, sure = loop_verdict(clean)
    assert "nothing is missing" in found
    assert sure == ""
    assert "it tests the model hardest" in clean.answer.next_test


def test_many_aliases_are_counted_and_not_recited():
    aliases = ("rate_gain", "sigma", "stress_drift", "edge_fracture", "I")
    stage = replace(loop_result().stages[0], aliases=aliases)
    following = replace(loop_result(), stages=(stage,)).answer.next_test
    assert "2 more" in following
    assert "torque loss" not in following


def test_errors_stand_with_their_range_over_the_runs_and_every_run_is_listed(tmp_path, no_pictures):
    result = loop_result()
    fitted = result.records[0]
    worse = replace(fitted, name="worse.csv", errors=np.array([0.6, 0.03]))
    result = replace(result, records=(*result.records, worse))
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    assert "<td>1 % (1 to 3 %)</td><td>20 %</td>" in page  # one held-out run has no range
    runs = page[page.index('<h2 id="run-table"') : page.index('<h2 id="ranking-table"')]
    assert runs.count("<tr><td>") == 3
    assert '<td class="text">test</td>' in runs


def oscillating(name="wave.csv", held_out=False):
    time = np.linspace(0.0, 20.0, 401)
    rate = 2.0 * np.cos(time)
    measured = np.sin(time + 0.5)
    predicted = np.stack([1.3 * measured, measured])
    errors = np.array([0.3, 0.0])
    strain = 2.0 * np.sin(time)
    return RunRecord(name, held_out, time, strain, time, rate, measured, predicted, errors)


def test_oscillations_are_drawn_against_strain_and_rate_and_start_ups_are_not():
    waves = replace(loop_result(), records=(oscillating(), oscillating("held.csv", True)))
    drawn = lissajous_picture(waves)
    assert drawn is not None
    for text in ("elastic: σ₁₂ (Pa)", "viscous: σ₁₂ (Pa)", "strain γ", "γ̇ (1/s)", "held", "30 %"):
        assert text in drawn.svg
    assert lissajous_picture(loop_result()) is None


def test_lissajous_curves_hold_the_samples_of_every_cycle():
    drawn = lissajous_picture(replace(loop_result(), records=(oscillating(),)))
    assert "measured, all cycles" in drawn.svg
    marks = drawn.svg.split("measured, all cycles")[0].count("<use ")
    assert marks > 2 * oscillating().time.size  # each sample in both panels


def test_the_page_carries_the_data_of_its_pictures(written):
    page = (written / "report.html").read_text("utf-8")
    for name in ("predictions.csv", "loop.json"):
        (inside,) = re.findall(rf'data-name="{name}">([^<]*)</script>', page)
        assert json.loads(inside) == (written / name).read_text("utf-8")
        assert page.count(f'<a class="data" href="{name}" download>') == page.count("<figure id=")


def test_data_too_long_for_a_page_lie_beside_it():
    page = render("base.html", data={"short.csv": "1", "long.csv": "1" * 4_000_000})
    assert 'data-name="short.csv"' in page
    assert 'data-name="long.csv"' not in page


def without_stages():
    """A loop that added nothing: one prediction and one error a run."""
    found = loop_result()
    records = tuple(
        replace(r, predicted=r.predicted[:1], errors=r.errors[:1]) for r in found.records
    )
    return replace(found, stages=(), records=records, error_after=found.error_before)


def test_the_residual_has_no_row_that_says_nothing():
    left = {"structured": False, "outliers": 0, "without_fluid": False}
    rows = dict(remaining_rows(replace(loop_result(), remaining=left)))
    assert rows == {"systematic residual": "no"}
    told = {"outliers": 2, "without_fluid": True}
    assert dict(remaining_rows(replace(loop_result(), remaining=told))) == {
        "outliers (excluded)": "2",
        "no signal of the fluid": "yes",
    }


def test_a_mean_of_held_out_runs_says_which_are_in_it_alone():
    given = loop_result()
    fitted, *_ = (r for r in given.records if not r.held_out)
    held = replace(fitted, name="held", held_out=True)
    assert "runs include" not in waterfall_picture(replace(given, records=(fitted, held))).caption
    fast = replace(held, rate=3.0 * held.rate)
    pulled = replace(held, name="pulled", flow="uniaxial", quantity="tensile_stress")
    both = waterfall_picture(replace(given, records=(fitted, fast, pulled))).caption
    assert "Held-out runs include faster runs and uniaxial extension." in both


def test_effects_are_named_only_where_some_were_added():
    with_stage, without = loop_result(), without_stages()
    for draw in (runs_picture, residual_picture):
        assert "with effects" in draw(with_stage).svg
        drawn = draw(without).svg
        assert "with effects" not in drawn
        assert "starting model" in drawn
        assert "→" not in drawn


def test_noise_has_a_range_over_the_runs_only_where_it_comes_from_these_residuals():
    given = loop_result()
    assert noise_range(given) is None  # 0.5 % that somebody gave: no run has it
    residual = given.records[0].relative_residual[-1]
    noise = float(np.sqrt(np.mean(residual**2)))
    fitted = replace(given.records[0], name="second.csv")
    estimated = replace(given, records=(*given.records, fitted), noise_floor=noise)
    assert noise_range(estimated) == pytest.approx([noise, noise])


def test_parameters_stand_with_the_symbol_that_the_equation_has(tmp_path, no_pictures):
    result = loop_result()
    (stage,) = result.stages
    known = {"gain_error": StageParameter(0.7, (0.69, 0.71), "")}
    result = replace(result, stages=(replace(stage, parameters={**known, **stage.parameters}),))
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d", "").read_text("utf-8")
    row = re.search(r"<tr><td>gain_error</td>.*?</tr>", page, re.S)
    assert row is not None
    assert 'class="formula"' in row[0]
    assert '<tr><td>gain</td><td class="text">–</td>' in page  # named as nobody names it


@pytest.mark.slow
def test_no_latex_shows_in_the_page_of_a_yield_stress(tmp_path):
    effect = make_effect("yield_stress")
    result = loop_result()
    stage = replace(
        result.stages[0],
        effect=effect.name,
        equation=effect.equation,
        parameters={"yield_strain": StageParameter(0.1, (0.09, 0.11), "")},
    )
    records = tuple(replace(record, name=f"{i}.csv") for i, record in enumerate(result.records))
    result = replace(result, stages=(stage,), records=records)
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d", "").read_text("utf-8")
    # pictures keep what matplotlib drew in comments
    hidden = r"<(script|style)\b.*?</\1>|<!--.*?-->"
    body = re.sub(hidden, "", page[page.index("<body") :], flags=re.S)
    assert 'class="formula"' in body
    assert "\\" not in body
