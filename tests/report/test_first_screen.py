"""The first screen: what a page shows of an answer, and what it copies."""

import re
from dataclasses import replace
from html import unescape

import pytest
from made_up_answer import MELT, headline, page_of, screen_of
from test_loop_report import loop_result

from discover.answer import Answer, Constant, Discrepancy, ExpectedError, Mode, Range, Suspect
from discover.answer.modes_in_words import at_use
from discover.answer.sentences import tolerance
from discover.effects.registry import named_effects
from discover.equations import Equation
from discover.equations.markup import law_element, plain
from discover.equations.parts import NamedPart, StatePart
from discover.loop.answering import rest_of_h
from discover.report.page import render
from tensor_library.law_terms import LawTerm


@pytest.mark.parametrize(
    ("asked", "adequate", "said"),
    [
        (0.05, False, "worst run 8 %; tolerance 5 % met in 1 of 2 runs. If"),
        (0.1, True, "tolerance 10 % met. Use for"),
    ],
)
def test_the_tolerance_says_whether_it_is_met_where_and_for_what(asked, adequate, said):
    answer = replace(MELT, tolerance=asked)
    assert answer.adequate is adequate
    assert said in answer.headline
    assert (
        any("σ12, worst run in range 8 % (a.csv)" in line for line in answer.lines) is not adequate
    )
    last = screen_of(answer)["expected"][0].rows[-1]
    assert ((last.note, last.inside) == ("a.csv", "8 %")) is not adequate
    use = answer.to_json()["use"]
    assert use["expected_error"]["N1"] is None
    told = "not determined, laws differ by over 20 %: laws that fit as well differ by 40 %"
    assert use["why_unknown"]["N1"] == told
    assert Answer("", instead="No signal.").adequate is None


def test_the_first_lines_have_at_most_sixty_words():
    def count(screen):
        prose = [screen["headline"], screen["quality"], screen["behind"], screen["next_test"]]
        return sum(any(c.isalnum() for c in one) for one in " ".join(prose).split())

    # intervals give way to what else there is to say
    others = [Constant(name, 1.0, (0.9, 1.1), "Pa s") for name in ("k_b", "t_b")]
    long = replace(
        MELT, constants=(*MELT.constants, *others), title="linear PTT with Newtonian viscosity",
        suspects=(*MELT.suspects, Suspect("wall_slip")), failed="Not tested in transients.",
        next_test="Measure N1 at 3 1/s and 160 °C: equally good laws differ by 40 %.",
    )  # fmt: skip
    assert count(screen_of(long)) <= 60
    assert "ε = 0.82" in long.headline
    assert "k b = 1.00 Pa s, t b" in long.headline
    assert "k b = 1.00 Pa s (0.90–1.10)" in headline(long, next_test="", suspects=(), failed="")
    # then what the table has, of a sum whose name is long
    sums = replace(
        long, title="empirical fit: linear PTT with strain damping, convective constraint release, "
        "added mode, Newtonian viscosity and tr(σ) σ·σ", law=None, failed="",
    )  # fmt: skip
    assert count(screen_of(sums)) <= 60
    assert "worst run" not in sums.headline
    assert "worst run" in headline(sums, title="linear PTT", suspects=(), next_test="")
    screen = screen_of()
    assert count(screen) <= 60  # numbers are words too
    page = render("answer.html", screen=screen)
    order = ("Linear PTT", "Next:", "<math", "answer-table", 'id="modes"', "data-copy")
    places = [page.index(text) for text in order]
    assert places == sorted(places)
    assert all(one["text"] for one in screen["copies"])
    assert render("answer.html").strip() == ""  # a page without an answer


def test_a_loop_page_begins_with_its_answer_which_says_the_level_of_the_intervals_once(loop_page):
    page = loop_page(loop_result())
    assert page.index('id="answer"') < page.index('id="verdict"')


