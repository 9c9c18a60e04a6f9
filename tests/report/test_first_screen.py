"""The first screen: what a page shows of an answer, and what it copies."""

import re
from dataclasses import replace
from html import unescape

import pytest
from made_up_answer import MELT
from test_loop_report import loop_result

from discover.answer import Answer, Constant, Discrepancy, ExpectedError, Mode, Range, Suspect
from discover.answer.sentences import tolerance
from discover.effects.registry import named_effects
from discover.equations import Equation
from discover.equations.parts import NamedPart, StatePart
from discover.equations.spelling.markup import law_element
from discover.equations.spelling.plain_signs import plain
from discover.loop.answering import rest_of_h
from discover.report.first_screen import answer_screen
from discover.report.loop import write_loop
from discover.report.page import render
from discover.study import RunFolder
from tensor_library.law_terms import LawTerm


@pytest.mark.parametrize(
    ("asked", "adequate", "said"),
    [
        (0.05, False, "Misses the default 5 % tolerance: mean error"),
        (0.1, True, "tolerance 10 % met. Use for"),
    ],
)
def test_the_tolerance_says_whether_it_is_met_where_and_for_what(asked, adequate, said):
    answer = replace(MELT, tolerance=asked)
    assert answer.adequate is adequate
    assert said in answer.headline
    assert any("worst run in range 8 % (a.csv)" in line for line in answer.lines) is not adequate
    last = answer_screen(answer)["expected"][0].rows[-1]
    assert ((last.note, last.inside) == ("a.csv", "8 %")) is not adequate
    use = answer.to_json()["use"]
    assert use["expected_error"]["N1"] is None
    told = "not determined, limit 20 %: laws that fit as well differ by 40 %"
    assert use["why_unknown"]["N1"] == told
    assert Answer("", instead="No signal.").adequate is None


def test_the_first_lines_have_at_most_sixty_words():
    def count(screen):
        prose = [screen["headline"], screen["quality"], screen["behind"], screen["next_test"]]
        return sum(any(c.isalnum() for c in one) for one in " ".join(prose).split())

    # constants give way to what else there is to say
    others = [Constant(name, 1.0, (0.9, 1.1), "Pa s") for name in ("k_b", "t_b")]
    long = replace(
        MELT, constants=(*MELT.constants, *others), title="linear PTT with Newtonian viscosity",
        suspects=(*MELT.suspects, Suspect("wall_slip")), failed="Not tested in transients.",
        next_test="Measure N1 at 3 1/s and 160 °C: equally good laws differ by 40 %.",
    )  # fmt: skip
    assert count(answer_screen(long)) <= 60
    assert "ε = 0.82" in long.headline
    assert "k b" not in long.headline
    assert "k b" in replace(long, next_test="", suspects=(), failed="").headline
    # then what the table has, of a sum whose name is long
    sums = replace(
        long, title="empirical fit: linear PTT with strain damping, convective constraint release, "
        "added mode, Newtonian viscosity and tr(σ) σ·σ", law=None, failed="",
    )  # fmt: skip
    assert count(answer_screen(sums)) <= 60
    assert "worst run" not in sums.headline
    assert "worst run" in replace(sums, title="linear PTT", suspects=()).headline
    screen = answer_screen(MELT)
    assert count(screen) <= 60  # numbers are words too
    page = render("answer.html", screen=screen)
    order = ("Linear PTT", "Next:", "<math", "answer-table", 'id="modes"', "data-copy")
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    assert all(one["text"] for one in screen["copies"])
    assert render("answer.html").strip() == ""  # a page without an answer


def test_a_loop_page_begins_with_its_answer(tmp_path, no_pictures):
    page = write_loop(loop_result(), RunFolder(tmp_path, "x"), "n", "d").read_text("utf-8")
    assert page.index('id="answer"') < page.index('id="verdict"')


def test_the_level_of_the_intervals_of_constants_is_said_once():
    sums = Constant("consistency_Pa_sn", 4.0, (3.9, 4.1), "Pa sⁿ")
    fluid = Answer(
        "yield-stress fluid", "herschel_bulkley",
        (Constant("yield_stress_Pa", 12.0, (11.9, 12.1), "Pa"), sums),
    )  # fmt: skip
    assert fluid.headline.count("95 %") == 1
    assert "K = 4.00 Pa sⁿ (3.90–4.10)" in fluid.headline
    declared = replace(fluid, constants=(Constant("alpha", 0.2), sums))
    # α has no interval that could say it
    assert declared.headline.count("(95 % CI 3.90–4.10)") == 1
    screen = answer_screen(MELT)
    said = " ".join([screen["headline"], screen["quality"], screen["behind"]])
    assert said.count("(95") == 2  # of the constants and of the mean error


