import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import Fluid, Giesekus, UpperConvectedMaxwell
from discover.protocols import measured_rate, oscillatory_shear, shear_rates, start_up
from discover.simulate import simulate

MODULUS, TIME = np.array([50.0, 120.0]), np.array([3.0, 0.05])
DECLARED = DeclaredModel.maxwell(MODULUS, TIME)
TIMES = np.linspace(0.1, 8.0, 60)


def make_run(name, protocol, stress=None, times=TIMES):
    rate = shear_rates(protocol, times)
    return Run(name, times, protocol, rate, np.ones(len(times)) if stress is None else stress)


def test_an_effect_in_the_model_is_the_law_with_that_term():
    model = AugmentedModel(DECLARED, [make_effect("giesekus_mobility"), make_effect("sigma")])
    theta = model.zero()
    theta[model.positions("giesekus_mobility")] = 0.4
    protocols = [start_up(2.0), oscillatory_shear(3.0, 1.2)]
    batch = make_batch([make_run(str(i), p) for i, p in enumerate(protocols)], strain_step=0.1)
    predicted = model.predict(theta, batch)
    for row, protocol in zip(predicted, protocols, strict=True):
        fluid = Fluid(Giesekus(0.4), jnp.asarray(MODULUS), jnp.asarray(TIME))
        reference = simulate(fluid, protocol, TIMES).shear_stress
        # fixed fourth-order steps of 0.1 strain
        np.testing.assert_allclose(row, reference, atol=1e-4 * np.max(np.abs(reference)))


@pytest.mark.slow
def test_a_slow_rise_of_the_rate_is_the_flow_with_that_rate():
    model = AugmentedModel(DECLARED, [make_effect("rate_rise_time")])
    theta = model.zero()
    theta[model.positions("rate_rise_time")] = 0.5
    batch = make_batch([make_run("a", start_up(1.5))], strain_step=0.05)
    dense = np.linspace(0.0, 8.0, 4001)
    flow = measured_rate(dense, 1.5 * (1 - np.exp(-dense / 0.5)))
    fluid = Fluid(UpperConvectedMaxwell(), jnp.asarray(MODULUS), jnp.asarray(TIME))
    reference = simulate(fluid, flow, TIMES).shear_stress
    # the early steps halve from the first sample, where the fast mode follows the rate
    np.testing.assert_allclose(
        model.predict(theta, batch)[0], reference, atol=2e-3 * np.max(reference)
    )


def test_runs_of_different_length_do_not_touch_each_other():
    effects = ["giesekus_mobility", "instrument_inertia", "tool_compliance"]
    model = AugmentedModel(DECLARED, [make_effect(name) for name in effects])
    short = make_run("short", start_up(1.0), times=np.array([0.5, 1.0]))
    long = make_run("long", start_up(5.0))
    theta = model.zero() + 0.0
    theta[model.positions("giesekus_mobility")] = 0.2
    # the rate is steady: no inertia, unless it were seen to stop where the padding starts
    theta[model.positions("instrument_inertia")] = 10.0
    alone = model.predict(theta, make_batch([short]))[0]
    together = model.predict(theta, make_batch([short, long]))[0][:2]
    np.testing.assert_allclose(together, alone, rtol=1e-9)


def giesekus_runs(mobility=0.3, rates=(0.5, 1.0, 2.0)):
    fluid = Fluid(Giesekus(mobility), jnp.asarray(MODULUS), jnp.asarray(TIME))
    runs = []
    for rate in rates:
        flow = start_up(rate)
        runs.append(make_run(f"{rate}", flow, simulate(fluid, flow, TIMES).shear_stress))
    return runs


def least_squares_at(model, batch, start, at):
    """Return the vector of least residuals by scipy, some of its parameters being free."""

    def placed(values):
        theta = start.copy()
        theta[list(at)] = values
        return theta

    low, high = model.low[list(at)], model.high[list(at)]
    found = least_squares(
        lambda values: (model.predict(placed(values), batch) - batch.recorded).ravel(),
        start[list(at)], bounds=(low, high), x_scale="jac",
    )  # fmt: skip
    return placed(found.x)


def test_a_fit_finds_the_parameter():
    model = AugmentedModel(DECLARED, [make_effect("giesekus_mobility")])
    batch = make_batch(giesekus_runs())
    at = model.positions("giesekus_mobility")
    start = model.zero()
    start[at] = 0.05
    assert least_squares_at(model, batch, start, at)[at[0]] == pytest.approx(0.3, abs=1e-3)


def test_free_parameters_of_the_declared_law_are_fitted():
    declared = DeclaredModel.named(
        "giesekus", {"alpha": 0.1}, 2.0 * MODULUS, TIME, free=("alpha", "modulus_Pa")
    )
    model = AugmentedModel(declared, [make_effect("stress_offset")])
    batch = make_batch(giesekus_runs())
    found = least_squares_at(model, batch, model.zero(), declared.free_positions)
    assert np.exp(found[0]) == pytest.approx(0.5, rel=1e-3)
    assert found[2] == pytest.approx(0.3, rel=5e-3)
