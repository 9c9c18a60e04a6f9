"""Bands from predictions: neither a narrow one of what is left, nor a wide one of nonsense."""

from dataclasses import replace

import numpy as np
import pytest
from discover.identify.rivals.bands import bands_of_predictions
from discover.identify.side_by_side.many_laws import Contender, draws, fluid_of, predict_laws
from independent import Giesekus
from independent.sweeps import modulus_of
from scipy.stats import norm

from discover.laws import Fluid, make_law
from discover.protocols.control import oscillations
from tensor_library.law_terms import LawTerms

TIMES = np.linspace(0.0, 1.0, 5)
N_DRAWS = 40


def predictions(lost=0):
    """The law itself, and draws evenly spaced in probability of a normal with 10 %."""
    spread = norm(1.0, 0.1).ppf((np.arange(N_DRAWS) + 0.5) / N_DRAWS)
    rows = np.append(1.0, spread)[:, None, None, None] * np.ones((1, 1, TIMES.size, 3))
    rows[1 : 1 + lost, 0, 2:] = np.nan
    return rows


def test_the_band_of_draws_is_that_of_their_distribution():
    (band,) = bands_of_predictions(predictions(), [1 + N_DRAWS], [TIMES])
    # quantiles that are unbiased; the default of NumPy would give nine tenths of this
    np.testing.assert_allclose(band.high - band.low, 3.92 * 0.1, rtol=0.07)
    assert band.reason == ""


def test_where_one_law_in_seven_runs_away_there_is_no_band():
    (band,) = bands_of_predictions(predictions(lost=6), [1 + N_DRAWS], [TIMES])
    assert np.all(np.isnan(band.low))
    assert np.all(np.isnan(band.rivals_high))
    assert "run away" in band.reason
    np.testing.assert_array_equal(band.chosen, 1.0)
    assert not np.any(np.isfinite(list(band.widths().values())))


def test_one_law_in_forty_may_run_away():
    (band,) = bands_of_predictions(predictions(lost=1), [1 + N_DRAWS], [TIMES])
    assert np.all(np.isfinite(band.low))
    assert 0.0 < band.runaways < 0.05


def test_a_law_whose_constants_exchange_each_other_has_no_band_rather_than_none_in_width():
    alone = predictions()[:1]
    (band,) = bands_of_predictions(alone, [1], [TIMES], "the constants exchange each other")
    assert np.all(np.isnan(band.high))
    (exact,) = bands_of_predictions(alone, [1], [TIMES])  # constants that count as exact
    np.testing.assert_array_equal(exact.high - exact.low, 0.0)


def test_weighed_draws_are_taken_for_those_of_the_covariance():
    kept = np.column_stack([np.linspace(1.0, 2.0, 60), np.linspace(0.1, 0.2, 60)])
    law = Contender("law", LawTerms({"sigma": 1.5}, {"epsilon": 0.15}), 1e6 * np.eye(2), kept)
    chosen, *others = draws(law, 40, np.random.default_rng(0))
    assert chosen is law
    assert len(others) == 40
    assert all(1.0 <= other.law.coefficients["sigma"] <= 2.0 for other in others)
    unknown = Contender("law", LawTerms({"sigma": 1.5}), 1e6 * np.eye(1), without_band="no band")
    assert draws(unknown, 40, np.random.default_rng(0)) == (unknown,)


def test_forty_draws_of_one_constant_are_as_wide_as_its_interval_whatever_the_seed():
    law = Contender("law", LawTerms({"sigma": 1.0}), covariance=np.array([[0.04]]))
    ratios = []
    for seed in range(20):
        values = [
            one.law.coefficients["sigma"]
            for one in draws(law, N_DRAWS, np.random.default_rng(seed))
        ]
        low, high = np.percentile(values, [2.5, 97.5], method="median_unbiased")
        ratios.append((high - low) / (3.92 * 0.2))
    # as of numbers evenly spaced in probability, above; at random they differ by a sixth
    np.testing.assert_allclose(ratios, 1.0, rtol=0.07)


def test_draws_have_the_covariance_of_constants_that_exchange_each_other():
    covariance = np.array([[1.0, 0.95], [0.95, 1.0]])
    law = Contender("law", LawTerms({"sigma": 0.0, "gammadot": 0.0}), covariance=covariance)
    others = draws(law, 400, np.random.default_rng(0))[1:]
    values = np.array([other.law.values for other in others])
    # an axis is drawn evenly, so its variance is nearly exact; how axes combine is left to chance
    np.testing.assert_allclose(np.cov(values.T), covariance, atol=0.1)


@pytest.mark.slow
def test_laws_in_a_sweep_have_the_moduli_that_scipy_gives_each():
    strains, alphas = np.array([0.1, 1.0, 4.0]), (0.1, 0.4)
    sweep = oscillations(strains, np.ones(3))
    moduli = ("storage_modulus", "loss_modulus")
    laws = [Contender("", LawTerms({"sigma.sigma": alpha})) for alpha in alphas]
    # of a shear-thickening law that runs away there is no state at the largest strain
    laws.append(
        Contender("", LawTerms({"tr(gammadot.gammadot)*gammadot": -1.0, "sigma.sigma": -0.5}))
    )
    declared = Fluid(make_law("ucm"), 100.0, 1.0)
    flows = [replace(sweep, modulus=modulus) for modulus in moduli]
    found = predict_laws(fluid_of(laws, declared), flows, [np.arange(1.0, 4.0)] * 2)[..., 0]
    for alpha, (stored, lost) in zip(alphas, found, strict=False):
        exact = [modulus_of(Giesekus(alpha, 100.0), strain, 1.0, 5) for strain in strains]
        np.testing.assert_allclose(stored + 1j * lost, exact, rtol=1e-4)
    assert not np.all(np.isfinite(found[-1]))
