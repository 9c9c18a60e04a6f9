"""Many vectors at once, at a given stress, in steady states, in sweeps and from periodic starts."""

from dataclasses import replace

import numpy as np
import pytest
from fluids_with_effects import effects_in, fluid_with
from independent.homogeneous import UNIT, GiesekusFluid
from independent.sweeps import giesekus_modulus, modulus_of, strain_at
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from vectors import sweep_of, vector_of, vectors_of_each

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import oscillatory_shear, start_up, steady_rates
from discover.protocols.control import imposed_stress
from discover.protocols.history import after_alternation
from discover.protocols.protocol import in_flow

MODULI, TIMES, MOBILITY, SOLVENT = np.array([60.0, 20.0]), np.array([0.1, 2.0]), 0.3, 1.0
DECLARED = DeclaredModel.maxwell(MODULI, TIMES, solvent_viscosity=SOLVENT)
MODES = list(zip(MODULI.tolist(), TIMES.tolist(), strict=True))


def model_with(names, declared=DECLARED):
    return AugmentedModel(declared, list(map(make_effect, names)))


WHEN = np.linspace(0.05, 6.0, 60)
IN_CREEP = (
    "giesekus_mobility", "thixotropy", "viscous_heating", "tool_compliance", "wall_slip",
    "instrument_inertia", "stress_gain", "relaxation_mode",
)  # fmt: skip


def at_stress(name, stress, kind="shear"):
    times = np.append(0.0, WHEN)
    protocol = imposed_stress(times, np.array([stress(t) for t in times]))
    ones = np.ones(WHEN.size)
    return Run(name, WHEN, in_flow(protocol, kind), 0.0 * ones, ones, strain=ones)


def wave(t):
    return 15.0 * np.sin(2.0 * t)


CREEP = [at_stress("shear", wave), at_stress("uniaxial", wave, "uniaxial")]


@pytest.fixture(scope="module")
def in_creep():
    model = model_with(IN_CREEP)
    return model, make_batch(CREEP), vectors_of_each(model, IN_CREEP)


def by_scipy(kind):
    """Return strain, N1 and N2: what the solvent is left with decides the rate."""
    unit, trouton = UNIT[kind], {"shear": 1.0, "uniaxial": 3.0}[kind]
    law = fluid_with({"giesekus_mobility": [MOBILITY]}, MODES)

    def rate_of(t, state):
        total = law.stress(state, 0.0)
        seen = total[0, 1] if kind == "shear" else total[0, 0] - total[1, 1]
        return (wave(t) - seen) / (SOLVENT * trouton)

    def slope(t, y):
        rate = rate_of(t, y[1:])
        return np.append(rate, law.change(y[1:], rate * unit))

    start = np.append(0.0, law.rest())
    found = solve_ivp(slope, (0.0, WHEN[-1]), start, "LSODA", WHEN, rtol=1e-8, atol=1e-8).y.T
    values = []
    for t, y in zip(WHEN, found, strict=True):
        rate = rate_of(t, y[1:]) * unit
        total = law.stress(y[1:], 0.0) + SOLVENT * (rate + rate.T)
        values.append([y[0], total[0, 0] - total[1, 1], total[1, 1] - total[2, 2]])
    return np.array(values)


def test_strains_and_normal_stresses_in_creep_are_those_of_full_tensors(in_creep):
    model, batch, _ = in_creep
    thetas = [vector_of(model, giesekus_mobility=share * MOBILITY) for share in (1.0, 0.5)]
    found, wrong = model.observables(thetas, batch)
    for own, off, run in zip(found, wrong, CREEP, strict=True):
        expected = by_scipy(run.name)
        largest = np.maximum(np.max(np.abs(expected), axis=0), 1.0)
        # the error of the steps, and of the wave between its samples
        np.testing.assert_allclose(own / largest, expected / largest, atol=5e-4)
        # negative control: another mobility is told apart
        assert np.max(np.abs(off - expected) / largest) > 2e-3


