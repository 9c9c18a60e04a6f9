"""Can data tell two laws apart: tests with known answers, rivals of a finished search."""

from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from discover.forward import Records
from discover.identify.rivals.evidence import compare_residuals
from discover.learners.tensor_sindy.search import SupportSearch

N = 400
TIMES = np.arange(N)
RUN = np.repeat([0, 1], N // 2)


def noise(seed, correlation=0.0):
    generator = np.random.default_rng(seed)
    white = generator.standard_normal(N)
    if not correlation:
        return white
    out = np.zeros(N)
    for i in range(1, N):
        out[i] = correlation * out[i - 1] + np.sqrt(1 - correlation**2) * white[i]
    return out


def test_identical_predictions_are_a_tie():
    residual = noise(0)
    evidence = compare_residuals(residual, residual + 1e-9, RUN, floor=1e-5)
    assert evidence.test == "tie"
    assert not evidence.told_apart


def test_a_clearly_worse_law_is_told_apart():
    residual = noise(1)
    evidence = compare_residuals(residual, residual + np.sin(TIMES), RUN)
    assert evidence.told_apart
    assert evidence.test == "vuong"


def test_a_better_law_is_never_told_apart_as_worse():
    residual = noise(2)
    evidence = compare_residuals(residual + np.sin(TIMES), residual, RUN)
    assert not evidence.told_apart
    assert evidence.p_value > 0.5


@pytest.mark.parametrize("correlation", [0.0, 0.9])
def test_equally_good_laws_are_ruled_out_in_about_one_case_of_twenty(correlation):
    rejected = 0
    for seed in range(400):
        # two wrong laws, equally far from the truth on either side
        bias = 0.5 * np.sin(0.05 * TIMES)
        e = noise(seed, correlation)
        rejected += compare_residuals(e + bias, e - bias, RUN).told_apart
    # 5 % of 400 is 20; the long-run variance with a bandwidth of n^(1/3) misses some of a strong
    # correlation, which may cost a factor of a few
    assert rejected <= (36 if correlation == 0.0 else 100)


def test_without_the_correlation_correction_the_same_data_would_mislead():
    # negative control of the correction: the plain standard error rejects far too often
    rejected, plain = 0, 0
    for seed in range(200):
        bias = 0.5 * np.sin(0.05 * TIMES)
        e = noise(seed, 0.9)
        rejected += compare_residuals(e + bias, e - bias, RUN).told_apart
        d = (e - bias) ** 2 - (e + bias) ** 2
        plain += d.mean() > 1.645 * d.std() / np.sqrt(N)
    assert plain > 1.3 * rejected


def test_correlated_residuals_count_for_fewer():
    white = compare_residuals(noise(5), noise(6), RUN).effective_samples
    red = compare_residuals(noise(5, 0.9), noise(6, 0.9), RUN).effective_samples
    assert white > 0.7 * N
    assert red < 0.4 * N


@pytest.mark.parametrize(("size", "told"), [(0.0, False), (0.5, True)])
def test_a_coefficient_is_missed_only_where_it_matters(size, told):
    e = noise(11)
    column = np.cos(0.7 * TIMES)
    data = e + size * column
    fitted = data - column * (column @ data) / (column @ column)
    assert compare_residuals(fitted, data, RUN, nested=1).told_apart is told


@dataclass
class FakeProblem:
    library: Any
    records: Records


@dataclass
class FakeSearch(SupportSearch):
    """A finished search of four supports whose predictions are known."""

    problem: Any
    fits: dict
    floor: float = 1e-5
    n_terms: int = 8
    slots: int = 5
    _far: set = field(default_factory=set)
    scale: np.ndarray = field(default_factory=lambda: np.ones(8))

    def complexity(self, support):
        return (len(support), support)


def test_the_rule_keeps_ties_and_drops_what_the_data_rule_out(monkeypatch):
    from discover.identify.rivals import fitted_rivals
    from discover.learners.tensor_sindy.refit import Fit
    from tensor_library import build_library

    monkeypatch.setattr(fitted_rivals, "_polish", lambda search, fits, chosen: fits)
    shape = (2, N // 2, 3)
    weight = np.zeros(shape)
    weight[..., 0] = 1.0 / np.sqrt(N)
    truth = np.zeros(shape)
    truth[..., 0] = np.sin(0.1 * np.arange(N // 2))
    target = truth.copy()
    target[..., 0] += 0.02 * noise(3).reshape(2, -1)
    problem = FakeProblem(build_library(), Records(jnp.asarray(target), jnp.asarray(weight)))

    def fit(support, change):
        predicted = (weight * (truth + change)).reshape(-1)
        misfit = float(np.linalg.norm(predicted - (weight * target).reshape(-1)))
        return Fit(support, np.ones(len(support)), np.zeros(0), misfit, predicted)

    wave = np.cos(0.3 * np.arange(N // 2))[None, :, None]
    chosen = fit((3,), 0.0)
    tie, wrong, near, larger = (
        fit((4,), 1e-8),
        fit((5,), 0.3 * wave),
        fit((2,), 1e-4 * wave),
        fit((1, 4), 0.001 * wave),
    )
    search = FakeSearch(problem, {f.support: f for f in (chosen, tie, wrong, near, larger)})
    table = fitted_rivals.find_rivals(search, chosen)
    names = [next(iter(r.law.coefficients)) for r in table.rivals]
    # a tie, and one that differs by far less than the noise; not the wrong one, not the larger one
    assert names == ["gammadot.gammadot", "gammadot"]
    assert [r.evidence.test for r in table.rivals] == ["tie", "vuong"]
    assert table.tested == 4
    assert not table.simplest  # (2,) comes before (3,)
