"""Sweeps of many vectors at once: each oscillation in steady alternation is a lane of its own."""

import numpy as np
import pytest
from in_continuous_time import ContinuousFluid
from independent.sweeps import giesekus_modulus
from vectors import sweep_of, vector_of, vectors_of_each

from discover.effects import make_effect
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel

MODULI, TIMES, SOLVENT = np.array([60.0, 20.0]), np.array([0.1, 2.0]), 1.0
STRAINS, FREQUENCIES = np.array([0.01, 1.0, 3.0, 0.01, 0.5]), np.array([0.3, 1.0, 2.0, 30.0, 5.0])


@pytest.fixture(scope="module")
def asked():
    """Return a model and a sweep."""
    run = sweep_of(STRAINS, FREQUENCIES)
    declared = DeclaredModel.maxwell(MODULI, TIMES, solvent_viscosity=SOLVENT)
    effects = [make_effect(name) for name in ("giesekus_mobility", "stress_gain")]
    return AugmentedModel(declared, effects), make_batch(run.records)


def predicted(asked, amplitudes):
    """Return complex moduli of vectors."""
    model, batch = asked
    thetas = [vector_of(model, **values) for values in amplitudes]
    storage, loss = np.moveaxis(model.predictions(thetas, batch), 1, 0)
    return storage + 1j * loss


def test_a_maxwell_fluid_has_its_closed_moduli_at_every_strain(asked):
    # σ12 of an upper-convected Maxwell fluid is linear in the strain; a gain multiplies the record
    gains = np.linspace(0.0, 0.16, 9)
    found = predicted(asked, [{"stress_gain": gain} for gain in gains])
    w = FREQUENCIES[:, None]
    exact = np.sum(MODULI * 1j * w * TIMES / (1.0 + 1j * w * TIMES), axis=1)
    exact += 1j * FREQUENCIES * SOLVENT
    ratio = found / exact
    # the steps of a cycle err by so much; the gain is exact
    np.testing.assert_allclose(ratio[0], 1.0, atol=2e-5)
    np.testing.assert_allclose(np.ptp(ratio / ratio[0], axis=1), 0.0, atol=1e-12)
    assert np.all(np.diff(np.abs(ratio[:, 0])) != 0.0)


def test_a_giesekus_fluid_has_the_moduli_that_scipy_ends_at(asked):
    (found,) = predicted(asked, [{"giesekus_mobility": 0.3}])
    exact = [
        sum(giesekus_modulus(0.3, *mode, *wave) for mode in zip(MODULI, TIMES, strict=True))
        for wave in zip(STRAINS, FREQUENCIES, strict=True)
    ]
    # as above
    np.testing.assert_allclose(found, np.array(exact) + 1j * FREQUENCIES * SOLVENT, rtol=2e-5)


def test_a_vector_of_a_sweep_does_not_depend_on_those_beside_it(asked):
    # far below zero a mode grows without end
    vectors = [{"giesekus_mobility": value} for value in (0.3, -40.0, 0.1)]
    together = predicted(asked, vectors)
    assert not np.all(np.isfinite(together[1]))
    np.testing.assert_allclose(together[::2], predicted(asked, vectors[::2]), rtol=1e-12)


def test_moduli_of_each_vector_and_its_solvent_are_its_own(asked):
    model, batch = asked
    theta = vector_of(model, giesekus_mobility=0.3)
    # one mode at a time, and the solvent alone
    found = model.predictions([theta] * 4, batch, np.vstack([model.moduli, np.diag(model.moduli)]))
    # the record is linear in the moduli, each mode's own and the solvent's
    np.testing.assert_allclose(np.sum(found[1:], axis=0), found[0], rtol=1e-12)
    np.testing.assert_allclose(found[3, 1], FREQUENCIES * SOLVENT, rtol=1e-12)


def test_what_gives_way_takes_its_share_of_the_closed_moduli(asked):
    model, batch = asked
    names = "wall_slip", "tool_compliance"
    model = AugmentedModel(model.declared, list(map(make_effect, names)))
    thetas = vectors_of_each(model, names)
    slip, compliance = (thetas[i, model.positions(name)[0]] for i, name in enumerate(names, 1))
    storage, loss = np.moveaxis(model.predictions(thetas, batch), 1, 0)
    bare, *found = storage + 1j * loss
    # the tool turns by the strain of the fluid and σ (C + s/iω)
    for own, series in zip(found, (slip / (1j * FREQUENCIES), compliance), strict=True):
        np.testing.assert_allclose(own, bare / (1.0 + series * bare), rtol=1e-7)
        assert np.all(np.abs(own / bare - 1.0) > 1e-4)


TRIALS = [
    {"thixotropy": 5.0},
    {"giesekus_mobility": 1.0, "wall_slip": 1.0},
    {"giesekus_mobility": 1.0, "wall_slip": 1.0, "thixotropy": 5.0},
]


@pytest.mark.parametrize("trial", TRIALS)
def test_what_couples_the_modes_comes_to_where_scipy_ends(asked, trial):
    model, _ = asked
    names = "giesekus_mobility", "thixotropy", "wall_slip"
    model = AugmentedModel(model.declared, list(map(make_effect, names)))
    strain, frequency = np.array([0.3, 3.0]), np.array([2.0, 1.0])
    theta = vector_of(model, *trial)
    for name, share in trial.items():
        theta[model.positions(name)[0]] *= share
    batch = make_batch(sweep_of(strain, frequency).records)
    (storage, loss), still = model.predict(theta, batch), model.predict(model.zero(), batch)
    fluid = ContinuousFluid(model, theta)
    pairs = zip(strain, frequency, strict=True)
    # cycles of twenty times what the slowest mode takes to forget the start
    exact = np.array([fluid.modulus(s, w, int(20.0 * TIMES[1] * w / (2.0 * np.pi)) + 2)
                      for s, w in pairs])  # fmt: skip
    # the steps of a cycle, and of what slips its first harmonic alone
    np.testing.assert_allclose(storage + 1j * loss, exact, rtol=2e-3)
    assert np.max(np.abs(exact / (still[0] + 1j * still[1]) - 1.0)) > 2e-2
