"""Effects that carry state or feel the stress, against analytic solutions and scipy."""

import numpy as np
import pytest
from independent import UpperConvectedMaxwell, oscillation
from independent.instruments import Instrument
from independent.named import material
from independent.noise import white
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from vectors import vector_of

from discover.dataset import Run
from discover.effects import RadialAverage, make_effect, named_effects
from discover.forward import AugmentedModel, DeclaredModel, data_scales, make_batch
from discover.protocols import oscillatory_shear, shear_rates, start_up

MODULUS, TIME = 100.0, 1.0
STEADY, OSCILLATION = 1.5, (1.2, 2.0)
TIMES = np.linspace(0.1, 8.0, 60)
FLOWS = (start_up(STEADY), oscillatory_shear(*OSCILLATION))


def make_run(name, flow):
    rate = shear_rates(flow, TIMES)
    return Run(name, TIMES, flow, rate, np.ones(len(TIMES)))


BATCH = make_batch([make_run(str(i), flow) for i, flow in enumerate(FLOWS)], strain_step=0.1)
MODEL = AugmentedModel(
    DeclaredModel.maxwell(MODULUS, TIME),
    list(named_effects().values()),
    {"stress": 100.0, "sampling_time": 0.1, "run_time": 8.0, "strain": 12.0},
)


def predict(**effects):
    return MODEL.predict(vector_of(MODEL, **effects), BATCH)


def maxwell_in_start_up(modulus, time, rate=STEADY):
    return modulus * time * rate * (1 - np.exp(-TIMES / time))


def oscillating_rate(t):
    return OSCILLATION[0] * np.cos(OSCILLATION[1] * t)


