"""The report of a closed loop: what it contains, its verdict, that it stands alone."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from standing_alone import stands_alone

from discover.effects import make_effect
from discover.loop import CandidateScore, ErrorPair, FreeForm, LoopResult, RunRecord, Stage, parts
from discover.report.loop import loop_verdict, noise_range, remaining_rows, write_loop
from discover.report.page import render
from discover.report.plots.loop.residual import residual_picture, waterfall_picture
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
        "stress_gain", "signal", {"gain": parts.StageParameter(0.7, (0.69, 0.71), "")},
        ("rate_gain",),
        ErrorPair(0.01, held_out), 50.0, r"\sigma \mathrel{+}= g\,\sigma", "a source", "a check",
    )  # fmt: skip
    candidate = CandidateScore("stress_gain", "signal", score=0.9, evidence=50.0, error=0.01)
    return LoopResult(
        "effects_added", ErrorPair(0.4, 0.4), ErrorPair(0.01, held_out), 0.005, (stage,),
        {"structured": False, "runs": ["a"]}, ((candidate,), (candidate,)), tuple(records),
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    write_loop(loop_result(), RunFolder(folder, "x"), "<i>name", "data", "")
    return folder


def test_the_loop_report_holds_data_pictures_with_their_numbers_ranking_and_errors(written):
    page = (written / "report.html").read_text("utf-8")
    assert stands_alone(page)
    assert "<i>name" not in page
    assert r"a&lt;b&gt;$\frac$.csv" in page
    for name in ("waterfall", "runs", "residual"):
        assert f'<figure id="{name}">' in page
        assert (written / "figures" / f"{name}.svg").is_file()
    told = ("do not distinguish it from", "rate gain", "<code>stress_gain</code>", "held-out runs")
    for text in (*told, "0.690–\N{WORD JOINER}0.710"):
        assert text in page
    assert r"\begin{equation}" in (written / "equations.tex").read_text()
    for name in ("predictions.csv", "loop.json"):
        (inside,) = re.findall(rf'data-name="{name}">([^<]*)</script>', page)
        assert json.loads(inside) == (written / name).read_text("utf-8")
        assert page.count(f'<a class="data" href="{name}" download>') == page.count("<figure id=")
    # what is too long for a page lies beside it
    page = render("base.html", data={"short.csv": "1", "long.csv": "1" * 4_000_000})
    assert 'data-name="short.csv"' in page
    assert 'data-name="long.csv"' not in page


def test_a_loop_without_held_out_runs_or_effects_still_reports(loop_page):
    error = ErrorPair(0.01, None)
    page = loop_page(replace(
        loop_result(), stages=(), error_before=error, error_after=error, rankings=(),
        verdict="no_effect_needed",
    ))  # fmt: skip
    assert "nothing is missing" in page
    assert "with the added effects" not in page


def test_the_loop_report_shows_runs_held_out_in_turn_and_constants_with_units(tmp_path, loop_page):
    folds = (parts.Fold("only.csv", "unexplained", ("tr(sigma)*sigma",), 0.7, 0.123),)
    declared = {"modulus_Pa": parts.StageParameter(41.5, (41.0, 42.0), "Pa")}
    page = loop_page(replace(loop_result(), folds=folds, declared_parameters=declared))
    for text in ("runs left out in turn", "only.csv", "12 %", "tr(σ) σ"):
        assert text in page
    declared = page[page.index('<table id="declared"') :]
    row = declared[: declared.index("</table>")]
    assert all(text in row for text in ("modulus_Pa", "41.5", "41.0–\N{WORD JOINER}42.0", ">Pa<"))
    contents = json.loads((tmp_path / "loop.json").read_text())
    assert contents["folds"][0]["effects"] == ["tr(sigma)*sigma"]
    assert contents["declared_parameters"]["modulus_Pa"]["unit"] == "Pa"


def test_the_page_says_which_modes_the_data_leave_open(tmp_path, loop_page):
    modes = (
        parts.ModeConstant(5.0, 0.1, (0.08, 0.12), False),
        parts.ModeConstant(0.05, 0.6, None, True),
    )
    found = parts.ConstantByMode(0.15, (0.14, 0.16), "", 2.0, 3, (0.0, 12.3), modes)
    stage = replace(
        loop_result().stages[0], effect="giesekus_mobility", kind="constitutive",
        parameters={"alpha": found}, aliases=(), equation="",
    )  # fmt: skip
    page = loop_page(replace(loop_result(), stages=(stage,), verdict="unexplained"))
    table = page[page.index('<table id="by-mode-1"') :]
    rows = table[: table.index("</table>")].split("<tr>")[2:]
    assert "0.080–\N{WORD JOINER}0.120" in rows[0]
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
    told = [line[name] for name in ("effect", "value", "low", "high")]
    assert told == ["stress_gain", 0.7, 0.69, 0.71]
    assert result.errors_table().loc["after", "fit"] == result.error_after.fit
    assert "stress_gain" in result._repr_html_()
    assert result._repr_html_().startswith(f"<p>{result.answer.headline}</p>")


def test_every_verdict_is_whole_sentences():
    aliased = loop_result()
    verdicts = [
        loop_verdict(replace(aliased, verdict=verdict, stages=stages))
        for verdict in ("effects_added", "unexplained", "no_effect_needed")
        for stages in (aliased.stages, ())
    ]
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
    # many aliases are counted and not recited
    many = ("rate_gain", "sigma", "stress_drift", "edge_fracture", "I")
    stage = replace(aliased.stages[0], aliases=many)
    following = replace(aliased, stages=(stage,)).answer.next_test
    assert "2 more" in following
    assert "torque loss" not in following


def test_an_effect_of_the_instrument_is_named_with_those_that_these_runs_do_not_distinguish():
    result = loop_result()

    def answer(aliases, *twins):
        told = parts.Explanation(("stress_gain",), 0.97, result.error_after, {}, twins)
        stage = replace(result.stages[0], aliases=aliases)
        explanations = parts.Explanations((told,), 0.03)
        return replace(result, stages=(stage,), explanations=explanations).answer

    named = answer(("rate_gain",), ("rate_gain",))
    assert "Not part of this law: stress gain or rate gain (instrument)." in named.headline
    assert not named.alternative  # it is said once
    many = answer(("rate_gain", "time_delay", "stress_drift"))
    assert "stress gain, rate gain or 2 others (instrument)" in many.headline
    # one of the fluid is no effect of the instrument, and has a line of its own
    fluid = answer(("solvent_viscosity",), ("solvent_viscosity",))
    assert "law: stress gain (instrument)" in fluid.headline
    assert fluid.alternative == "Newtonian viscosity predicts these runs alike."


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
    gain = parts.Explanation(("stress_gain",), probability, ErrorPair(0.01, 0.2), {})
    told = parts.Explanations((gain,), 1.0 - probability, inclusion)
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


def test_where_no_law_is_given_no_model_no_band_and_no_section_on_laws_are_shown(loop_page):
    result = loop_result()
    banded = tuple(replace(r, band=np.stack([r.measured, r.measured])) for r in result.records)
    law = replace(result, records=banded)
    for verdict, drawn in (("effects_added", True), ("no_signal", False)):
        picture = runs_picture(replace(law, verdict=verdict))
        for said in ("starting model", "95 % prediction band", "1 %"):
            assert (said in picture.svg) is drawn
        assert ("predicted" in picture.caption) is drawn
    for verdict, told in (("effects_added", True), ("no_signal", False)):
        page = loop_page(replace(loop_result(), verdict=verdict))
        for section in ("before-after", "explanations", "effects", "ranking-table", "remaining"):
            assert (f'href="#{section}"' in page) is told
            assert (f'<h2 id="{section}"' in page) is told
        assert '<h2 id="run-table"' in page


def test_a_function_that_is_in_the_answer_is_told_beside_its_law():
    curve, shown = np.zeros(2), ("recorded_stress", "stress", "Pa", ("ptt_exponential",))
    law = {"ptt_exponential": {"epsilon": (0.364, 0.346, 0.381)}}
    found = FreeForm(*shown, curve, curve, curve, curve, "clipped", law, in_answer=True)
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


def test_a_verdict_begins_with_what_is_unexplained_or_names_the_hardest_test():
    text = loop_verdict(replace(loop_result(), verdict="unexplained"))[0]
    assert text == "A systematic residual remains that no candidate explains."
    error = ErrorPair(0.01, 0.012)
    clean = replace(
        loop_result(), verdict="no_effect_needed", stages=(), error_before=error,
        error_after=error, remaining={"linear_error": 0.02},
    )  # fmt: skip
    found, sure = loop_verdict(clean)
    assert "nothing is missing" in found
    assert sure == ""
    assert "it tests the model hardest" in clean.answer.next_test


def test_errors_stand_with_their_range_over_the_runs_and_every_run_is_listed(loop_page):
    result = loop_result()
    worse = replace(result.records[0], name="worse.csv", errors=np.array([0.6, 0.03]))
    page = loop_page(replace(result, records=(*result.records, worse)))
    assert "<td>1 % (1 to 3 %)</td><td>20 %</td>" in page  # one held-out run has no range
    runs = page[page.index('<h2 id="run-table"') : page.index('<h2 id="ranking-table"')]
    assert runs.count("<tr><td>") == 3
    assert '<td class="text">test</td>' in runs


def oscillating(name="wave.csv", held_out=False):
    time = np.linspace(0.0, 20.0, 401)
    measured, errors = np.sin(time + 0.5), np.array([0.3, 0.0])
    return RunRecord(
        name, held_out, time, 2.0 * np.sin(time), time, 2.0 * np.cos(time), measured,
        np.stack([1.3 * measured, measured]), errors,
    )  # fmt: skip


def test_oscillations_are_drawn_against_strain_and_rate_with_every_sample_and_start_ups_are_not():
    waves = replace(loop_result(), records=(oscillating(), oscillating("held.csv", True)))
    drawn = lissajous_picture(waves)
    for text in ("elastic: σ₁₂ (Pa)", "viscous: σ₁₂ (Pa)", "strain γ", "γ̇ (1/s)", "held", "30 %"):
        assert text in drawn.svg
    assert lissajous_picture(loop_result()) is None
    alone = lissajous_picture(replace(loop_result(), records=(oscillating(),)))
    before, named, _ = alone.svg.partition("measured, all cycles")
    assert named
    assert before.count("<use ") > 2 * oscillating().time.size  # each sample in both panels


def without_stages():
    """A loop that added nothing: one prediction and one error a run."""
    found = loop_result()
    records = tuple(
        replace(r, predicted=r.predicted[:1], errors=r.errors[:1]) for r in found.records
    )
    return replace(found, stages=(), records=records, error_after=found.error_before)


def test_the_residual_has_no_row_that_says_nothing_and_noise_a_range_where_it_is_of_these_runs():
    left = {"structured": False, "outliers": 0, "without_fluid": False}
    rows = dict(remaining_rows(replace(loop_result(), remaining=left)))
    assert rows == {"systematic residual": "no"}
    told = {"outliers": 2, "without_fluid": True}
    told = dict(
        remaining_rows(replace(loop_result(), remaining={"outliers": 2, "without_fluid": True}))
    )
    assert told == {"outliers (excluded)": "2", "no signal of the fluid": "yes"}
    given = loop_result()
    assert noise_range(given) is None  # 0.5 % that somebody gave: no run has it
    residual = given.records[0].relative_residual[-1]
    noise = float(np.sqrt(np.mean(residual**2)))
    fitted = replace(given.records[0], name="second.csv")
    estimated = replace(given, records=(*given.records, fitted), noise_floor=noise)
    assert noise_range(estimated) == pytest.approx([noise, noise])


def test_captions_say_which_runs_a_mean_is_of_and_name_effects_only_where_some_were_added():
    given = loop_result()
    fitted, *_ = (r for r in given.records if not r.held_out)
    held = replace(fitted, name="held", held_out=True)
    assert "runs include" not in waterfall_picture(replace(given, records=(fitted, held))).caption
    fast = replace(held, rate=3.0 * held.rate)
    pulled = replace(held, name="pulled", flow="uniaxial", quantity="tensile_stress")
    both = waterfall_picture(replace(given, records=(fitted, fast, pulled))).caption
    assert "Held-out runs include faster runs and uniaxial extension." in both
    with_stage, without = loop_result(), without_stages()
    for draw in (runs_picture, residual_picture):
        assert "with effects" in draw(with_stage).svg
        drawn = draw(without).svg
        assert "with effects" not in drawn
        assert "starting model" in drawn
        assert "→" not in drawn


def test_parameters_stand_with_the_symbol_that_the_equation_has(loop_page):
    result = loop_result()
    (stage,) = result.stages
    known = {"gain_error": parts.StageParameter(0.7, (0.69, 0.71), ""), **stage.parameters}
    page = loop_page(replace(result, stages=(replace(stage, parameters=known),)))
    row = re.search(r"<tr><td>gain_error</td>.*?</tr>", page, re.S)
    assert 'class="formula"' in row[0]
    assert '<tr><td>gain</td><td class="text">–</td>' in page  # named as nobody names it


@pytest.mark.slow
def test_no_latex_shows_in_the_page_of_a_yield_stress(tmp_path):
    effect = make_effect("yield_stress")
    result = loop_result()
    yields = {"yield_strain": parts.StageParameter(0.1, (0.09, 0.11), "")}
    named = {"effect": effect.name, "equation": effect.equation, "parameters": yields}
    stage = replace(result.stages[0], **named)
    records = tuple(replace(record, name=f"{i}.csv") for i, record in enumerate(result.records))
    result = replace(result, stages=(stage,), records=records)
    page = write_loop(result, RunFolder(tmp_path, "x"), "n", "d", "").read_text("utf-8")
    # pictures keep what matplotlib drew in comments
    hidden = r"<(script|style)\b.*?</\1>|<!--.*?-->"
    body = re.sub(hidden, "", page[page.index("<body") :], flags=re.S)
    assert 'class="formula"' in body
    assert "\\" not in body