def test_the_level_of_the_intervals_of_constants_is_said_once():
    sums = Constant("consistency_Pa_sn", 4.0, (3.9, 4.1), "Pa sⁿ")
    yields = Constant("yield_stress_Pa", 12.0, (11.9, 12.1), "Pa")
    fluid = Answer("yield-stress fluid", "herschel_bulkley", (yields, sums))
    assert fluid.headline.count("95 %") == 1
    assert "K = 4.00 Pa sⁿ (3.90–4.10)" in fluid.headline
    declared = replace(fluid, constants=(Constant("alpha", 0.2), sums))
    # α has no interval that could say it
    assert declared.headline.count("(95 % CI 3.90–4.10)") == 1
    screen = screen_of()
    said = " ".join([screen["headline"], screen["quality"], screen["behind"]])
    assert said.count("(95") == 2  # of the constants and of the mean error


def test_rows_have_the_letters_of_the_equation_and_say_what_they_are():
    for effect in named_effects().values():
        if effect.kind == "constitutive" and effect.name != "relaxation_mode":
            equation = plain(effect.equation)
            for one in effect.parameters:
                assert plain(one.symbol).removeprefix("1/") in equation, one.name
    said = r"t_\mathrm{h}", "heat loss"
    time = Constant("heat_loss_time", 160.0, (110.0, 230.0), "s", True, *said)
    assert 't<sub>h</sub> <span class="note">heat loss</span>' in page_of(constants=(time,))
    assert "run a_1b &lt;x&gt;." in page_of(failed="Missed in run a_1b <x>.")


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
    assert "<mi>h</mi>" in screen_of(answer)["law"]
    assert "<mi>h</mi>" not in screen_of(answer, written={})["law"]


def test_a_suspect_is_a_row_of_the_table_with_its_interval():
    (row,) = screen_of()["suspects"]
    assert row[:2] == ("stress gain", "may be zero")
    assert row[2].startswith("−11")
    assert row[3] == "−36\N{NO-BREAK SPACE}to\N{NO-BREAK SPACE}2"
    rows = screen_of(suspects=(*MELT.suspects, Suspect("wall_slip")))["suspects"]
    assert [one[2] for one in rows] == ["sizes not separable"] * 2
    page, heading = page_of(), "not part of the law"
    before = page.index("<th>constant (fitted in shear)</th>")
    assert before < page.index(heading) < page.rindex("<td>stress gain")
    assert heading not in page_of(suspects=())


def test_equation_table_and_modes_have_the_digits_of_the_intervals_and_three_at_most():
    terms = LawTerm("tr(sigma)*sigma", 0.81734), LawTerm("sigma.sigma", 0.12345)
    wide = Constant("epsilon", 0.81734, (0.58, 1.07))
    shown = screen_of(equation=replace(MELT.equation, terms=terms), constants=(wide,))["law"]
    assert "<mn>0.82</mn>" in shown
    assert "<mn>0.123</mn>" in shown
    # one that is not determined has the value that the equation has
    factor = Constant("modulus_factor", 0.013917, (4.5e-5, 455.0), determined=False)
    (row,) = screen_of(constants=(factor,))["constants"]
    assert row[2:4] == ("0.014", "not determined alone")  # words may break, numbers not
    assert "0.014" not in factor.text
    modulus = Constant("modulus_Pa", 2.0543, (1.028, 3.8504), "Pa")
    page = page_of(law=None, constants=(modulus,), modes=(Mode(2.0543, 0.82),))
    assert modulus.number == "2.1 Pa"
    assert "mode (fitted): G\N{NO-BREAK SPACE}=\N{NO-BREAK SPACE}2.1\N{NO-BREAK SPACE}" in page


def test_numbers_without_units_say_what_they_are():
    page = page_of(
        modes=(Mode(1.0, 1.0),), fits_to_the_noise=True, discrepancy=None,
        range=Range((1.0, 2.0), (0.25, 1.0)),
    )  # fmt: skip
    assert '<abbr title="Weissenberg number:' in page
    assert '<abbr title="Deborah number:' in page
    assert 'left out in turn">unseen runs</abbr>' in page_of()


def test_a_residual_of_fitted_runs_is_no_expected_error():
    fitted = replace(
        MELT,
        discrepancy=Discrepancy(0.06, (0.06, 0.06)),
        expected_error={"sigma12": ExpectedError(0.06, is_residual=True)},
    )
    assert "Residual of the fitted runs 6 %; tolerance" in fitted.headline
    page = page_of(fitted)
    assert (
        "<th>residual of the fitted runs after removing 0.25\N{NO-BREAK SPACE}% noise</th>" in page
    )
    assert not any("unseen" in line for line in fitted.lines)
    page = page_of()
    assert "<th>mean error on unseen runs after removing 0.25\N{NO-BREAK SPACE}% noise</th>" in page
    # what the verdict calls noise has no size
    flow_curve = replace(fitted, fits_to_the_noise=True, range=Range(steady=True))
    assert "fitted runs after removing 0.25 % noise: σ12 none detected." in flow_curve.lines[1]


