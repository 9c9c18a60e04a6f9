"""A band is as wide as runs that are left out ask for."""

import numpy as np
import pytest

from discover.forward import DeclaredModel
from discover.closed_loop.explanations.bands.growth import growth
from discover.closed_loop.explanations.bands.widening import widening
from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.inference.least_squares import fit_batch
from discover.protocols import start_up

MODULUS, TIME, SAMPLES, NOISE = 100.0, 1.0, 100, 0.01
RATES = (0.1, 0.2, 0.5, 1.0, 2.0)
TIMES = np.linspace(0.05, 5.0, SAMPLES)


def factor(sizes: np.ndarray, correlation: float = 0.0) -> float:
    """Return the widening of Maxwell start-ups with a constant fitted, noise as large as said."""
    runs = []
    generator = np.random.default_rng(4)
    for rate, size in zip(RATES, sizes, strict=True):
        stress = MODULUS * TIME * rate * (1.0 - np.exp(-TIMES / TIME))
        noise = generator.standard_normal(SAMPLES)
        for i in range(1, SAMPLES):
            noise[i] = correlation * noise[i - 1] + np.sqrt(1.0 - correlation**2) * noise[i]
        record = stress + size * np.sqrt(np.mean(stress**2)) * noise
        runs.append(Run(f"{rate}.csv", TIMES, start_up(rate), np.full(SAMPLES, rate), record))
    declared = DeclaredModel.maxwell(MODULUS, TIME)
    model = AugmentedModel(declared, [make_effect("stress_gain")], data_scales(runs))
    batch = make_batch(runs)
    (fit,) = fit_batch(model, batch, [model.zero()], [tuple(model.positions("stress_gain"))])
    left = float(np.sqrt(np.mean(fit.run_errors**2)))
    return widening(model, batch, fit, None, left)


def test_white_noise_asks_for_no_more():
    # of 100 samples the quantile is known to 8 %; the largest of five is 1.2 deviations up
    assert 1.0 <= factor(np.full(5, NOISE)) < 1.25


def test_a_run_that_is_missed_by_more_asks_for_more():
    sizes = np.array([NOISE, NOISE, NOISE, NOISE, 4.0 * NOISE])
    # its size over the root mean square of all
    assert factor(sizes) == pytest.approx(4.0 / np.sqrt(4.0), rel=0.25)


def test_slow_noise_that_differs_from_run_to_run_asks_for_more():
    assert factor(np.full(5, NOISE), 0.95) > factor(np.full(5, NOISE))


def test_an_error_that_grows_with_the_rate_goes_on_growing():
    rates = np.array([1.0, 2.0, 4.0])
    found = growth(0.01 * rates**1.5, rates, np.array([2.0, 8.0]))
    np.testing.assert_allclose(found, [1.0, 2.0**1.5])


@pytest.mark.parametrize(
    ("errors", "rates"),
    [([0.03, 0.02, 0.01], [1.0, 2.0, 4.0]), ([0.01, 0.03], [1.0, 4.0]),
     ([0.01, 0.02, 0.04], [1.0, 1.2, 1.4])],
    ids=["it falls", "two runs", "of one speed"],
)  # fmt: skip
def test_an_error_not_seen_to_grow_stays(errors, rates):
    assert growth(np.array(errors), np.array(rates), np.array([8.0])) == 1.0