def with_inertia(inertia):
    """Return the strain of Maxwell modes and a solvent behind I γ̈: all of it is linear."""

    def change(t, y):  # stresses of the modes, the rate, the strain
        own, rate = y[:2], y[2]
        left = wave(t) - np.sum(own) - SOLVENT * rate
        return [*(MODULI * rate - own / TIMES), left / inertia, rate]

    return solve_ivp(change, (0.0, WHEN[-1]), np.zeros(4), "Radau", WHEN, rtol=1e-8).y[3]


def test_effects_in_creep_follow_their_equations(in_creep):
    model, batch, thetas = in_creep
    found = model.predictions(thetas, batch)
    for strain, theta in zip(found[1:, 0], thetas[1:], strict=True):
        effects = effects_in(model, theta, IN_CREEP)
        ((name, (value, *_)),) = effects.items()
        if name == "instrument_inertia":
            exact = with_inertia(value)
        else:
            given = 1.0 / (1.0 + value) if name == "stress_gain" else 1.0
            levels = [(0.0, lambda t, given=given: given * wave(t))]
            exact = strain_at(fluid_with(effects, MODES), levels, SOLVENT, WHEN)
        if name == "tool_compliance":
            exact = exact + value * wave(WHEN)
        if name == "wall_slip":
            exact = exact + value * 7.5 * (1.0 - np.cos(2.0 * WHEN))  # ∫ 15 sin 2t dt
        # the error of the steps, and of the wave between its samples
        np.testing.assert_allclose(strain, exact, atol=1e-3 * np.max(np.abs(exact)))
    # and not because effects do nothing
    largest = np.max(np.abs(found[0, 0]))
    assert np.min(np.max(np.abs(found[1:, 0] - found[0, 0]) / largest, axis=1)) > 1e-7


RATES, SLOW = np.geomspace(0.01, 300.0, 13), np.geomspace(0.01, 3.0, 5)
ON_CURVES = "ptt_exponential", "thixotropy", "wall_slip", "bearing_friction", "rate_gain"


def curve(name, protocol, rates):
    return Run(name, 1.0 + np.arange(len(rates)), protocol, rates, np.full(len(rates), 50.0))


@pytest.fixture(scope="module")
def on_curves():
    """Return a model, flow curves in shear and extension, and vectors."""
    model = model_with(ON_CURVES)
    extension = curve("extension", in_flow(steady_rates(SLOW), "uniaxial"), SLOW)
    batch = make_batch([curve("shear", steady_rates(RATES), RATES), extension])
    tried = (), ("ptt_exponential",), ("wall_slip",), ON_CURVES
    return model, batch, np.array([vector_of(model, *names) for names in tried])


def ptt(rate, time, epsilon, extends):
    """Return the recorded stress over the modulus: f = exp(ε tr σ) is the one unknown."""
    flow = rate * time
    if not extends:
        # f σ12 = Wi and tr σ = 2 Wi σ12 / f
        f = brentq(lambda f: np.log(f) - 2.0 * epsilon * (flow / f) ** 2, 1.0, 1e9, xtol=1e-14)
        return flow / f
    along, across = (lambda f: 2.0 * flow / (f - 2.0 * flow)), (lambda f: -flow / (f + flow))
    least = max(1.0, 2.0 * flow * (1.0 + 1e-14))
    f = brentq(lambda f: np.log(f) - epsilon * (along(f) + 2.0 * across(f)), least, 1e9, xtol=1e-14)
    return along(f) - across(f)


def test_ptt_has_its_closed_flow_curve_in_shear_and_extension(on_curves):
    model, batch, vectors = on_curves
    found = model.predictions(vectors, batch)[1]
    epsilon = vectors[1][model.positions("ptt_exponential")[0]]
    for row, (rates, extends) in enumerate([(RATES, False), (SLOW, True)]):
        modes = [[g * ptt(r, t, epsilon, extends) for r in rates]
                 for g, t in zip(MODULI, TIMES, strict=True)]  # fmt: skip
        exact = np.sum(modes, axis=0) + (3.0 if extends else 1.0) * SOLVENT * rates
        np.testing.assert_allclose(found[row, : len(rates)], exact, rtol=1e-9)


