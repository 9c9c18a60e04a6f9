"""Constants of many modes that no smooth function of the relaxation time describes, by scipy."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from discover.inference.by_mode.as_fitted import constants_by_mode
from discover.inference.by_mode.degrees import FREE, Degree, choose_degrees, one_degree_more
from discover.inference.by_mode.draws import draw_constants
from discover.inference.by_mode.varying_constant import freer_fits
from modes_in_start_up import noisy_start_ups

from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.inference.by_mode import degrees as of_degrees
from discover.inference.fit_uncertainty import intervals
from discover.inference.problem import FitProblem

pytestmark = pytest.mark.usefixtures("optimised")

MODULI = np.array([300.0, 200.0, 100.0, 60.0, 30.0])
TIMES = np.array([0.03, 0.15, 0.7, 3.0, 15.0])
RATES = (0.1, 0.3, 1.0, 4.0, 15.0, 60.0)
NAME = "giesekus_mobility"
ROUGH, SMOOTH = (0.1, 0.3, 0.15, 0.35, 0.2), (0.1, 0.2, 0.3, 0.4, 0.5)


@cache
def problem(mobilities, rates=RATES):
    runs = noisy_start_ups(mobilities, MODULI, TIMES, rates, 20.0, seed=1)
    declared = DeclaredModel.maxwell(MODULI, TIMES, by_mode=(NAME,))
    model = AugmentedModel(declared, [make_effect(NAME)], data_scales(runs))
    return FitProblem(model, make_batch(runs))


@cache
def chosen(mobilities, least=0, rates=RATES):
    asked = problem(mobilities, rates)
    at = asked.model.positions(NAME)
    start = asked.model.zero()
    start[at] = 0.2
    return choose_degrees(asked, asked.fit(start, at), {NAME: Degree()}, {NAME: least})


def constants(mobilities, least=0, rates=RATES):
    asked, (fit, degrees) = problem(mobilities, rates), chosen(mobilities, least, rates)
    model, batch = asked.model, asked.batch
    freer = freer_fits(model, batch, fit, degrees)
    bounds = intervals(model, batch, fit)
    found = constants_by_mode(model, batch, fit, bounds, degrees, freer)[NAME]
    return found, draw_constants(asked, fit, degrees, freer, 20)


def held(mode, truth):
    """95 % intervals, widened by half: five of them must hold at once."""
    low, high = mode.ci95
    return low - (high - low) / 4 < truth < high + (high - low) / 4


def test_each_mode_that_the_runs_tell_has_a_constant_of_its_own():
    found, drawn = constants(ROUGH)
    assert found.degree == FREE
    assert found.n_constants == len(ROUGH)
    assert found.evidence[FREE] > found.evidence[2] + 6.0  # strong evidence over a parabola
    for mode, truth in zip(found.modes, ROUGH, strict=True):
        assert held(mode, truth)
        assert mode.value == pytest.approx(truth, rel=0.1)
    # laws drawn are those of the intervals
    assert drawn.values[0, 0] == pytest.approx([mode.value for mode in found.modes], rel=1e-6)


def test_control_a_smooth_function_keeps_its_few_constants_and_its_intervals_hold_all_the_same():
    """The mobility is a line in log λ and its link nearly a parabola: that alone missed two."""
    found, drawn = constants(SMOOTH)
    assert found.degree == 2
    assert found.n_constants == 3
    assert not found.is_raised
    assert all(held(mode, truth) for mode, truth in zip(found.modes, SMOOTH, strict=True))
    # the free fit is one more group of laws
    assert len(drawn.sizes) == 2


@pytest.mark.slow
def test_a_mode_that_no_run_tells_is_left_open_and_follows_the_others():
    found, _ = constants(ROUGH, rates=(0.03, 0.1, 0.3, 1.0))
    assert found.modes[0].left_open
    assert not found.modes[-1].left_open
    told = [pair for pair in zip(found.modes, ROUGH, strict=True) if not pair[0].left_open]
    assert all(held(mode, truth) for mode, truth in told)


@pytest.mark.slow
def test_a_lower_degree_that_was_refuted_gives_way_to_the_next(monkeypatch):
    """Which is fitted to the same runs; evidence there would be content with less."""
    monkeypatch.setattr(of_degrees, "BARE_MENTION", 100.0)
    chosen.cache_clear()
    model = problem(SMOOTH).model
    _, first = chosen(SMOOTH)
    assert first[NAME].degree == 1
    least = one_degree_more(model, first)
    assert least == {NAME: 2}
    _, second = chosen(SMOOTH, least[NAME])
    assert (second[NAME].degree, second[NAME].is_raised) == (2, True)
    _, third = chosen(SMOOTH, one_degree_more(model, second)[NAME])
    assert third[NAME].degree == FREE
    assert third[NAME].own
    assert one_degree_more(model, third) == {}
    chosen.cache_clear()


def without_numbers(fit):
    return replace(fit, residual=np.full_like(fit.residual, np.nan))


def test_where_no_degree_can_be_integrated_the_constant_stays_as_it_was(monkeypatch):
    """Beside another constant by mode each may run away, as in the polyisoprene melt."""
    asked, (fit, degrees) = problem(SMOOTH), chosen(SMOOTH)
    whole = FitProblem.fits
    monkeypatch.setattr(
        FitProblem, "fits", lambda *a, **how: [*map(without_numbers, whole(*a, **how))]
    )
    assert choose_degrees(asked, fit, degrees) == (fit, degrees)


def test_where_one_constant_for_all_modes_runs_away_the_others_are_compared(monkeypatch):
    asked, (fit, degrees) = problem(SMOOTH), chosen(SMOOTH)
    plain = FitProblem.fit
    monkeypatch.setattr(FitProblem, "fit", lambda *a: without_numbers(plain(*a)))
    found, again = choose_degrees(asked, fit, degrees)
    assert found.usable
    assert again[NAME].degree == 2
    assert again[NAME].evidence[0] == -np.inf
