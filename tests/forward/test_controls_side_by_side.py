"""Many vectors at a given stress are predicted in lanes as scipy does."""

import numpy as np
import pytest
from in_continuous_time import ContinuousFluid
from scipy.integrate import solve_ivp
from vectors import vector_of, vectors_of_each

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols.control import imposed_stress
from discover.protocols.protocol import in_flow

MODULUS, TIME, MOBILITY, SOLVENT = np.array([60.0, 20.0]), np.array([0.1, 2.0]), 0.3, 1.0
TIMES = np.linspace(0.05, 6.0, 60)
GRADIENTS = {
    "shear": np.eye(3, k=1) * [[1.0], [0.0], [0.0]],
    "uniaxial": np.diag([1.0, -0.5, -0.5]),
}
NAMES = (
    "giesekus_mobility", "thixotropy", "viscous_heating", "tool_compliance", "wall_slip",
    "instrument_inertia", "stress_gain", "relaxation_mode",
)  # fmt: skip


def at_stress(name, stress, kind="shear"):
    times = np.append(0.0, TIMES)
    protocol = imposed_stress(times, np.array([stress(t) for t in times]))
    ones = np.ones(TIMES.size)
    return Run(name, TIMES, in_flow(protocol, kind), 0.0 * ones, ones, strain=ones)


def wave(t):
    return 15.0 * np.sin(2.0 * t)


RUNS = [at_stress("waves", wave), at_stress("pulled", wave, "uniaxial")]


@pytest.fixture(scope="module")
def model():
    declared = DeclaredModel.maxwell(MODULUS, TIME, solvent_viscosity=SOLVENT)
    return AugmentedModel(declared, [make_effect(name) for name in NAMES])


def by_scipy(kind):
    """Return strain, N1 and N2: what the solvent is left with decides the rate."""
    unit, trouton = GRADIENTS[kind], {"shear": 1.0, "uniaxial": 3.0}[kind]

    def seen(modes):
        total = modes.sum(axis=0)
        return total[0, 1] if kind == "shear" else total[0, 0] - total[1, 1]

    def rate_of(t, modes):
        return (wave(t) - seen(modes)) / (SOLVENT * trouton)

    def slope(t, y):
        modes = y[1:].reshape(-1, 3, 3)
        rate = rate_of(t, modes)
        gradient, out = rate * unit, [[rate]]
        for stress, modulus, time in zip(modes, MODULUS, TIME, strict=True):
            made = modulus * (gradient + gradient.T) + gradient @ stress + stress @ gradient.T
            out.append(np.ravel(made - (stress + MOBILITY / modulus * stress @ stress) / time))
        return np.concatenate(out)

    start = np.zeros(1 + 9 * MODULUS.size)
    found = solve_ivp(slope, (0.0, TIMES[-1]), start, "LSODA", TIMES, rtol=1e-8, atol=1e-8).y.T
    values = []
    for t, y in zip(TIMES, found, strict=True):
        modes = y[1:].reshape(-1, 3, 3)
        rate = rate_of(t, modes) * unit
        total = modes.sum(axis=0) + SOLVENT * (rate + rate.T)
        values.append([y[0], total[0, 0] - total[1, 1], total[1, 1] - total[2, 2]])
    return np.array(values)


def test_strains_and_normal_stresses_are_those_of_full_tensors(model):
    thetas = [vector_of(model, giesekus_mobility=share * MOBILITY) for share in (1.0, 0.5)]
    found, wrong = model.observables(thetas, make_batch(RUNS))
    for own, off, kind in zip(found, wrong, GRADIENTS, strict=True):
        expected = by_scipy(kind)
        largest = np.maximum(np.max(np.abs(expected), axis=0), 1.0)
        # the error of the steps, and of the wave between its samples
        np.testing.assert_allclose(own / largest, expected / largest, atol=5e-4)
        # negative control: another mobility is told apart
        assert np.max(np.abs(off - expected) / largest) > 2e-3


def test_effects_follow_their_equations(model):
    batch, thetas = make_batch(RUNS), vectors_of_each(model, NAMES)
    found = model.predictions(thetas, batch)
    for row, run in enumerate(RUNS):
        any_of_them = ContinuousFluid(model, thetas[0], run.protocol.kinematics)
        for number, theta in enumerate(thetas[1:], start=1):
            gain, inertia = (
                float(theta[model.positions(name)[0]]) * (run is RUNS[0])
                for name in ("stress_gain", "instrument_inertia")
            )
            fluid = any_of_them.of(theta)
            exact = fluid.at_stress(lambda t, gain=gain: wave(t) / (1.0 + gain), inertia, TIMES)
            # the error of the steps, and of the wave between its samples
            largest = np.max(np.abs(exact))
            np.testing.assert_allclose(found[number, row], exact, atol=1e-3 * largest)
    # and not because effects do nothing
    largest = np.max(np.abs(found[0, 0]))
    assert np.min(np.max(np.abs(found[1:, 0] - found[0, 0]) / largest, axis=1)) > 1e-7


def test_a_vector_does_not_depend_on_those_beside_it(model):
    batch, thetas = make_batch(RUNS), vectors_of_each(model, NAMES)
    together = model.predictions(thetas, batch)
    for i in (0, 2, len(thetas) - 1):
        alone = model.predictions(thetas[i : i + 1], batch)[0]
        np.testing.assert_allclose(together[i], alone, atol=1e-11 * np.max(np.abs(alone)))
