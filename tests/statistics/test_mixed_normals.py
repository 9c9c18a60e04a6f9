"""Quantiles of mixed normal distributions, by scipy's distribution function."""

import numpy as np
import pytest
from discover.statistics.mixed_normals import quantile
from scipy.optimize import brentq
from scipy.stats import norm


def test_a_quantile_of_mixed_distributions_is_that_of_scipy():
    mean = np.array([0.0, 3.0])[:, None, None]
    deviation, share = np.array([1.0, 0.5])[:, None, None], np.array([0.7, 0.3])[:, None, None]

    def missing(x):
        return 0.7 * norm.cdf(x) + 0.3 * norm.cdf((x - 3.0) / 0.5) - 0.975

    found = quantile(mean, deviation, share, 0.975)[0, 0]
    assert found == pytest.approx(brentq(missing, 0.0, 10.0), abs=1e-9)
