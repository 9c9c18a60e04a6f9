"""What is in no dictionary, found as a curve inside the model: on records by scipy alone."""

from types import SimpleNamespace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus, PhanThienTanner, PomPom, Thixotropic, WhiteMetzner
from independent.flow import start_up
from independent.folders import write_folder
from independent.instruments import JUDGE, NOISE, Instrument, curve_records

import discover as dc
from discover.closed_loop.beyond import free_in_model
from discover.closed_loop.search.seen_sets import SeenSet, SeenSets
from discover.effects import make_effect
from discover.effects.free_function import (
    FREE_BREAKDOWN,
    FREE_RELAXATIONS,
    INTERVALS,
    ONSET,
    spline_basis,
)
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.report.loop.verdict import loop_verdict

MODULUS, TIME = 100.0, 1.0
TIMES = np.linspace(0.05, 6.0, 80)
SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
EFFECTS = ["giesekus_mobility", "ptt_linear", "stress_gain", "stress_drift", "transducer_lag"]


def loop_on(folder, material, **flaws):
    """Return the loop on records of a material and the largest N1 of the fitted ones."""
    runs = curve_records(material, Instrument(**flaws))
    data = dc.load_dataset(write_folder(folder, runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(
        data, base, held_out=[JUDGE], effects=EFFECTS, max_effects=1, explanations=2
    )
    largest = max(np.max(run.true.N1) for name, run in runs.items() if name != JUDGE)
    return loop, largest


def held_in(found, true, widths=2.0):
    """Return the share of a curve that lies within some widths of its band."""
    half = (found.high95 - found.low95) / 2.0
    return np.mean(np.abs(found.value - true) <= widths * half + 1e-9)


@pytest.mark.slow
def test_a_relaxation_that_quickens_with_the_rate_is_found_as_that_function(tmp_path):
    loop, _ = loop_on(tmp_path, WhiteMetzner(0.5, 1.0, **SCALE))
    assert loop.verdict == "unexplained"
    found = loop.free_form[0]
    assert (found.slot, found.variable, found.beside) == ("relaxation", "rate of deformation", ())
    # 1/λ(γ̇) = (1 + (k λ γ̇)^(1−n))/λ   [White & Metzner 1963]
    assert held_in(found, found.grid**0.5) > 0.9
    assert found.nearest == "power"
    assert found.explains
    assert found.error.held_out < 1.5 * NOISE < loop.error_after.held_out
    said = loop_verdict(loop)[0]
    assert "a rate of relaxation that depends on the rate of deformation alone" in said


@pytest.mark.slow
def test_a_relaxation_that_quickens_with_the_stress_is_found_as_that_function(tmp_path):
    loop, first_normal = loop_on(tmp_path, PhanThienTanner(0.3, "exponential", 0.0, **SCALE))
    found = loop.free_form[0]
    assert (found.slot, found.variable) == ("relaxation", "trace of the stress")
    assert held_in(found, np.expm1(0.3 * found.grid)) > 0.9
    assert found.nearest == "exponential"
    # σ22 = σ33 = 0 in this law, so that tr σ is N1; further than that no record tells of it
    assert 0.5 < found.grid[-1] / (first_normal / MODULUS) < 1.05


@pytest.mark.slow
def test_slip_with_the_third_power_of_the_stress_is_found_as_that_function(tmp_path):
    strength = 0.4 / MODULUS**3
    loop, _ = loop_on(tmp_path, Giesekus(0.3, **SCALE), slip=strength, slip_power=3.0)
    found = loop.free_form[0]
    assert (found.slot, found.variable, found.unit) == ("slip", "stress", "Pa")
    assert found.beside == ("giesekus_mobility",)
    assert held_in(found, strength * found.grid**3) > 0.9
    assert found.nearest == "power"
    assert found.error.held_out < 1.5 * NOISE < loop.error_after.held_out


@pytest.mark.slow
def test_a_structure_that_the_square_of_the_rate_breaks_is_found_as_that_function(tmp_path):
    loop, _ = loop_on(tmp_path, Thixotropic(Giesekus(0.3, **SCALE), 0.03, 5.0, rate_power=2.0))
    found = loop.free_form[0]
    assert (found.slot, found.variable, found.beside) == (
        "breakdown", "shear rate", ("giesekus_mobility",),
    )  # fmt: skip
    assert held_in(found, 0.03 * found.grid**2) > 0.9
    assert found.nearest == "power"
    assert found.error.held_out < 1.5 * NOISE < loop.error_after.held_out
    assert "a structure that flow breaks" in loop_verdict(loop)[0]


@pytest.mark.slow
def test_a_fluid_that_stretches_is_no_function_of_one_variable(tmp_path):
    loop, _ = loop_on(tmp_path, PomPom(5.0, 0.4, **SCALE))
    assert loop.verdict == "unexplained"
    assert not any(one.explains for one in loop.free_form)


def runs_at(*rates, times=TIMES):
    return [
        dc.Run(f"{i}", times, dc.start_up(1.0), rate + 0.0 * times, 100.0 + 0.0 * times)
        for i, rate in enumerate(rates)
    ]


def variables(runs):
    """Return of what functions are tried in a model of one mode of 1 s."""
    declared = SimpleNamespace(relaxation_time=np.array([1.0]))
    search: Any = SimpleNamespace(model=SimpleNamespace(declared=declared))
    return {curve.effect.variable: curve.largest for curve in free_in_model._curves(search, runs)}


@pytest.mark.usefixtures("as_users_run_it")  # what stands for a search is none
def test_start_ups_at_a_few_rates_hold_no_function_of_the_rate_in_the_model():
    of_few = variables(runs_at(0.5, 1.0, 2.0))
    # upper convected Maxwell at Wi = 2 has a trace of 2 Wi²
    assert of_few == {"trace of the stress": 8.0, "stress": 100.0}
    # control: a wave goes through all rates between
    assert variables(runs_at(2.0 * np.cos(TIMES)))["rate of deformation"] == pytest.approx(
        2.0, rel=1e-4
    )


def test_a_function_of_the_rate_relaxes_a_fluid_as_white_and_metzner_have_it():
    rate, times = 2.0, np.linspace(0.05, 4.0, 40)
    fluid = WhiteMetzner(0.5, 1.0, **SCALE)
    (of_rate,) = (e for e in FREE_RELAXATIONS if e.variable == "rate of deformation")
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    model = AugmentedModel(declared, [of_rate])
    switch, largest, end, *coefficients = model.positions(of_rate.name)
    theta = model.zero()
    theta[[switch, largest, end]] = 1.0, 4.0, 4.0
    runs = make_batch([dc.Run("a", times, dc.start_up(rate), rate + 0.0 * times, 0.0 * times + 1)])
    maxwell = model.predict(theta, runs)[0]
    # 1/λ(γ̇) = (1 + (k λ γ̇)^(1−n))/λ   [White & Metzner 1963], at its knots
    grid = np.geomspace(0.05, 4.0, 60)
    basis = np.asarray(spline_basis(jnp.asarray(grid), 4.0, ONSET))
    theta[coefficients] = np.linalg.lstsq(basis, grid**0.5, rcond=None)[0]
    found = model.predict(theta, runs)[0]
    exact = fluid.respond(start_up(rate), times).sigma12
    # the spline is off by up to some thousandths of the root
    np.testing.assert_allclose(found, exact, rtol=1e-2)
    assert np.max(np.abs(maxwell / exact - 1.0)) > 0.5


def test_a_function_of_the_rate_breaks_a_structure_as_scipy_has_it():
    rate, times = 2.0, np.linspace(0.05, 4.0, 40)
    fluid = Thixotropic(Giesekus(0.3, **SCALE), 0.03, 5.0, rate_power=2.0)
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    model = AugmentedModel(declared, [make_effect("giesekus_mobility"), FREE_BREAKDOWN])
    switch, largest, end, *coefficients, build_up = model.positions(FREE_BREAKDOWN.name)
    theta = model.zero()
    theta[model.positions("giesekus_mobility")] = 0.3
    theta[[switch, largest, end, build_up]] = 1.0, 4.0, 4.0, 5.0
    theta[coefficients] = 0.0
    runs = make_batch([dc.Run("a", times, dc.start_up(rate), rate + 0.0 * times, 0.0 * times + 1)])
    sound = model.predict(theta, runs)[0]
    grid = np.linspace(0.0, 4.0, 60)
    basis = np.asarray(spline_basis(jnp.asarray(grid), 4.0, 4.0 * ONSET))
    theta[coefficients] = np.linalg.lstsq(basis, 0.03 * grid**2, rcond=None)[0]
    exact = fluid.respond(start_up(rate), times).sigma12
    # at γ̇ = 2 the spline of the square is off by up to a hundredth of it, the structure by less
    np.testing.assert_allclose(model.predict(theta, runs)[0], exact, rtol=1e-2)
    assert np.max(np.abs(sound / exact - 1.0)) > 0.2


@pytest.mark.parametrize("largest", [0.5, 20.0])
def test_the_spline_is_zero_at_rest_and_follows_any_smooth_function(largest):
    x = np.linspace(0.0, largest, 200)
    basis = np.asarray(spline_basis(jnp.asarray(x), largest, ONSET))
    assert basis.shape == (200, INTERVALS + 1)
    np.testing.assert_allclose(basis[0], 0.0, atol=1e-12)
    for function in (lambda x: x, np.sqrt, lambda x: np.log1p(x) ** 2):
        wanted = function(x)
        met = basis @ np.linalg.lstsq(basis, wanted, rcond=None)[0]
        # the root has no slope at zero that a spline could follow
        assert np.sqrt(np.mean((met - wanted) ** 2)) < 0.03 * np.max(wanted)


@pytest.mark.usefixtures("as_users_run_it")  # what stands for a search is none
def test_a_curve_is_tried_beside_what_did_best_alone_and_the_instrument_that_was_found():
    """What was found together may stand for the curve and hide the law beside it."""
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    fluids = ["giesekus_mobility", "ptt_linear", "ptt_exponential", "solvent_viscosity"]
    model = AugmentedModel(declared, [make_effect(n) for n in [*fluids, "transducer_lag"]])
    found, alone = model.zero(), []
    found[model.slices["transducer_lag"]] = 0.02
    for rank, name in enumerate(["transducer_lag", *fluids]):
        theta = model.zero()
        theta[model.slices[name]] = 0.1 * (rank + 1)
        free = tuple(model.positions(name))
        values = tuple(theta[list(free)])
        alone.append(SeenSet((name,), free, values, cost=float(rank)))
    search: Any = SimpleNamespace(
        model=model, active=["giesekus_mobility", "ptt_linear", "transducer_lag"],
        refused={"ptt_exponential"}, seen=SeenSets(alone), path=[model.zero()] * 3 + [found],
    )  # fmt: skip
    sets = free_in_model._sets(search)
    lag, mobility = "transducer_lag", "giesekus_mobility"
    assert [beside for beside, _ in sets] == [
        (), (lag,), (mobility, lag), ("ptt_linear", lag), ("solvent_viscosity", lag),
        (mobility, lag), ("ptt_linear", lag), (mobility, "ptt_linear", lag),
    ]  # fmt: skip
    _, alone = sets[2]
    assert alone[model.slices[mobility]] == pytest.approx(0.2)
    assert alone[model.slices[lag]] == pytest.approx(0.02)
    # of what was found each also begins where it is among the others
    for _, among in sets[5:]:
        np.testing.assert_array_equal(among, found)
