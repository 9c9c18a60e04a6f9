"""Trials that quick tests already refute are not followed through slow ones: no answer changes."""

import numpy as np
import pytest
from independent.homogeneous import GiesekusFluid
from independent.sweeps import giesekus_modulus

from discover.dataset.run import Run
from discover.effects import named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.flows import PeriodicFlows
from discover.protocols import oscillations, start_up
from discover.protocols.control import steady_rates

MODULUS, TIME, MOBILITY = 100.0, 1.0, 0.3
RATES = np.array([0.3, 1.0, 3.0])
STRAINS = np.array([0.5, 4.0])
NAMES = ("giesekus_mobility", "stress_gain", "wall_slip")


@pytest.fixture(scope="module")
def problem():
    """A flow curve and a sweep by scipy, the sweep first, and Maxwell with three candidates."""
    fluid = GiesekusFluid((MODULUS,), (TIME,), MOBILITY)
    steady = [fluid.recorded("shear", lambda _, r=r: r, np.array([40.0]))[0] for r in RATES]
    curve = Run("curve", np.arange(1.0, 4.0), steady_rates(RATES), RATES, np.array(steady))
    complex_ = [giesekus_modulus(MOBILITY, MODULUS, TIME, strain, 1.0) for strain in STRAINS]
    protocol = oscillations(STRAINS, np.ones(2))
    sweep = Run(
        "sweep", np.arange(1.0, 3.0), protocol, STRAINS, np.ones(2), strain=STRAINS,
        storage_modulus=np.real(complex_), loss_modulus=np.imag(complex_),
    )  # fmt: skip
    model = AugmentedModel(
        DeclaredModel.maxwell(MODULUS, TIME), [named_effects()[name] for name in NAMES]
    )
    return model, make_batch([*sweep.records, curve])


def trials(model):
    """Return vectors with a mobility that is right, and with stresses far too small and large."""
    found = [model.zero() for _ in range(3)]
    found[0][model.positions("giesekus_mobility")[0]] = MOBILITY
    found[1][model.positions("stress_gain")[0]] = -0.5
    found[2][model.positions("stress_gain")[0]] = 1.0
    return found


def followed(monkeypatch, model):
    """Return a list to which the number of vectors is added whenever a sweep is followed."""
    counts, of_part = [], model._predictor.of_part

    def counting(trials, batch, number):
        if isinstance(batch.parts[number], PeriodicFlows):
            counts.append(len(trials.thetas))
        return of_part(trials, batch, number)

    monkeypatch.setattr(model._predictor, "of_part", counting)
    return counts


def test_residuals_below_the_limit_are_those_without_one(problem, monkeypatch):
    model, batch = problem
    whole = model.residuals(trials(model), batch)
    costs = np.sum(whole**2, axis=(1, 2))
    counts = followed(monkeypatch, model)
    some = model.residuals(trials(model), batch, np.full(3, 1.1 * costs[0] + 1e-6))
    np.testing.assert_array_equal(some[0], whole[0])
    assert np.all(np.isinf(some[1:]))
    assert counts == [1]  # the flow curve alone refutes the others
    # negative control: with no limit in reach all are followed
    np.testing.assert_array_equal(model.residuals(trials(model), batch, 2.0 * costs + 1.0), whole)
    assert counts == [1, 3]


@pytest.fixture(scope="module")
def start_ups():
    """Two start-ups of the same fluid by scipy, and the same model."""
    fluid = GiesekusFluid((MODULUS,), (TIME,), MOBILITY)
    times = np.linspace(0.1, 6.0, 60)
    runs = []
    for rate in (1.0, 4.0):
        stress = fluid.recorded("shear", lambda _, r=rate: r, times)
        runs.append(Run(f"{rate}", times, start_up(rate), np.full(60, rate), stress))
    model = AugmentedModel(
        DeclaredModel.maxwell(MODULUS, TIME), [named_effects()[name] for name in NAMES]
    )
    return model, make_batch(runs)


def test_a_transient_is_left_where_it_misses_too_much(start_ups):
    model, batch = start_ups
    right, maxwell = trials(model)[0], model.zero()
    costs = np.sum(model.residuals([right, maxwell], batch) ** 2, axis=(1, 2))
    assert costs[0] < 1e-6 < 1.0 < costs[1]
    limits = np.array([0.1, 0.1])
    whole = model._predictor.of_part(model._trials([right, maxwell]), batch, 0)
    # beside one that is of use it is followed along, which costs nothing, and alone it is not
    beside = model._predictor.of_part(model._trials([right, maxwell], limits), batch, 0)
    np.testing.assert_array_equal(beside[0], whole[0])
    alone = model._predictor.of_part(model._trials([maxwell], limits[:1]), batch, 0)
    assert not np.any(np.isfinite(alone))
    both = model.residuals([right, maxwell], batch, limits)
    assert np.all(np.isfinite(both[0]))
    assert np.all(np.isinf(both[1]))
    assert np.all(np.isinf(model.residuals([maxwell], batch, limits[:1])))


def test_a_transient_whose_record_is_altered_afterwards_is_followed_to_the_end(start_ups):
    model, batch = start_ups
    theta = model.zero()
    theta[model.positions("stress_gain")[0]] = 1e-6
    found = model._predictor.of_part(model._trials([theta], np.array([0.1])), batch, 0)
    np.testing.assert_array_equal(found, model._predictor.of_part(model._trials([theta]), batch, 0))