def test_a_law_that_cannot_be_written_out_leaves_the_best_classical_one_to_copy():
    law, classical = Equation((LawTerm("tr(sigma)*sigma", 0.82),)), MELT.equation
    answer = replace(MELT, equation=None, shown=law, classical=classical)
    screen = answer_screen(answer)
    assert "0.82" in screen["law"]
    assert screen["copied"] == "Copy the best classical law as"
    assert all(one["text"] for one in screen["copies"])
    bare = answer_screen(replace(answer, classical=None))
    assert bare["copied"] == "Copy as"
    assert not any(one["text"] for one in bare["copies"] if one["name"] != "JSON")


def test_rows_have_the_letters_of_the_equation_and_say_what_they_are():
    for effect in named_effects().values():
        if effect.kind == "constitutive" and effect.name != "relaxation_mode":
            equation = plain(effect.equation)
            for one in effect.parameters:
                assert plain(one.symbol).removeprefix("1/") in equation, one.name
    time = Constant(
        "heat_loss_time", 160.0, (110.0, 230.0), "s", True, r"t_\mathrm{h}", "heat loss"
    )
    page = render("answer.html", screen=answer_screen(replace(MELT, constants=(time,))))
    assert 't<sub>h</sub> <span class="note">heat loss</span>' in page
    run = answer_screen(replace(MELT, failed="Missed in run a_1b <x>."))
    assert "run a_1b &lt;x&gt;." in render("answer.html", screen=run)


def test_what_cannot_be_written_out_is_one_equation_with_the_law_it_is_added_to():
    effects = named_effects()
    added = [effects[name].equation for name in ("strain_damping", "yield_stress")]
    first, *where = rest_of_h(added).splitlines()
    assert first.startswith("h = n")
    assert first.count("=") == 1
    assert r"-\min" in first
    assert len(where) == 1
    law = Equation((LawTerm("sigma.sigma", 0.1),), (2.0, 1.0), (1.0, 10.0))
    answer = replace(MELT, equation=None, shown=law, written={"formula": rest_of_h(added)})
    assert "<mi>h</mi>" in answer_screen(answer)["law"]
    assert "<mi>h</mi>" not in answer_screen(replace(answer, written={}))["law"]


def test_a_suspect_is_a_row_of_the_table_with_its_interval():
    (row,) = answer_screen(MELT)["suspects"]
    assert row[:2] == ("stress gain", "may be zero")
    assert row[2].startswith("−11")
    assert row[3] == "−36\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}2"
    two = replace(MELT, suspects=(*MELT.suspects, Suspect("wall_slip")))
    rows = answer_screen(two)["suspects"]
    assert [one[2] for one in rows] == ["sizes not separable"] * 2
    page = render("answer.html", screen=answer_screen(MELT))
    heading = page.index("not part of the law")
    assert (
        page.index("<th>constant (fitted in shear)</th>") < heading < page.rindex("<td>stress gain")
    )
    assert "not part of the law" not in render(
        "answer.html", screen=answer_screen(replace(MELT, suspects=()))
    )


def test_an_equation_has_the_digits_of_its_intervals_and_three_at_most():
    terms = LawTerm("tr(sigma)*sigma", 0.81734), LawTerm("sigma.sigma", 0.12345)
    law = replace(MELT.equation, terms=terms)
    wide = Constant("epsilon", 0.81734, (0.58, 1.07))
    shown = answer_screen(replace(MELT, equation=law, constants=(wide,)))["law"]
    assert "<mn>0.82</mn>" in shown
    assert "<mn>0.123</mn>" in shown


def test_numbers_without_units_say_what_they_are():
    plain = replace(
        MELT, modes=(Mode(1.0, 1.0),), fits_to_the_noise=True, discrepancy=None,
        range=Range((1.0, 2.0), (0.25, 1.0)),
    )  # fmt: skip
    page = render("answer.html", screen=answer_screen(plain))
    assert '<abbr title="Weissenberg number:' in page
    assert '<abbr title="Deborah number:' in page
    unseen = render("answer.html", screen=answer_screen(MELT))
    assert 'left out in turn">unseen runs</abbr>' in unseen