def test_a_tolerance_counts_the_runs_that_miss_it_and_marks_the_quantities_above_it():
    runs = replace(MELT.discrepancy, by_run={"a": 0.06, "b": 0.09, "c": 0.01})
    several = replace(MELT, discrepancy=runs)
    for size in (0.04, 0.06):
        one = replace(several, discrepancy=replace(runs, size=size))
        assert tolerance(one) == "tolerance 5 % met in 1 of 3 runs"
    up_to = replace(runs, met_up_to="0.3 1/s")
    one_range = replace(MELT, discrepancy=up_to)  # and not a second one with the tolerance
    assert not tolerance(one_range)
    assert "Use for σ12 only, 0.003–3 1/s: within 5 % up to 0.3 1/s; up to 9 % off above." in (
        one_range.headline
    )
    assert screen_of(several)["expected"][0].rows[-1].note == "b"
    by_law = ExpectedError(note="by law", spread=(0.15, 0.2))
    pulled = {**MELT.expected_error, "N1": by_law, "uniaxial": ExpectedError(0.05)}
    screen = screen_of(several, expected_error=pulled)
    measured, untested = ({one.symbol: one for one in e.rows} for e in screen["expected"])
    # a spread of laws is no error
    assert untested["N1"][1:4] == ("by law", "15 %", "20 %")
    assert "σ12" not in untested
    assert "N1" not in measured


def test_constants_far_from_the_middle_of_their_intervals_are_a_set():
    skewed, even = Constant("epsilon", 0.80, (0.17, 0.82)), Constant("alpha", 0.2, (0.1, 0.3))
    note = "best&nbsp;fit,<br>as one set"
    pair = replace(MELT, constants=(skewed, even))
    assert note in page_of(pair)
    assert note not in page_of(replace(pair, constants=(even,)))
    one = replace(pair, constants=(even,))  # which holds only if its law is the right one
    condition = "over all laws that fit as well; each misses the runs by more than noise"
    assert condition in page_of(one)
    right = replace(one, fits_to_the_noise=True)
    assert condition not in page_of(right)
    alone = replace(pair, constants=(skewed, Constant("alpha", 0.2)))  # the other was declared
    assert note not in page_of(alone)
    bound = Constant("heating", 1e-6, (5e-7, 1e-6), "1/Pa", meaning="heat", end="high")
    (row, _) = screen_of(pair, constants=(bound, even))["constants"]
    assert row[1] == "heat; at its physical limit"


