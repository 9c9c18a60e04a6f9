"""Every effect at work in the one compiled model, against solutions found without it."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discover.closed_loop import DeclaredModel
from discover.closed_loop.augmented_model import AugmentedModel, make_batch
from discover.dataset import ShearRun
from discover.effects import library_effects, named_effects
from discover.protocols import oscillatory_shear, start_up

# the second mode is faster than the steps of the slow run
MODULUS, TIME = np.array([50.0, 120.0]), np.array([3.0, 0.05])
TIMES = np.linspace(0.1, 8.0, 60)
FLOWS = {"fast": start_up(2.0), "slow": start_up(0.02), "laos": oscillatory_shear(1.5, 1.2)}
NAMED = list(named_effects().values())
# large enough to be seen, in units of the parameter
SIZES = {
    "relaxation_mode": 30.0,
    "solvent_viscosity": 5.0,
    "tool_compliance": 2e-3,
    "wall_slip": 2e-3,
    "viscous_heating": 1e-3,
}


@pytest.fixture(scope="module")
def model():
    return AugmentedModel(
        DeclaredModel.maxwell(MODULUS, TIME), [*NAMED, *library_effects(degree=0)]
    )


@pytest.fixture(scope="module")
def batch():
    runs = []
    for name, flow in FLOWS.items():
        rate = np.array([float(flow.shear_rate(jnp.asarray(t))) for t in TIMES])
        runs.append(ShearRun(name, TIMES, flow, rate, np.ones(len(TIMES))))
    return make_batch(runs, strain_step=0.04)


@pytest.fixture(scope="module")
def predict(model, batch):
    def predicted(**values):
        theta = model.zero()
        for name, value in values.items():
            given = np.atleast_1d(value)
            theta[model.positions(name)[: len(given)]] = given
        return dict(zip(FLOWS, model.predict(theta, batch), strict=True))

    return predicted


def reference(
    flow,
    alpha=0.0,
    modes=(),
    viscosity=0.0,
    compliance=0.0,
    slip=0.0,
    thixotropy=(0.0, 1.0),
    heating=(0.0, 1.0),
    gain=0.0,
):
    """Return σ12 of a Giesekus fluid with states, in series with a spring and a slipping wall."""
    modulus = np.array([*MODULUS, *(m[0] for m in modes)])
    time = np.array([*TIME, *(m[1] for m in modes)])
    k = len(modulus)

    def command(t):
        return (1.0 + gain) * float(flow.shear_rate(jnp.asarray(t)))

    def parts(t, y):
        s11, s22, s12 = y[: 3 * k].reshape(3, k)
        broken, theta, twist = y[3 * k :]
        clock = np.exp(theta) / (1.0 - broken) / time
        relax = -clock * (s12 + alpha * s12 * (s11 + s22))
        modes_stress = modulus @ s12
        if compliance and viscosity:
            # the twist is a state of its own: the dashpot lets the stress not jump
            stress = twist / compliance
            rate = (stress - modes_stress) / viscosity
        else:
            free = command(t) - slip * modes_stress - compliance * (modulus @ relax)
            tangent = compliance * (modulus @ (1.0 + s22))
            rate = free / (1.0 + tangent + slip * viscosity)
            stress = modes_stress + viscosity * rate
        return s11, s22, s12, broken, theta, clock, relax, rate, stress

    def slope(t, y):
        s11, s22, s12, broken, theta, clock, relax, rate, stress = parts(t, y)
        change = [
            2.0 * rate * s12 - clock * (s11 + alpha * (s11**2 + s12**2)),
            -clock * (s22 + alpha * (s22**2 + s12**2)),
            rate * (1.0 + s22) + relax,
        ]
        breakdown = thixotropy[0] * abs(rate)
        states = [
            breakdown * (1.0 - broken) - broken / thixotropy[1],
            heating[0] * stress * rate - theta / heating[1],
            command(t) - rate - slip * stress,
        ]
        return np.concatenate([*change, states])

    solution = solve_ivp(
        slope, (0.0, TIMES[-1]), np.zeros(3 * k + 3), "BDF", TIMES, rtol=1e-7, atol=1e-9
    )
    return np.array([parts(t, y)[-1] for t, y in zip(TIMES, solution.y.T, strict=True)])


def maxwell(rate, modulus=MODULUS, time=TIME):
    return np.sum(modulus * time * rate * -np.expm1(-TIMES[:, None] / time), axis=1)


def close(predicted, expected, tolerance):
    np.testing.assert_allclose(predicted, expected, atol=tolerance * np.max(np.abs(expected)))


def test_the_model_with_all_effects_off_is_the_declared_one(predict):
    predicted = predict()
    # a Maxwell mode is linear in shear, where the method is exact
    close(predicted["fast"], maxwell(2.0), 1e-10)
    close(predicted["slow"], maxwell(0.02), 1e-10)


@pytest.mark.parametrize("effect", NAMED, ids=lambda e: e.name)
def test_at_zero_amplitude_no_inner_parameter_matters_and_at_another_the_record_changes(
    effect, predict
):
    inner = [2.3 * p.first_trial for p in effect.parameters[1:]]
    off, without = predict(**{effect.name: [0.0, *inner]}), predict()
    on = predict(**{effect.name: [SIZES.get(effect.name, 0.1), *inner]})
    for name in FLOWS:
        np.testing.assert_array_equal(off[name], without[name])
    change = max(np.max(np.abs(on[n] - without[n])) / np.max(np.abs(without[n])) for n in FLOWS)
    assert np.isfinite(change)
    assert change > 1e-3


def test_an_extra_mode_is_maxwell_with_one_more_mode(predict):
    modulus, time = np.array([*MODULUS, 30.0]), np.array([*TIME, 0.7])
    predicted = predict(relaxation_mode=[30.0, 0.7])
    close(predicted["fast"], maxwell(2.0, modulus, time), 1e-10)
    close(predicted["slow"], maxwell(0.02, modulus, time), 1e-10)


def test_an_extra_mode_obeys_the_nonlinear_law_of_the_others(predict):
    predicted = predict(relaxation_mode=[30.0, 0.7], giesekus_mobility=0.3)["fast"]
    close(predicted, reference(FLOWS["fast"], alpha=0.3, modes=[(30.0, 0.7)]), 1e-5)


@pytest.mark.parametrize("flow", FLOWS)
def test_a_compliant_tool_is_a_spring_in_series(flow, predict):
    predicted = predict(tool_compliance=3e-3)[flow]
    # second-order in the step; without the spring the fast run is off by 40 %
    close(predicted, reference(FLOWS[flow], compliance=3e-3), 3e-3)


def test_a_spring_in_series_with_one_maxwell_mode_lowers_its_modulus_and_not_its_viscosity():
    one = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [named_effects()["tool_compliance"]])
    run = ShearRun("a", TIMES, start_up(1.0), np.ones(len(TIMES)), np.ones(len(TIMES)))
    theta = np.array([0.0, 0.0, 0.02])
    slowed = 1.0 + 0.02 * 100.0
    predicted = one.predict(theta, make_batch([run], strain_step=0.02))[0]
    close(predicted, 100.0 * -np.expm1(-TIMES / slowed), 1e-3)


@pytest.mark.parametrize("flow", FLOWS)
def test_slip_at_the_wall_takes_rate_in_proportion_to_the_stress(flow, predict):
    predicted = predict(wall_slip=4e-3)[flow]
    close(predicted, reference(FLOWS[flow], slip=4e-3), 3e-3)


@pytest.mark.parametrize("flow", ["fast", "laos"])
def test_a_structure_that_breaks_thins_the_fluid_with_strain(flow, predict):
    predicted = predict(thixotropy=[0.3, 2.0])[flow]
    close(predicted, reference(FLOWS[flow], thixotropy=(0.3, 2.0)), 3e-3)


def test_heat_thins_the_fast_flow_and_leaves_the_slow_one_alone(predict):
    heated, cold = predict(viscous_heating=[1e-3, 4.0]), predict()
    close(heated["fast"], reference(FLOWS["fast"], heating=(1e-3, 4.0)), 3e-3)
    assert heated["fast"][-1] < 0.8 * cold["fast"][-1]
    close(heated["slow"], cold["slow"], 1e-3)


def test_a_yield_stress_is_what_remains_at_low_rate(predict):
    stress = predict(yield_stress=[40.0, 0.01])["slow"]
    close(stress, maxwell(0.02) + 40.0 * -np.expm1(-0.02 * TIMES / 0.01), 1e-10)
    # the modes alone would give 3 Pa
    assert 40.0 < stress[-1] < 44.0


def test_a_drift_grows_linearly_with_time(predict):
    drifted, without = predict(stress_drift=2.0), predict()
    for name in FLOWS:
        np.testing.assert_allclose(drifted[name] - without[name], 2.0 * TIMES, atol=1e-9)


@pytest.mark.parametrize("flow", ["fast", "laos"])
def test_effects_compose(flow, predict):
    predicted = predict(
        giesekus_mobility=0.3,
        relaxation_mode=[30.0, 0.7],
        tool_compliance=2e-3,
        wall_slip=2e-3,
        thixotropy=[0.1, 2.0],
        viscous_heating=[5e-4, 4.0],
        rate_gain=0.1,
    )[flow]
    expected = reference(
        FLOWS[flow],
        alpha=0.3,
        modes=[(30.0, 0.7)],
        compliance=2e-3,
        slip=2e-3,
        thixotropy=(0.1, 2.0),
        heating=(5e-4, 4.0),
        gain=0.1,
    )
    close(predicted, expected, 5e-3)


def test_a_compliant_tool_cannot_jump_against_a_solvent(predict):
    predicted = predict(tool_compliance=3e-3, solvent_viscosity=5.0)["fast"]
    close(predicted, reference(FLOWS["fast"], compliance=3e-3, viscosity=5.0), 1e-2)
