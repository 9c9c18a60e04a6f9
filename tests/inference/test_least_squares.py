"""Fits of many small problems: what they cost, what is left out of them, where they start again."""

import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset import Run
from discover.effects import make_effect
from discover.effects.base import SignalEffect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.inference.least_squares import fit_batch
from discover.laws import Fluid, Giesekus
from discover.programs.lanes import LANES
from discover.protocols import oscillatory_shear, shear_rates, start_up
from discover.simulate import simulate

TIMES = np.linspace(0.1, 8.0, 60)
FLOWS = [start_up(0.5), start_up(1.0), start_up(2.0), oscillatory_shear(1.5, 1.0)]
FLUID = Fluid(Giesekus(0.3), jnp.asarray(100.0), jnp.asarray(1.0))


def runs(count, noise=0.0, seed=0):
    generator = np.random.default_rng(seed)
    made = []
    for i, flow in enumerate(FLOWS[:count]):
        stress = np.asarray(simulate(FLUID, flow, TIMES).shear_stress)
        size = noise * np.sqrt(np.mean(stress**2))
        rate = shear_rates(flow, TIMES)
        noisy = stress + size * generator.standard_normal(len(TIMES))
        made.append(Run(f"run {i}", TIMES, flow, rate, noisy))
    return made


def fitted(model, batch, *names):
    at = [p for name in names for p in model.positions(name)]
    start = model.zero()
    start[at] = 0.05
    free = [*model.declared.free_positions, *at]
    return fit_batch(model, batch, [start], [free])[0]


def test_a_fit_asks_for_few_predictions(monkeypatch):
    model = AugmentedModel(
        DeclaredModel.maxwell(60.0, 2.0, fit_modulus=True, fit_relaxation_time=True),
        [make_effect("giesekus_mobility")],
    )
    batch = make_batch(runs(4))
    asked, residuals = [], AugmentedModel.residuals
    monkeypatch.setattr(
        AugmentedModel,
        "residuals",
        lambda self, thetas, *given: asked.append(len(thetas)) or residuals(self, thetas, *given),
    )
    fit = fitted(model, batch, "giesekus_mobility")
    value = fit.theta[model.positions("giesekus_mobility")[0]]
    assert value == pytest.approx(0.3, abs=1e-3)
    # derivatives come with every step, and no call needs more than stand side by side
    assert max(asked) <= LANES
    assert len(asked) <= 12


class Runaway(SignalEffect):
    """A trial of it is a number, and its square is none."""

    def recorded_stress(self, values, record):
        return record.stress + 1e200 * values[0]