def test_shift_factors_are_times_over_those_at_the_reference_and_stand_with_the_modes():
    factors = {-10.0: 1.0 / 131.234, -23.0: 1.0 / 14.771}
    shifted = replace(MELT, temperature_C=-35.0, shift_factors=factors)
    assert (
        "Moduli and times are for −35 °C; times: divide by 131 for −10 °C "
        "(a_T = 0.00762), divide by 14.8 for −23 °C (a_T = 0.0677)."
    ) in shifted.lines
    assert "0.003–3 1/s reduced to −35 °C." in shifted.headline
    screen = screen_of(shifted)
    # 0.003–3 1/s times 131 and times 14.8
    assert screen["shifts"] == [("−10 °C", "0.00762", "0.39–390"), ("−23 °C", "0.0677", "0.044–44")]
    assert "modes (given) at −35 °C: λ" in render("answer.html", screen=screen)
    hot = replace(shifted, range=replace(MELT.range, by_temperature={-10.0: MELT.range}))
    time = Constant("t", 1312.34, (1000.0, 1500.0), "s")
    thixotropy = StatePart("thixotropy", {"breakdown": 0.2, "build_up_time": 1312.34})
    law = Equation((), (100.0,), (1312.34,), solvent_viscosity=1312.34, states=(thixotropy,))
    constants = (time, Constant("k", 0.02, (0.01, 0.03), "1/s"))
    used = at_use(replace(hot, constants=constants, equation=law))
    assert screen_of(used)["fitted"] == " (fitted in shear; times are for −10 °C)"
    # 1312 s over 131, and 0.02 1/s times 131
    assert [one.value for one in used.constants] == pytest.approx([10.0, 2.62468])
    # times and viscosities over 131.234; moduli and pure numbers are what they are
    assert (used.equation.modulus, used.equation.relaxation_time) == (
        (100.0,),
        (pytest.approx(10.0),),
    )
    assert used.equation.solvent_viscosity == pytest.approx(10.0)
    assert used.equation.states[0].values == pytest.approx(
        {"breakdown": 0.2, "build_up_time": 10.0}
    )
    # 131.234 over 14.771, and 131.234
    assert used.use["temperature_C"] == -10.0
    assert used.use["shift_factors"] == pytest.approx({"-23": 8.8846, "-35": 131.234}, rel=1e-4)
    cold = replace(shifted, shift_factors={-50.0: 20.0})
    assert any("times: multiply by 20 for −50 °C" in line for line in cold.lines)
    clock = "times on the instrument's clock"  # which is not shifted
    assert clock not in screen["suspected"]  # a gain has no time
    lag = Suspect("transducer_lag", (Constant("tau", 0.35, (0.13, 0.48), "s"),))
    assert clock in screen_of(shifted, suspects=(lag,))["suspected"]
    assert shifted.use["shift_factors"]["-10"] == pytest.approx(1.0 / 131.234)
    page = page_of(replace(MELT, temperature_C=-35.0))
    assert "divide by" not in page


def test_two_structures_scale_relaxation_times_by_one_product():
    def part(name):
        constants = {one.name: one.first_trial for one in named_effects()[name].parameters}
        return StatePart(name, constants)

    own = " (part of the law)"  # and not to be dropped
    names = ("thixotropic_relaxation_by_stress", "thixotropic_relaxation_two_times")
    parts = [part(name) for name in names]

    def products(*states):
        shown = screen_of(equation=replace(MELT.equation, states=states))["law"]
        return [unescape(one) for one in re.findall(r'aria-label="([^"]*multiplied[^"]*)"', shown)]

    assert products(*parts) == [f"λ_k is multiplied by s [(1 - w) q_1 + w q_2]{own}"]
    assert products(parts[0]) == [f"λ_k is multiplied by s{own}"]
    # what scales another quantity stands beside it, and a factor may be an exponential
    told = products(part("softening_by_work"), part("thixotropy"))
    assert sorted(told) == [f"G_k is multiplied by s{own}", f"λ_k is multiplied by e^(-Θ){own}"]


@pytest.mark.parametrize(("count", "shown"), [(2, True), (4, True), (5, False), (10, False)])
def test_four_modes_are_listed_and_more_are_folded(count, shown):
    modes = tuple(Mode(1000.0 / 2**k, 10.0**k) for k in range(count))
    page = page_of(modes=modes)
    assert ('<details id="modes" open>' in page) is shown


def test_modes_stand_in_the_order_of_their_times():
    page = page_of(modes=(Mode(5.0, 3.0), Mode(6.0, 1.0), Mode(4.0, 2.0)))
    assert re.findall(r"<tr><td>\d</td><td>.*?</td><td>(.*?)</td>", page) == ["1", "2", "3"]
    assert "λ from 1 to 3" in page


def test_rates_in_prose_and_tables_cannot_be_read_as_numbers():
    fast = ExpectedError(0.06, 0.18, "measured at 3 1/s")
    page = page_of(expected_error={"sigma12": fast}, next_test="Measure N1 at 3 1/s.")  # fmt: skip
    shown = page[: page.index('<p class="copies">')]
    assert "1/s" not in shown
    assert shown.count("3\N{NARROW NO-BREAK SPACE}s⁻¹") == 3
    assert "3 1/s" in headline(expected_error={"sigma12": fast})  # a terminal


