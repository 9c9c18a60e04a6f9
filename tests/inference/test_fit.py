"""What a fit of many starts asks for, and the best of fits."""

import warnings

import numpy as np
import pytest
from independent import Giesekus, oscillation
from independent import start_up as by_scipy

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.inference.least_squares import Fit, best_of, fit_batch
from discover.programs.lanes import LANES
from discover.protocols import oscillatory_shear, shear_rates, start_up

TIMES = np.linspace(0.1, 8.0, 60)
FLOWS = (
    (by_scipy(0.5), start_up(0.5)), (by_scipy(2.0), start_up(2.0)),
    (oscillation(1.5, 1.0), oscillatory_shear(1.5, 1.0)),
)  # fmt: skip


def fit_of(residual, slope=1.0):
    return Fit(np.zeros(1), (0,), np.full((1, 2), residual), np.full((1, 1, 2), slope))


def test_the_best_of_fits_is_the_usable_one_of_least_cost():
    fits = [fit_of(residual) for residual in (3.0, np.nan, 2.0, 1e200)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert best_of([*fits, fit_of(1.0, np.inf)]) is fits[2]  # without derivatives: of no use
        assert best_of([fit_of(np.inf), fit_of(np.nan)]) is None


def test_a_fit_asks_for_few_predictions(monkeypatch):
    fluid = Giesekus(0.3, modulus=100.0, relaxation_time=1.0)
    runs = [
        Run(f"{i}", TIMES, flow, shear_rates(flow, TIMES), fluid.respond(one, TIMES).sigma12)
        for i, (one, flow) in enumerate(FLOWS)
    ]
    declared = DeclaredModel.maxwell(60.0, 2.0, fit_modulus=True, fit_relaxation_time=True)
    model = AugmentedModel(declared, [make_effect("giesekus_mobility")])
    asked, residuals = [], AugmentedModel.residuals
    monkeypatch.setattr(
        AugmentedModel,
        "residuals",
        lambda self, thetas, *given: asked.append(len(thetas)) or residuals(self, thetas, *given),
    )
    (at,) = model.positions("giesekus_mobility")
    start = model.zero()
    start[at] = 0.05
    free = [*declared.free_positions, at]
    (fit,) = fit_batch(model, make_batch(runs), [start], [free])
    assert fit.theta[at] == pytest.approx(0.3, abs=1e-3)
    # derivatives come between the steps, and no call needs more than stand side by side
    assert max(asked) <= LANES
    assert len(asked) <= 18
