"""What is in no dictionary, found as a curve inside the model: on records by scipy alone."""

import jax.numpy as jnp
import numpy as np
import pytest
from discover.effects.free_function import (
    FREE_BREAKDOWN,
    FREE_RELAXATIONS,
    INTERVALS,
    ONSET,
    spline_basis,
)
from independent import Giesekus, Thixotropic, WhiteMetzner
from independent.flow import start_up

import discover as dc
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch

MODULUS, TIME = 100.0, 1.0
TIMES = np.linspace(0.05, 6.0, 80)
SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
EFFECTS = ["giesekus_mobility", "ptt_linear", "stress_gain", "stress_drift", "transducer_lag"]


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