def test_a_law_of_one_mode_is_written_in_units_and_a_constant_of_each_mode_has_its_index():
    law = Equation((LawTerm("sigma.sigma", 0.2),))
    written = screen_of(equation=law, modes=(Mode(1.0, 1.0),))["law"]
    assert r'alttext="\lambda ' in written
    assert "<mi>G</mi>" in written
    each = tuple({"epsilon": value} for value in (0.2, 0.5))
    assert "ε_{k}" in law_element((), True, NamedPart("ptt_linear", each), modes=2)
    assert "ε_" not in law_element((), True, NamedPart("ptt_linear", each[:1]), modes=2)


def test_quantities_that_nothing_is_known_of_share_a_row():
    none = ExpectedError()
    fluid = replace(MELT, expected_error={"sigma12": ExpectedError(0.01), "N1": none, "N2": none})
    rows = [row for one in screen_of(fluid)["expected"] for row in one.rows]
    told = [one.symbol for one in rows if one.note != "a.csv"]
    assert told == ["σ12", "N1, N2, uniaxial extension"]
    page = page_of(fluid)
    table = page[page.index('<table id="answer-table">') : page.index("</table>")]
    assert table.count('<td colspan="2">not measured') == 1
    apart = {"N1": replace(none, note="0 by this law"), "N2": none}  # for reasons of their own
    assert len(screen_of(fluid, expected_error=apart)["expected"][1].rows) == 3


def test_a_law_that_cannot_be_written_out_says_so_and_leaves_the_best_classical_one_to_copy():
    said = "Cannot be exported to rheoTool, Python and LaTeX: it cannot be written out."
    assert said in page_of(equation=None)
    assert "Cannot be exported" not in page_of()
    law, classical = Equation((LawTerm("tr(sigma)*sigma", 0.82),)), MELT.equation
    answer = replace(MELT, equation=None, shown=law, classical=classical)
    screen = screen_of(answer)
    assert "0.82" in screen["law"]
    assert screen["copied"] == "Copy the best classical law as"
    assert all(one["text"] for one in screen["copies"])
    bare = screen_of(answer, classical=None)
    assert bare["copied"] == "Copy as"
    assert not any(one["text"] for one in bare["copies"] if one["name"] != "JSON")


def test_numbers_chances_and_levels_keep_to_a_line_with_their_units():
    assert "<td>6\N{NO-BREAK SPACE}%</td>" in page_of()
    (row,) = screen_of(constants=(Constant("eta_s", 2e-7, (1e-7, 3e-7), "Pa s"),))["constants"]
    assert row[2].split(" ") == ["2\N{NO-BREAK SPACE}×\N{NO-BREAK SPACE}10⁻⁷", row[2][-4:]]
    named = replace(MELT.discrepancy, by_run={"a_b1p0.csv": 0.08})
    assert "a_<wbr>b1p0.csv" in page_of(discrepancy=named)
    gap, screen = "\N{NO-BREAK SPACE}", screen_of(failed="No law reaches the noise (p < 0.001).")
    assert f"(p{gap}<{gap}0.001)" in screen["quality"]
    assert f"ε{gap}={gap}0.82 (95{gap}%{gap}CI{gap}0.58" in screen["headline"]


def test_the_interval_comes_first_near_an_end_and_what_was_not_tested_behind_the_fit():
    skewed = Constant("epsilon", 0.80, (0.37, 0.82))
    assert skewed.text == "ε = 0.37–0.82 (95 % CI, best fit 0.80)"
    answer = replace(MELT, constants=(skewed, Constant("alpha", 0.2, (0.2, 0.4))))
    assert answer.headline.startswith(
        "Linear PTT, ε = 0.37–0.82 (95 % CI, best fit 0.80), α = 0.20–0.40 (best fit 0.20), 2 "
    )
    # the table gives the value that the equation has, for it goes with the other constants
    assert screen_of(answer)["constants"][0][2] == "0.80"
    top = Constant("alpha", 0.997, (0.93, 1.0))
    assert (top.number, top.in_equation) == ("0.997", 0.997)  # one number for one thing
    assert Constant("epsilon", 0.4, (0.17, 0.82)).text == "ε = 0.40 (95 % CI 0.17–0.82)"
    told = "Not tested on unseen runs."
    screen = screen_of(fits_to_the_noise=True, failed=told, tolerance=0.1)
    assert f"{told} Use for" in screen["quality"]
    assert "Not tested" not in screen["behind"]