def test_a_residual_of_fitted_runs_is_no_expected_error():
    fitted = replace(
        MELT,
        discrepancy=Discrepancy(0.06, (0.06, 0.06)),
        expected_error={"sigma12": ExpectedError(0.06, is_residual=True)},
    )
    assert "Residual of the fitted runs 6 %, corrected for" in fitted.headline
    page = render("answer.html", screen=answer_screen(fitted))
    assert "<th>residual of the fitted runs (noise 0.25\N{NO-BREAK SPACE}%)</th>" in page
    assert not any("Error on unseen" in line for line in fitted.lines)
    page = render("answer.html", screen=answer_screen(MELT))
    assert "<th>error on unseen runs above noise (0.25\N{NO-BREAK SPACE}%)</th>" in page
    # what the verdict calls noise has no size
    flow_curve = replace(fitted, fits_to_the_noise=True, range=Range(steady=True))
    assert "Residual of the fitted runs (noise 0.25 %): σ12 within noise" in flow_curve.lines[1]


def test_a_tolerance_counts_the_runs_that_miss_it_and_marks_the_quantities_above_it():
    runs = replace(MELT.discrepancy, by_run={"a": 0.06, "b": 0.09, "c": 0.01})
    several = replace(MELT, discrepancy=runs)
    assert tolerance(several) == ""  # the first words say it
    small = replace(several, discrepancy=replace(runs, size=0.04))
    assert tolerance(small) == "tolerance 5 % met in 1 of 3 runs"
    up_to = replace(runs, met_up_to="0.3 1/s")
    one_range = replace(MELT, discrepancy=up_to)  # and not a second one with the tolerance
    assert not tolerance(one_range)
    assert "Use for σ12, 0.003–3 1/s: within 5 % up to 0.3 1/s; up to 9 % off above." in (
        one_range.headline
    )
    assert answer_screen(several)["expected"][0].rows[-1].note == "b"
    by_law = ExpectedError(0.15, note="by law", is_measured=False, spread=(0.15, 0.2))
    pulled = {**MELT.expected_error, "N1": by_law, "uniaxial": ExpectedError(0.05)}
    screen = answer_screen(replace(several, expected_error=pulled))
    measured, untested = ({one.symbol: one for one in e.rows} for e in screen["expected"])
    assert measured["σ12"].note == "2 unseen runs, above tolerance"
    assert measured["uniaxial extension"].note == ""
    # a spread of laws is no error
    assert untested["N1"][1:4] == ("by law", "15 %", "20 %")
    assert "σ12" not in untested
    assert "N1" not in measured


def test_constants_far_from_the_middle_of_their_intervals_are_a_set():
    skewed, even = Constant("epsilon", 0.80, (0.17, 0.82)), Constant("alpha", 0.2, (0.1, 0.3))
    note = "best&nbsp;fit: use these<br>values together</th><th>95 % CI over all<br>laws that fit"
    pair = replace(MELT, constants=(skewed, even))
    assert note in render("answer.html", screen=answer_screen(pair))
    assert note not in render("answer.html", screen=answer_screen(replace(pair, constants=(even,))))
    one = replace(pair, constants=(even,))  # which holds only if its law is the right one
    condition = "95 % CI<br>within this law</th>"
    assert condition in render("answer.html", screen=answer_screen(one))
    right = replace(one, fits_to_the_noise=True)
    assert condition not in render("answer.html", screen=answer_screen(right))
    alone = replace(pair, constants=(skewed, Constant("alpha", 0.2)))  # the other was declared
    assert note not in render("answer.html", screen=answer_screen(alone))
    bound = Constant("heating", 1e-6, (5e-7, 1e-6), "1/Pa", meaning="heat", end="high")
    (row, _) = answer_screen(replace(pair, constants=(bound, even)))["constants"]
    assert row[1] == "heat; at its physical limit"


def test_a_constant_that_is_not_determined_has_the_value_that_the_equation_has():
    factor = Constant("modulus_factor", 0.013917, (4.5e-5, 455.0), determined=False)
    (row,) = answer_screen(replace(MELT, constants=(factor,)))["constants"]
    assert row[2] == "0.014"
    assert row[3] == "not determined alone"  # words may break, numbers not
    assert "0.014" not in factor.text