def integrate(slope, size, rate):
    solution = solve_ivp(
        lambda t, y: slope(y, rate(t)), (0, TIMES[-1]), np.zeros(size), t_eval=TIMES,
        method="DOP853", rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    return solution.y


# an error of the normal force leaves a shear stress as it is, and plates that of a Maxwell fluid:
# tests/inference/test_transducers.py
OF_SHEAR = sorted(
    name
    for name, one in named_effects().items()
    if not (getattr(one, "of_force", False) or isinstance(one, RadialAverage))
)


@pytest.mark.parametrize("name", OF_SHEAR)
def test_every_effect_changes_the_record_and_composes_with_another(name):
    size = 10 * MODEL.first_trial[MODEL.positions(name)[0]]
    size = min(size, 0.5 * MODEL.high[MODEL.positions(name)[0]])
    if name == "viscous_heating":
        # no fluid of 100 Pa is warmed like that; what is asked is the equation
        size = 0.1 / MODULUS
    alone = predict(**{name: size})
    assert np.all(np.isfinite(alone))
    assert np.max(np.abs(alone - predict())) > 1e-3 * MODULUS
    other = "stress_gain" if name != "stress_gain" else "stress_offset"
    both = predict(**{name: size, other: 0.1})
    assert np.max(np.abs(both - alone)) > 1e-3
    assert np.max(np.abs(both - predict(**{other: 0.1}))) > 1e-3


@pytest.mark.parametrize("slow", ["time_delay", "transducer_lag"])
def test_a_zero_of_the_transducer_stood_there_before_the_record(slow):
    times = np.linspace(0.0, 2.0, 21)
    run = Run("from_zero", times, start_up(STEADY), np.full(21, STEADY), np.ones(21))
    thetas = [vector_of(MODEL, **{slow: 0.05, "stress_offset": zero}) for zero in (0.0, 7.0)]
    without, with_zero = MODEL.predictions(thetas, make_batch([run]))
    # rounding alone; a zero that began with the record would be missing from the first sample
    np.testing.assert_allclose(with_zero - without, 7.0, atol=1e-9)


def test_an_extra_mode_adds_its_own_start_up():
    start = predict(relaxation_mode=(40.0, 0.3))[0]
    exact = maxwell_in_start_up(MODULUS, TIME) + maxwell_in_start_up(40.0, 0.3)
    np.testing.assert_allclose(start, exact, rtol=1e-6)


def test_slip_and_compliance_in_series_with_a_giesekus_fluid_that_has_a_solvent():
    slip, compliance, mobility, solvent = 0.003, 0.002, 0.3, 10.0
    oscillation = predict(
        wall_slip=slip, tool_compliance=compliance, giesekus_mobility=mobility,
        solvent_viscosity=solvent,
    )[1]  # fmt: skip
    # γ + Cσ is followed exactly where σ is a state: T = σ12 + η r, and r = γ̇ − sT − C dT/dt, so
    # that r obeys C η r' = γ̇ − s T − C σ12' − r

    def slope(y, rate):
        s11, s22, s33, s12, felt = y

        def relax(component, square):
            return -(component + mobility * square)

        d12 = felt * (1 + s22) + relax(s12, s12 * (s11 + s22))
        torque = MODULUS * s12 + solvent * felt
        # before the flow the torque was zero, so the felt rate starts at zero and rises fast
        change = (rate - slip * torque - compliance * MODULUS * d12 - felt) / (compliance * solvent)
        return [
            2 * felt * s12 + relax(s11, s11**2 + s12**2),
            relax(s22, s22**2 + s12**2),
            relax(s33, s33**2),
            d12,
            change,
        ]

    exact = integrate(slope, 5, oscillating_rate)
    torque = MODULUS * exact[3] + solvent * exact[4]
    np.testing.assert_allclose(oscillation, torque, atol=1e-2 * np.max(torque))


@pytest.mark.parametrize("name", ["viscous_heating", "softening_by_work"])
def test_heat_and_work_shorten_the_relaxation_times(name):
    heating, loss = 1e-3, 2.0
    start, oscillation = predict(**{name: (heating, loss)})

    def slope(y, rate):
        return [MODULUS * rate - y[0] * np.exp(y[1]) / TIME, heating * y[0] * rate - y[1] / loss]

    # second order in steps of 0.1 strain
    for record, rate in ((start, lambda t: STEADY), (oscillation, oscillating_rate)):
        exact = integrate(slope, 2, rate)[0]
        np.testing.assert_allclose(record, exact, atol=2e-3 * np.max(exact))
    assert start[-1] < 0.95 * maxwell_in_start_up(MODULUS, TIME)[-1]


def test_a_yield_stress_raises_the_steady_stress_as_saramito_says():
    start = predict(yield_stress=0.2)[0]
    exact = material("saramito", {"yield_strain": 0.2}, MODULUS, TIME).held(STEADY, TIMES)[:, 0, 1]
    np.testing.assert_allclose(start, exact, atol=1e-3 * np.max(exact))
    assert start[-1] > 1.05 * maxwell_in_start_up(MODULUS, TIME)[-1]


SLIP, INERTIA, FRICTION = 0.5 / (MODULUS * TIME), 15.0, 20.0


def recorded(**faults):
    """Return the record of a Maxwell fluid in the oscillation, on an instrument with faults."""
    flow = oscillation(*OSCILLATION)
    return Instrument(**faults).record(UpperConvectedMaxwell(MODULUS, TIME), flow, TIMES)


def test_inertia_and_friction_follow_the_tool_and_not_the_fluid_that_slips():
    record = predict(
        wall_slip=SLIP, instrument_inertia=INERTIA, bearing_friction=FRICTION
    )[1]  # fmt: skip
    exact = recorded(slip=SLIP, inertia=INERTIA, friction=FRICTION)
    # slip to second order, slopes by central differences, both in steps of 0.1 strain
    np.testing.assert_allclose(record, exact.stress, atol=0.01 * np.max(np.abs(exact.stress)))
    # the control: the rate that the fluid feels would miss by far more
    felt, stress = exact.felt_rate, exact.true.sigma12
    follows_fluid = stress + INERTIA * np.gradient(felt, TIMES) + FRICTION * np.sign(felt)
    assert np.sqrt(np.mean((follows_fluid - exact.stress) ** 2) / np.mean(stress**2)) > 0.1


@pytest.mark.parametrize(
    ("between", "faults"),
    [
        # a motor that lags moves the tool late
        ({"rate_rise_time": 0.4}, {"rise_time": 0.4}),
        # a wrong gap does not change what the tool does, and a soft tool moves where it is driven
        ({"rate_gain": 0.3}, {}),
        ({"tool_compliance": 0.004}, {}),
    ],
    ids=lambda value: next(iter(value), ""),
)
def test_the_tool_feels_what_is_upstream_of_it_alone(between, faults):
    added = predict(instrument_inertia=INERTIA, **between)[1] - predict(**between)[1]
    exact = recorded(inertia=INERTIA, **faults).stress - recorded(**faults).stress
    # central differences in steps of 0.08 s, of a rate that begins to rise; one-sided at the end
    np.testing.assert_allclose(added[:-1], exact[:-1], atol=0.02 * INERTIA * 2.4)


def test_a_correction_for_inertia_that_is_too_large_is_found():
    stress = white(recorded(inertia=-8.0).stress, 0.01, np.random.default_rng(1))
    run = Run("1", TIMES, FLOWS[1], oscillating_rate(TIMES), stress)
    name = "instrument_inertia"
    model = AugmentedModel(
        DeclaredModel.maxwell(MODULUS, TIME), [make_effect(name)], data_scales([run])
    )
    (at,), batch = model.positions(name), make_batch([run])
    unit = np.eye(len(model.zero()))[at]
    found = least_squares(
        lambda x: (model.predict(model.zero() + x * unit, batch) - batch.recorded).ravel(), 0.0
    )
    assert found.x[0] == pytest.approx(-8.0, rel=0.05)