def test_a_state_that_no_flow_reaches_is_told_and_spoils_none_beside_it(on_curves):
    model, batch, vectors = on_curves
    away = vector_of(model, ptt_exponential=-0.5)
    found, calm = model.predictions([away, vectors[0]], batch)
    # f² ln f = 2 ε Wi² is nowhere less than −1/(2 e)
    none = (TIMES[1] * RATES) ** 2 > 1.0 / (2.0 * np.e)
    newtonian = (MODULI @ TIMES + SOLVENT) * RATES
    # without one it is no number, or off by orders of magnitude: f is least 1/√e where there is one
    np.testing.assert_array_equal(found[0] < 2.0 * newtonian, ~none)
    assert 0 < np.sum(none) < len(RATES)
    np.testing.assert_allclose(calm[0], newtonian, rtol=1e-12)


def test_effects_on_flow_curves_are_where_a_start_up_ends(on_curves):
    model, batch, vectors = on_curves
    felt = RATES[[2, 7, 10]]
    for theta in vectors:
        effects = {name: 0.0 for name in ON_CURVES}
        effects |= {n: of[0] for n, of in effects_in(model, theta, ON_CURVES).items()}
        fluid = fluid_with(effects_in(model, theta, ON_CURVES), MODES, SOLVENT)
        # what is still to come after fifty of the longest time, to scipy's tolerance
        stress = np.array([fluid.held(rate, np.array([100.0]))[0, 0, 1] for rate in felt])
        # the fluid feels the rate of the tool less s σ, and the record has the friction
        told = (felt + effects["wall_slip"] * stress) / (1.0 + effects["rate_gain"])
        found = model.predict(theta, make_batch([curve("shear", steady_rates(told), told)]))[0]
        np.testing.assert_allclose(found, stress + effects["bearing_friction"], rtol=1e-5)
    # and not because effects do nothing
    found = model.predictions(vectors, batch)[:, 0]
    assert np.all(np.max(np.abs(found[1:] / found[0] - 1.0), axis=1) > 1e-3)


def test_moduli_and_solvent_of_each_vector_are_those_of_a_model_that_declares_them(on_curves):
    model, batch, vectors = on_curves
    factors = np.array([1.0, 2.0, 0.5, 3.0])[:, None]
    found = model.predictions(vectors, batch, factors * model.moduli)
    # all stresses of modes and solvent grow alike, where nothing slips or rubs
    np.testing.assert_allclose(found[1], 2.0 * model.predictions(vectors, batch)[1], rtol=1e-9)
    threefold = DeclaredModel.maxwell(3.0 * MODULI, TIMES, solvent_viscosity=3.0 * SOLVENT)
    other = model_with(ON_CURVES, threefold).predictions(vectors[3:], batch)[0]
    np.testing.assert_allclose(found[3], other, rtol=1e-12)


STRAINS, FREQUENCIES = np.array([0.01, 1.0, 3.0, 0.01, 0.5]), np.array([0.3, 1.0, 2.0, 30.0, 5.0])


@pytest.fixture(scope="module")
def in_sweeps():
    batch = make_batch(sweep_of(STRAINS, FREQUENCIES).records)
    return model_with(("giesekus_mobility", "stress_gain")), batch


def moduli_of(asked, amplitudes):
    """Return complex moduli of vectors."""
    model, batch = asked
    thetas = [vector_of(model, **values) for values in amplitudes]
    storage, loss = np.moveaxis(model.predictions(thetas, batch), 1, 0)
    return storage + 1j * loss


def test_a_maxwell_fluid_has_its_closed_moduli_at_every_strain(in_sweeps):
    # σ12 of an upper-convected Maxwell fluid is linear in the strain; a gain multiplies the record
    found = moduli_of(in_sweeps, [{"stress_gain": gain} for gain in np.linspace(0.0, 0.16, 9)])
    w = FREQUENCIES[:, None]
    exact = np.sum(MODULI * 1j * w * TIMES / (1.0 + 1j * w * TIMES), axis=1)
    exact += 1j * FREQUENCIES * SOLVENT
    ratio = found / exact
    # the steps of a cycle err by so much; the gain is exact
    np.testing.assert_allclose(ratio[0], 1.0, atol=2e-5)
    np.testing.assert_allclose(np.ptp(ratio / ratio[0], axis=1), 0.0, atol=1e-12)
    assert np.all(np.diff(np.abs(ratio[:, 0])) != 0.0)