def test_shift_factors_are_times_over_those_at_the_reference_and_stand_with_the_modes():
    factors = {-10.0: 1.0 / 131.234, -23.0: 1.0 / 14.771}
    shifted = replace(MELT, temperature_C=-35.0, shift_factors=factors)
    assert (
        "Moduli and times are for −35 °C; times: divide by 131 for −10 °C "
        "(a_T = 0.00762), divide by 14.8 for −23 °C (a_T = 0.0677)."
    ) in shifted.lines
    assert "0.003–3 1/s reduced to −35 °C." in shifted.headline
    screen = answer_screen(shifted)
    # 0.003–3 1/s times 131 and times 14.8
    assert screen["shifts"] == [("−10 °C", "0.00762", "0.39–390"), ("−23 °C", "0.0677", "0.044–44")]
    assert "modes (given) at −35 °C: G" in render("answer.html", screen=screen)
    hot = replace(shifted, range=replace(MELT.range, by_temperature={-10.0: MELT.range}))
    told = answer_screen(hot)["fitted"]
    assert told == (" (fitted in shear at −10 °C; times are for −35 °C: divide by 131 for −10 °C)")
    cold = replace(shifted, shift_factors={-50.0: 20.0})
    assert any("times: multiply by 20 for −50 °C" in line for line in cold.lines)
    clock = "times on the instrument's clock"  # which is not shifted
    assert clock not in screen["suspected"]  # a gain has no time
    lag = Suspect("transducer_lag", (Constant("tau", 0.35, (0.13, 0.48), "s"),))
    assert clock in answer_screen(replace(shifted, suspects=(lag,)))["suspected"]
    assert shifted.use["shift_factors"]["-10"] == pytest.approx(1.0 / 131.234)
    page = render("answer.html", screen=answer_screen(replace(MELT, temperature_C=-35.0)))
    assert "divide by" not in page


def test_two_structures_scale_relaxation_times_by_one_product():
    def part(name):
        return StatePart(
            name, {one.name: one.first_trial for one in named_effects()[name].parameters}
        )

    parts = list(
        map(part, ("thixotropic_relaxation_by_stress", "thixotropic_relaxation_two_times"))
    )

    def products(*states):
        shown = answer_screen(replace(MELT, equation=replace(MELT.equation, states=states)))["law"]
        return [unescape(one) for one in re.findall(r'aria-label="([^"]*multiplied[^"]*)"', shown)]

    assert products(*parts) == ["λ_k is multiplied by s [(1 - w) q_1 + w q_2]"]
    assert products(parts[0]) == ["λ_k is multiplied by s"]
    # what scales another quantity stands beside it, and a factor may be an exponential
    told = products(part("softening_by_work"), part("thixotropy"))
    assert sorted(told) == ["G_k is multiplied by s", "λ_k is multiplied by e^(-Θ)"]


@pytest.mark.parametrize(("count", "shown"), [(1, True), (3, True), (4, False), (10, False)])
def test_three_modes_are_listed_and_more_are_folded(count, shown):
    modes = tuple(Mode(1000.0 / 2**k, 10.0**k) for k in range(count))
    page = render("answer.html", screen=answer_screen(replace(MELT, modes=modes)))
    assert ('<details id="modes" open>' in page) is shown
    assert ("G\N{NO-BREAK SPACE}=" in page[: page.index("</summary>")]) is (count == 1)


def test_modes_stand_in_the_order_of_their_times():
    melt = replace(MELT, modes=(Mode(5.0, 3.0), Mode(6.0, 1.0), Mode(4.0, 2.0)))
    page = render("answer.html", screen=answer_screen(melt))
    assert re.findall(r"<tr><td>\d</td><td>.*?</td><td>(.*?)</td>", page) == ["1", "2", "3"]
    assert "G from 4\N{NO-BREAK SPACE}Pa to 6" in page


def test_a_constant_has_the_same_digits_wherever_it_stands():
    modulus = Constant("modulus_Pa", 2.0543, (1.028, 3.8504), "Pa")
    fluid = replace(MELT, law=None, constants=(modulus,), modes=(Mode(2.0543, 0.82),))
    page = render("answer.html", screen=answer_screen(fluid))
    assert modulus.number == "2.1 Pa"
    assert "<td>2.1</td><td>0.82</td>" in page
    assert "mode (fitted): G\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}2.1\N{NO-BREAK SPACE}" in page


def test_rates_in_prose_and_tables_cannot_be_read_as_numbers():
    fast = ExpectedError(0.06, 0.18, "measured at 3 1/s")
    page = render("answer.html", screen=answer_screen(
        replace(MELT, expected_error={"sigma12": fast}, next_test="Measure N1 at 3 1/s.")
    ))  # fmt: skip
    shown = page[: page.index('<p class="copies">')]
    assert "1/s" not in shown
    assert shown.count("3\N{NARROW NO-BREAK SPACE}s⁻¹") == 3
    assert "3 1/s" in replace(MELT, expected_error={"sigma12": fast}).headline  # a terminal


