"""Numbers, letters, axes, terms and effects as readers see them: in words and as formulas."""

import pytest
from matplotlib.figure import Figure

from discover.effects import library_effects, named_effects
from discover.effects.library_term import library_term
from discover.report.mathtext import formula, plain
from discover.report.plots.style import make_percentage
from discover.report.wording import percent, percent_range
from discover.words import estimate, interval, percent_of, readable, significant
from tensor_library.terms import parse_term


def test_numbers_keep_what_tells_them_apart():
    assert interval((0.20001, 0.20002)) == "0.20001 to 0.20002"
    assert percent(None) == significant(None) == interval(None) == "–"
    assert percent(0.1234) == "12 %"
    assert percent(2.4) == percent_of(2.4) == "240 %"
    assert significant(-0.5) == "−0.5"
    assert significant(1411.0, 3) == "1410"
    assert significant(1.606e-5) == "1.606 × 10⁻⁵"
    assert percent_range([0.01, 0.05]) == " (1 to 5 %)"
    assert interval((0.19, 0.21)) == "0.19 to 0.21"
    assert percent_range([0.01]) == percent_range(None) == ""


@pytest.mark.parametrize(
    ("value", "bounds", "shown", "between"),
    [
        (8.394, (4.804, 11.98), "8.4", "4.8 to 12"),
        (0.19987, (0.1991, 0.2007), "0.1999", "0.1991 to 0.2007"),
        (66.65, (0.0, 231.9), "67", "0 to 230"),
        (1.606e-5, (9.202e-6, 2.292e-5), "1.6 × 10⁻⁵", "(0.9 to 2.3) × 10⁻⁵"),
        (0.0, (-1e-3, 2e-3), "0", "−0.001 to 0.002"),
        (1.0, (1.0, 1.0), "1", "1 to 1"),
    ],
)
def test_an_estimate_has_the_digits_that_its_interval_leaves_it(value, bounds, shown, between):
    assert estimate(value, bounds) == shown
    assert interval(bounds) == between
    assert estimate(value, None) == significant(value)


def test_axes_of_per_cents_have_plain_numbers_and_more_of_them_where_they_are_short():
    def labels(low, high):
        axes = Figure().subplots()
        axes.plot([1, 2], [low, high])
        make_percentage(axes.yaxis)
        axes.figure.draw_without_rendering()
        ticks = (*axes.yaxis.get_majorticklabels(), *axes.yaxis.get_minorticklabels())
        return {tick.get_text() for tick in ticks}

    assert {"5", "10", "20"} <= labels(4.0, 30.0)
    assert {"30", "40"} <= labels(23.0, 47.0)  # neither a decade nor a 2 or a 5
    long = labels(0.01, 200.0)
    assert {"0.01", "1", "100"} <= long
    assert "20" not in long


def test_a_formula_is_read_aloud_as_it_is_written_and_one_that_cannot_be_set_is_text():
    assert formula(r"\alpha\,\sigma", "a").startswith("<svg")
    assert formula(r"\nonsense{<b>}", "b") == "<code>nonsense&lt;b&gt;</code>"
    assert plain(r"\sigma \mathrel{+}= \frac{Y}{t_\mathrm{b}}\,\dot\gamma") == "σ += Y/(t_b) γ̇"
    assert (
        plain(r"h - (e^{\varepsilon\,\mathrm{tr}\,\boldsymbol{\sigma}} - 1)")
        == "h - (e^(ε tr σ) - 1)"
    )


@pytest.mark.parametrize(
    "effect",
    [
        *named_effects().values(),
        *library_effects()[:3],
        library_term(parse_term("tr(sigma)^2*(sigma.gammadot+gammadot.sigma)")),
    ],
    ids=lambda e: e.name,
)
def test_every_effect_is_set_as_a_formula_and_no_latex_is_left_of_it(effect):
    for latex in (effect.equation, *(parameter.symbol for parameter in effect.parameters)):
        drawn = formula(latex, "a")
        assert drawn.startswith("<svg")
        assert "\\" not in drawn
        assert not set(plain(latex)) & set("\\{}$")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("alpha of the alphabet, xi, maximal", "α of the alphabet, ξ, maximal"),
        (
            "0.5 tr(sigma.gammadot)*I + sigma.sigma, whatever the law.",
            "0.5 tr(σ·γ̇) I + σ·σ, whatever the law.",
        ),
    ],
)
def test_words_keep_their_letters_full_stops_and_decimal_points(words, said):
    assert readable(words) == said