def test_a_giesekus_fluid_has_the_moduli_that_scipy_ends_at(in_sweeps):
    (found,) = moduli_of(in_sweeps, [{"giesekus_mobility": MOBILITY}])
    exact = [
        sum(giesekus_modulus(MOBILITY, *mode, *wave) for mode in zip(MODULI, TIMES, strict=True))
        for wave in zip(STRAINS, FREQUENCIES, strict=True)
    ]
    # as above
    np.testing.assert_allclose(found, np.array(exact) + 1j * FREQUENCIES * SOLVENT, rtol=2e-5)


def test_a_vector_of_a_sweep_does_not_depend_on_those_beside_it(in_sweeps):
    # far below zero a mode grows without end
    vectors = [{"giesekus_mobility": value} for value in (0.3, -40.0, 0.1)]
    together = moduli_of(in_sweeps, vectors)
    assert not np.all(np.isfinite(together[1]))
    np.testing.assert_allclose(together[::2], moduli_of(in_sweeps, vectors[::2]), rtol=1e-12)


def test_moduli_of_each_vector_and_its_solvent_are_its_own(in_sweeps):
    model, batch = in_sweeps
    theta = vector_of(model, giesekus_mobility=MOBILITY)
    # one mode at a time, and the solvent alone
    found = model.predictions([theta] * 4, batch, np.vstack([model.moduli, np.diag(model.moduli)]))
    # the record is linear in the moduli, each mode's own and the solvent's
    np.testing.assert_allclose(np.sum(found[1:], axis=0), found[0], rtol=1e-12)
    np.testing.assert_allclose(found[3, 1], FREQUENCIES * SOLVENT, rtol=1e-12)


def test_what_gives_way_takes_its_share_of_the_closed_moduli(in_sweeps):
    names = "wall_slip", "tool_compliance"
    model = model_with(names)
    thetas = vectors_of_each(model, names)
    slip, compliance = (thetas[i, model.positions(name)[0]] for i, name in enumerate(names, 1))
    storage, loss = np.moveaxis(model.predictions(thetas, in_sweeps[1]), 1, 0)
    bare, *found = storage + 1j * loss
    # the tool turns by the strain of the fluid and σ (C + s/iω)
    for own, series in zip(found, (slip / (1j * FREQUENCIES), compliance), strict=True):
        np.testing.assert_allclose(own, bare / (1.0 + series * bare), rtol=1e-7)
        assert np.all(np.abs(own / bare - 1.0) > 1e-4)


@pytest.mark.parametrize(
    "trial",
    [
        {"thixotropy": 5.0},
        {"giesekus_mobility": 1.0, "wall_slip": 1.0},
        {"giesekus_mobility": 1.0, "wall_slip": 1.0, "thixotropy": 5.0},
    ],
)
def test_what_couples_the_modes_comes_to_where_scipy_ends(trial):
    names = "giesekus_mobility", "thixotropy", "wall_slip"
    model = model_with(names, DeclaredModel.maxwell(MODULI, TIMES))
    strain, frequency = np.array([0.3, 3.0]), np.array([2.0, 1.0])
    theta = vector_of(model, *trial)
    for name, share in trial.items():
        theta[model.positions(name)[0]] *= share
    batch = make_batch(sweep_of(strain, frequency).records)
    (storage, loss), still = model.predict(theta, batch), model.predict(model.zero(), batch)
    effects = effects_in(model, theta, names)
    fluid, (slip,) = fluid_with(effects, MODES), effects.get("wall_slip", [0.0])
    # cycles of twenty times what the slowest mode takes to forget the start
    exact = np.array([
        modulus_of(fluid, s, w, int(20.0 * TIMES[1] * w / (2.0 * np.pi)) + 2, slip)
        for s, w in zip(strain, frequency, strict=True)
    ])  # fmt: skip
    # the steps of a cycle, and of what slips its first harmonic alone
    np.testing.assert_allclose(storage + 1j * loss, exact, rtol=2e-3)
    assert np.max(np.abs(exact / (still[0] + 1j * still[1]) - 1.0)) > 2e-2


