"""How far bands step along constants that runs hardly tell, on closed forms of one mode."""

from dataclasses import replace

import numpy as np
import pytest
from test_differing_runs import NOISE, RATES, TIMES, start_ups

from discover.forward import DeclaredModel
from discover.inference.engine import explain
from discover.inference.engine.bands import Predictions
from discover.inference.engine.problem import Problem
from discover.statistics import HALF_BAND


@pytest.mark.parametrize("wider", [1.0, 1e3], ids=["as the runs tell", "a thousandfold"])
def test_a_band_is_no_wider_than_fitted_runs_allow_whatever_a_posterior_says(wider):
    declared = DeclaredModel.maxwell([1.0], [1.0], fit_modulus=True, fit_relaxation_time=True)
    problem = Problem(declared, [], start_ups(np.zeros(len(RATES))))
    posterior = explain(problem)
    (fit, _), *_ = posterior.fits
    # a Laplace posterior that is too wide stands for a constant that is flat where it is likeliest
    wide = replace(fit, covariance=wider**2 * fit.covariance, memory={})
    posterior = replace(posterior, fits=((wide, 1.0),), unexplained=0.0)
    bands = Predictions(posterior, problem.fitted).bands(posterior.fits)
    half, held = [], []
    for rate, band in zip(RATES, bands, strict=True):
        truth = rate * (1.0 - np.exp(-TIMES))  # start-up of a Maxwell fluid of 1 Pa and 1 s
        half.append(0.5 * (band.high - band.low)[:, 0] / (NOISE * np.sqrt(np.mean(truth**2))))
        held.append((band.low[:, 0] <= truth) & (truth <= band.high[:, 0]))
    # each direction may change all samples together by one of their noise, their root of squares;
    # a tenth for the curvature of the law along it
    most = HALF_BAND * np.sqrt(len(fit.covariance) / np.size(half))
    assert 0.3 * most < np.sqrt(np.mean(np.square(half))) < 1.1 * most
    assert np.mean(held) > 0.9