def test_a_law_of_one_mode_is_written_in_units_whatever_its_values():
    law = Equation((LawTerm("sigma.sigma", 0.2),))
    written = answer_screen(replace(MELT, equation=law, modes=(Mode(1.0, 1.0),)))["law"]
    assert r'alttext="\lambda ' in written
    assert "<mi>G</mi>" in written


def test_quantities_that_nothing_is_known_of_share_a_row():
    none = ExpectedError()
    fluid = replace(MELT, expected_error={"sigma12": ExpectedError(0.01), "N1": none, "N2": none})
    rows = [row for one in answer_screen(fluid)["expected"] for row in one.rows]
    assert [one.symbol for one in rows if one.note != "a.csv"] == [
        "σ12", "N1, N2, uniaxial extension",
    ]  # fmt: skip
    page = render("answer.html", screen=answer_screen(fluid))
    table = page[page.index('<table id="answer-table">') : page.index("</table>")]
    assert table.count('class="both">not measured') == 1
    apart = {"N1": replace(none, note="0 by this law"), "N2": none}  # for reasons of their own
    assert len(answer_screen(replace(fluid, expected_error=apart))["expected"][1].rows) == 3


def test_a_grey_button_says_why():
    answer = replace(MELT, equation=None)
    page = render("answer.html", screen=answer_screen(answer))
    assert "Cannot be exported to rheoTool, Python and LaTeX: it cannot be written out." in page
    assert "Cannot be exported" not in render("answer.html", screen=answer_screen(MELT))


def test_numbers_chances_and_levels_keep_to_a_line_with_their_units():
    assert "<td>6\N{NO-BREAK SPACE}%</td>" in render("answer.html", screen=answer_screen(MELT))
    exact = replace(MELT, constants=(Constant("eta_s", 2e-7, (1e-7, 3e-7), "Pa s"),))
    (row,) = answer_screen(exact)["constants"]
    assert row[2].split(" ") == ["2\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁷", row[2][-4:]]
    noted = replace(MELT, discrepancy=replace(MELT.discrepancy, by_run={"a_b1p0.csv": 0.08}))
    assert "a_<wbr>b1p0.csv" in render("answer.html", screen=answer_screen(noted))
    assert "ε\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}0.82" in answer_screen(MELT)["headline"]
    gap, said = "\N{NO-BREAK SPACE}", replace(MELT, failed="No law reaches the noise (p < 0.001).")
    assert f"(p{gap}<{gap}0.001)" in answer_screen(said)["quality"]
    assert f"(95{gap}%{gap}CI{gap}0.58" in answer_screen(said)["headline"]


def test_the_interval_comes_first_where_the_best_fit_is_near_its_end():
    skewed = Constant("epsilon", 0.80, (0.37, 0.82))
    assert skewed.text == "ε = 0.37–0.82 (95 % CI, best fit 0.80)"
    answer = replace(MELT, constants=(skewed, Constant("alpha", 0.2, (0.2, 0.4))))
    assert answer.headline.startswith(
        "Linear PTT, ε = 0.37–0.82 (95 % CI, best fit 0.80), α = 0.20–0.40 (best fit 0.20), 2 "
    )
    # the table gives the value that the equation has, for it goes with the other constants
    assert answer_screen(answer)["constants"][0][2] == "0.80"
    assert Constant("epsilon", 0.4, (0.17, 0.82)).text == "ε = 0.40 (95 % CI 0.17–0.82)"


def test_what_was_not_tested_stands_behind_the_fit():
    fitted = replace(
        MELT, fits_to_the_noise=True, failed="Not tested on unseen runs.", tolerance=0.1
    )
    screen = answer_screen(fitted)
    assert "Not tested on unseen runs. Use for" in screen["quality"]
    assert "Not tested" not in screen["behind"]


def test_a_constant_of_each_mode_has_its_index():
    each = tuple({"epsilon": value} for value in (0.2, 0.5))
    law = law_element((), True, NamedPart("ptt_linear", each), modes=2)
    assert "ε_{k}" in law
    one = law_element((), True, NamedPart("ptt_linear", each[:1]), modes=2)
    assert "ε_" not in one