FREQUENCY, RATE = 3.0, 4.0
PERIOD = 2.0 * np.pi / FREQUENCY
CYCLE = np.linspace(0.05, PERIOD, 40)
FROM_CYCLES = "giesekus_mobility", "thixotropy", "viscous_heating", "wall_slip", "transducer_lag"


def run_in(name, protocol, times=CYCLE):
    return Run(name, times, protocol, 0.0 * times, np.full(times.size, 30.0))


@pytest.fixture(scope="module")
def from_cycles():
    model, waves = model_with(FROM_CYCLES), oscillatory_shear(RATE, FREQUENCY)
    runs = [
        run_in("alternating", after_alternation(waves, PERIOD, CYCLE)),
        run_in("start-up", start_up(1.0)),
        run_in("waves from rest", waves),
    ]
    return model, make_batch(runs), vectors_of_each(model, FROM_CYCLES)


def test_a_periodic_start_is_what_scipy_comes_to_after_many_cycles(from_cycles):
    model, batch, _ = from_cycles
    (found,) = model.observables([vector_of(model, giesekus_mobility=MOBILITY)], batch)
    fluid = GiesekusFluid((60.0, 20.0), (0.1, 2.0), MOBILITY, SOLVENT)
    # after ten cycles, ten of the longest time, what was before is forgotten
    total = fluid.stress(
        "shear", lambda t: RATE * np.cos(FREQUENCY * t), CYCLE, begins=-10.0 * PERIOD
    )
    n1, n2 = (total[:, i, i] - total[:, i + 1, i + 1] for i in (0, 1))
    for column, expected in enumerate((total[:, 0, 1], n1, n2)):
        largest = np.max(np.abs(expected))
        # the error of the steps that a loop takes
        np.testing.assert_allclose(found[0, :, column], expected, atol=5e-4 * largest)
        # negative control: from rest it is another stress
        assert np.max(np.abs(found[2, :, column] - expected)) > 1e-2 * largest


def test_effects_come_to_what_many_cycles_from_rest_do(from_cycles):
    model, batch, vectors = from_cycles
    found = model.predictions(vectors, batch)
    waited = run_in("waited", oscillatory_shear(RATE, FREQUENCY))
    waited = replace(waited, time=60 * PERIOD + CYCLE)
    other = model.predictions(vectors, make_batch([waited]))
    largest = np.max(np.abs(other), axis=2)
    assert np.all(np.isfinite(found))
    # the error of the steps, which are others before the record: of what slips of second order
    np.testing.assert_allclose(found[:, 0] / largest, other[:, 0] / largest, atol=1e-3)
    # and not because effects do nothing
    assert np.min(np.max(np.abs(other[1:, 0] - other[0, 0]) / largest[0], axis=1)) > 1e-6


def test_a_start_that_no_cycle_brings_back_is_no_number_and_spoils_none_beside_it(from_cycles):
    model, batch, vectors = from_cycles
    away = vector_of(model, giesekus_mobility=-20.0)
    lost, calm = model.predictions([away, vectors[1]], batch)
    assert not np.any(np.isfinite(lost[0]))
    np.testing.assert_allclose(calm, model.predictions(vectors[1:2], batch)[0], rtol=1e-9)


@pytest.mark.parametrize(("asked", "tolerance"), [("in_creep", 1e-11), ("from_cycles", 1e-7)])
def test_a_vector_does_not_depend_on_those_beside_it(asked, tolerance, request):
    model, batch, thetas = request.getfixturevalue(asked)
    together = model.predictions(thetas, batch)
    for i in (0, 2, len(thetas) - 1):
        alone = model.predictions(thetas[i : i + 1], batch)[0]
        np.testing.assert_allclose(together[i], alone, atol=tolerance * np.max(np.abs(alone)))
