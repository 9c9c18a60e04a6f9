"""Two modes with constants of their own, one of them declared: a law by mode and no structure."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from independent import Giesekus, Modes, Thixotropic, oscillation, start_up
from independent.noise import rms

import discover as dc
from discover.forward import DeclaredModel
from discover.closed_loop.added_mode_apart import law_by_mode_instead, start_from
from discover.closed_loop.search import Search
from discover.closed_loop.searching import (
    NumericalResolution,
    SearchCheckpoint,
    ToleratedMisfit,
    admission,
)
from discover.dataset import Dataset, Run
from discover.effects import make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as starting
from discover.statistics.residual import Expectation

MODULI, TIMES = (60.0, 80.0), (3.0, 0.4)
EFFECTS = ["relaxation_mode", "giesekus_mobility", "thixotropy"]


def fluid(mobilities):
    return Modes(*(Giesekus(*of) for of in zip(mobilities, MODULI, TIMES, strict=True)))


NAMES = ("0.5", "2.0", "wave", "3.0")


def record(material, name, seed, noise=0.01):
    lot = np.random.default_rng([seed, NAMES.index(name)])
    if name == "wave":
        times = np.linspace(0.1, 12.0, 120)
        flow, protocol = oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0)
    else:
        times, rate = np.linspace(0.1, 8.0, 80), float(name)
        flow, protocol = start_up(rate), starting(rate)
    stress = material.respond(flow, times).sigma12
    stress = stress + noise * rms(stress) * lot.standard_normal(len(times))
    return Run(name, times, protocol, np.asarray(flow.rate(times)) + 0.0 * times, stress)


def found_in(material, seed=0):
    runs = tuple(record(material, name, seed) for name in NAMES)
    base = dc.Fluid(dc.make_law("ucm"), (100.0,), (1.0,))
    return dc.close_loop(
        Dataset("two modes", runs), base, free=["modulus_Pa", "relaxation_time_s"],
        held_out=["3.0"], effects=EFFECTS, explanations=1,
    )  # fmt: skip


@cache
def loop(mobilities):
    return found_in(fluid(mobilities))


def search_of(declared, runs):
    scales = data_scales(runs)
    model = AugmentedModel(declared, [make_effect(name) for name in EFFECTS], scales)
    batch = make_batch(runs)
    return Search(
        model, batch, None, len(EFFECTS), admission(runs, []),
        ToleratedMisfit(
            Expectation(None, declared.linear_error), NumericalResolution(model, batch, runs)
        ),
        SearchCheckpoint(None, "made up"),
    )  # fmt: skip


def found_by_hand(material, names):
    """A search that ends with these effects, fitted, and what is asked in the place of them."""
    runs = [record(material, name, 0) for name in NAMES[:3]]
    declared = DeclaredModel.maxwell(100.0, 1.0)
    declared = replace(declared, fit_modulus=True, fit_relaxation_time=True)
    search = search_of(declared, runs)
    search.start()
    model, theta = search.model, search.model.zero()
    # near the two modes, so that no search is needed
    theta[:2] = np.log([MODULI[0] / 100.0, TIMES[0]])
    theta[model.positions("relaxation_mode")] = MODULI[1], TIMES[1]
    theta[model.positions("giesekus_mobility")] = 0.3
    if "thixotropy" in names:
        theta[model.positions("thixotropy")] = 0.05, 2.0
    search.take(search.fitted(names, theta), names)
    return search, runs, law_by_mode_instead(search, 3, data_scales(runs))


def test_a_law_by_mode_takes_the_place_of_a_structure_that_stood_for_the_second_mobility():
    search, runs, instead = found_by_hand(fluid((0.1, 0.5)), EFFECTS)
    assert search.explained  # by what is not there
    assert instead is not None
    assert (instead.name, set(instead.effects)) == ("giesekus_mobility", set(EFFECTS[:2]))
    assert instead.is_likelier
    # a search that begins with it ends with it
    again = search_of(instead.model.declared, runs)
    again.start(by_mode=False)
    start_from(again, search, instead)
    assert set(again.active) == set(EFFECTS[:2])
    assert again.degrees["giesekus_mobility"].degree == 1


def test_control_no_law_by_mode_takes_the_place_of_what_is_there():
    assert found_by_hand(fluid((0.3, 0.3)), EFFECTS[:2])[-1] is None
    broken = Thixotropic(fluid((0.3, 0.3)), 0.1, 4.0)
    assert found_by_hand(broken, EFFECTS)[-1] is None


@pytest.mark.slow
@pytest.mark.parametrize("mobilities", [(0.1, 0.5), (0.15, 0.6)])
def test_mobilities_of_their_own_are_no_structure(mobilities):
    # with all candidates a structure at 89 % stood in the place of the second mobility
    result = loop(mobilities)
    assert result.verdict == "effects_added"
    assert {stage.effect for stage in result.stages} == {"relaxation_mode", "giesekus_mobility"}
    assert result.explanations.inclusion.get("thixotropy", 0.0) < 0.5
    alpha = result.by_mode["giesekus_mobility"]
    assert alpha.degree == 1
    for mode, mobility, time in zip(alpha.modes, mobilities, TIMES, strict=True):
        low, high = mode.ci95
        # twice the interval: of four of 95 % one may miss
        assert low - 0.5 * (high - low) <= mobility <= high + 0.5 * (high - low)
        assert mode.relaxation_time_s == pytest.approx(time, rel=0.15)


@pytest.mark.slow
def test_one_mobility_of_both_modes_stays_one():
    result = loop((0.3, 0.3))
    assert {stage.effect for stage in result.stages} == {"relaxation_mode", "giesekus_mobility"}
    assert not result.differing_by_mode
    mobility = next(s for s in result.stages if s.effect == "giesekus_mobility")
    alpha = mobility.parameters["alpha"]
    assert alpha.value == pytest.approx(0.3, rel=0.05)
    # what the runs say of each mode is told beside it
    for mode in alpha.modes:
        low, high = mode.ci95
        assert low - 0.5 * (high - low) <= 0.3 <= high + 0.5 * (high - low)


@pytest.mark.slow
def test_mobilities_that_differ_by_less_than_evidence_tells_are_in_the_intervals():
    # one mobility leaves noise, and that of the fast mode is outside of its interval
    first, second = 0.3, 0.37
    result = loop((first, second))
    assert result.verdict == "effects_added"
    alpha = result.by_mode["giesekus_mobility"]
    for mode, mobility in zip(alpha.modes, (first, second), strict=True):
        low, high = mode.ci95
        assert low - 0.5 * (high - low) <= mobility <= high + 0.5 * (high - low)
    if not alpha.degree:
        low, high = alpha.ci95_given_effects
        assert not low < second < high


@pytest.mark.slow
def test_a_structure_that_is_there_is_named_beside_two_modes():
    result = found_in(Thixotropic(fluid((0.3, 0.3)), 0.1, 4.0))
    assert "thixotropy" in {stage.effect for stage in result.stages}
    assert result.explanations.inclusion["thixotropy"] > 0.5
    assert not result.differing_by_mode


def test_an_added_mode_has_the_constant_of_its_own_time():
    # stresses by scipy, each mode with its mobility
    declared = DeclaredModel.maxwell(
        MODULI[:1], TIMES[:1], by_mode=("giesekus_mobility",), added_modes=1
    )
    model = AugmentedModel(
        declared, [make_effect("relaxation_mode"), make_effect("giesekus_mobility")]
    )
    theta = model.zero()
    theta[model.positions("relaxation_mode")] = MODULI[1], TIMES[1]
    theta[model.positions("giesekus_mobility")] = 0.1
    logits = np.log(0.5 / 0.5) - np.log(0.1 / 0.9)
    theta[model.varying("giesekus_mobility")[0]] = logits / np.log10(TIMES[1] / TIMES[0])
    run = record(fluid((0.1, 0.5)), "2.0", 0, noise=0.0)
    predicted = model.predict(theta, make_batch([run], strain_step=0.05))[0]
    # the integrator's error on such steps
    np.testing.assert_allclose(predicted, run.stress, atol=1e-3 * np.max(run.stress))
    # and without the mode the constant is that of the one declared, whatever the coefficient
    theta[model.positions("relaxation_mode")[0]] = 0.0
    alone = model.predict(theta, make_batch([run], strain_step=0.05))[0]
    single = record(Giesekus(0.1, MODULI[0], TIMES[0]), "2.0", 0, noise=0.0)
    np.testing.assert_allclose(alone, single.stress, atol=1e-3 * np.max(single.stress))


def test_constants_of_one_mode_differ_from_nothing():
    with pytest.raises(InputError, match="one mode"):
        DeclaredModel.maxwell(MODULI[:1], TIMES[:1], by_mode=("giesekus_mobility",))
