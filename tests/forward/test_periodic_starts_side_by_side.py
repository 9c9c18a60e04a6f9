"""Many vectors of runs that begin in steady alternation are predicted in lanes."""

from dataclasses import replace

import numpy as np
import pytest
from independent.homogeneous import GiesekusFluid
from vectors import vector_of, vectors_of_each

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import oscillatory_shear, start_up
from discover.protocols.history import after_alternation

MODULUS, TIME, MOBILITY, SOLVENT = (60.0, 20.0), (0.1, 2.0), 0.3, 1.0
FREQUENCY, RATE = 3.0, 4.0
PERIOD = 2.0 * np.pi / FREQUENCY
TIMES = np.linspace(0.05, PERIOD, 40)
NAMES = "giesekus_mobility", "thixotropy", "viscous_heating", "wall_slip", "transducer_lag"


def run(name, protocol):
    return Run(name, TIMES, protocol, 0.0 * TIMES, np.full(TIMES.size, 30.0))


def runs():
    wave = oscillatory_shear(RATE, FREQUENCY)
    return [
        run("alternating", after_alternation(wave, PERIOD, TIMES)),
        run("start-up", start_up(1.0)),
        run("waves from rest", wave),
    ]


@pytest.fixture(scope="module")
def asked():
    declared = DeclaredModel.maxwell(MODULUS, TIME, solvent_viscosity=SOLVENT)
    model = AugmentedModel(declared, [make_effect(name) for name in NAMES])
    return model, make_batch(runs()), vectors_of_each(model, NAMES)


def test_a_periodic_start_is_what_scipy_comes_to_after_many_cycles(asked):
    model, batch, _ = asked
    (found,) = model.observables([vector_of(model, giesekus_mobility=MOBILITY)], batch)
    fluid = GiesekusFluid(MODULUS, TIME, MOBILITY, SOLVENT)
    # after ten cycles, ten of the longest time, what was before is forgotten
    total = fluid.stress(
        "shear", lambda t: RATE * np.cos(FREQUENCY * t), TIMES, begins=-10.0 * PERIOD
    )
    n1, n2 = (total[:, i, i] - total[:, i + 1, i + 1] for i in (0, 1))
    for column, expected in enumerate((total[:, 0, 1], n1, n2)):
        largest = np.max(np.abs(expected))
        # the error of the steps that a loop takes
        np.testing.assert_allclose(found[0, :, column], expected, atol=5e-4 * largest)
        # negative control: from rest it is another stress
        assert np.max(np.abs(found[2, :, column] - expected)) > 1e-2 * largest


def test_effects_come_to_what_many_cycles_from_rest_do(asked):
    model, batch, vectors = asked
    found = model.predictions(vectors, batch)
    cycles = 60
    waited = run("waited", oscillatory_shear(RATE, FREQUENCY))
    waited = replace(waited, time=cycles * PERIOD + TIMES)
    other = model.predictions(vectors, make_batch([waited]))
    largest = np.max(np.abs(other), axis=2)
    assert np.all(np.isfinite(found))
    # the error of the steps, which are others before the record: of what slips of second order
    np.testing.assert_allclose(found[:, 0] / largest, other[:, 0] / largest, atol=1e-3)
    # and not because effects do nothing
    assert np.min(np.max(np.abs(other[1:, 0] - other[0, 0]) / largest[0], axis=1)) > 1e-6


def test_a_vector_does_not_depend_on_those_beside_it(asked):
    model, batch, vectors = asked
    together = model.predictions(vectors, batch)
    for i in (0, 2, len(vectors) - 1):
        alone = model.predictions(vectors[i : i + 1], batch)[0]
        np.testing.assert_allclose(together[i], alone, atol=1e-7 * np.max(np.abs(alone)))


def test_a_start_that_no_cycle_brings_back_is_no_number_and_spoils_none_beside_it(asked):
    model, batch, vectors = asked
    away = vector_of(model, giesekus_mobility=-20.0)
    lost, calm = model.predictions([away, vectors[1]], batch)
    assert not np.any(np.isfinite(lost[0]))
    np.testing.assert_allclose(calm, model.predictions(vectors[1:2], batch)[0], rtol=1e-9)
