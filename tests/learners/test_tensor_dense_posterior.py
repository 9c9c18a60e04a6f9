"""The posterior on linear problems, against scikit-learn and against planted widths."""

import numpy as np
import pytest
from discover.learners.tensor_dense.posterior import log_evidence, most_evident, spread
from discover.statistics.weighted_quantiles import weighted_quantiles
from sklearn.linear_model import BayesianRidge

RECORDS, TERMS = 400.0, 12


def linear_problem(width, noise=0.1, seed=0):
    """Columns in units of the misfit, data, and the coefficients that were planted."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(int(RECORDS), TERMS)) / np.sqrt(RECORDS)
    planted = width * rng.normal(size=TERMS)
    return columns, columns @ planted + noise * rng.normal(size=int(RECORDS)) / np.sqrt(RECORDS)


def solved(columns, data, width, noise):
    root, _ = spread(columns, width, noise, RECORDS)
    return root @ root.T @ columns.T @ data * (RECORDS / noise**2)


def test_width_noise_and_posterior_are_those_of_bayesian_ridge():
    columns, data = linear_problem(width=0.5)
    width, noise = 1.0, 1.0
    for _ in range(200):
        mode = solved(columns, data, width, noise)
        width, noise = most_evident(columns @ mode - data, mode, columns, width, noise, RECORDS)
    # its rows are those of the misfit times √n, and its priors on both precisions nearly flat
    ridge = BayesianRidge(
        fit_intercept=False, tol=1e-10, max_iter=1000, alpha_1=1e-12, alpha_2=1e-12,
        lambda_1=1e-12, lambda_2=1e-12,
    ).fit(columns * np.sqrt(RECORDS), data * np.sqrt(RECORDS))  # fmt: skip
    # both stop when an update changes nothing more
    assert width == pytest.approx(ridge.lambda_**-0.5, rel=1e-6)
    assert noise == pytest.approx(ridge.alpha_**-0.5, rel=1e-6)
    assert mode == pytest.approx(ridge.coef_, rel=1e-6)
    root, inverse = spread(columns, width, noise, RECORDS)
    assert root @ root.T == pytest.approx(ridge.sigma_, rel=1e-5, abs=1e-12)
    assert root @ inverse == pytest.approx(np.eye(TERMS), abs=1e-9)


@pytest.mark.parametrize("planted", [0.03, 0.3, 3.0])
def test_evidence_is_highest_about_the_width_that_was_planted(planted):
    tried = planted * np.array([0.1, 1.0, 10.0])
    for seed in range(5):
        columns, data = linear_problem(planted, noise=0.01, seed=seed)
        found = []
        for width in tried:
            mode = solved(columns, data, width, 0.01)
            misfit = float(np.linalg.norm(columns @ mode - data))
            found.append(log_evidence(misfit, mode, columns, width, 0.01, RECORDS))
        assert np.argmax(found) == 1


def test_two_terms_that_are_one_keep_the_width_of_their_prior():
    columns, _ = linear_problem(width=1.0)
    columns[:, 1] = columns[:, 0]
    root, _ = spread(columns, 0.7, 0.01, RECORDS)
    apart = np.zeros(TERMS)
    apart[:2] = 1.0, -1.0
    # of c₁ − c₂ the data say nothing: its variance stays 2 κ²
    assert np.sum((apart @ root) ** 2) == pytest.approx(2 * 0.7**2, rel=1e-6)


def test_weighted_quantiles_are_those_of_values_repeated_so_often():
    values = np.random.default_rng(0).normal(size=(40, 3))
    often = np.arange(1, 41)
    found = weighted_quantiles(values, often.astype(float), (0.025, 0.5, 0.975))
    repeated = np.repeat(values, often, axis=0)
    wanted = np.quantile(repeated, (0.025, 0.5, 0.975), axis=0, method="hazen")
    # a value stands at the middle of its weight, not at each of its repetitions
    gaps = np.max(np.diff(np.sort(values, axis=0), axis=0))
    assert np.all(np.abs(found - wanted) <= gaps)
    assert weighted_quantiles(values, np.ones(40), (0.5,))[0] == pytest.approx(
        np.quantile(values, 0.5, axis=0, method="hazen"), abs=1e-12
    )
