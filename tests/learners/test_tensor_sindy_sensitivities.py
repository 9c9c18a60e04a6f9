from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from shared_flows import LIBRARY, small_dataset

from discover.forward.fluids import solve_batch
from discover.laws import Fluid, LibraryExpansion
from discover.learners.tensor_sindy.refit import refit
from discover.learners.trajectories.active_terms import evaluate_active
from discover.learners.trajectories.problem import make_problem
from discover.learners.trajectories.sensitivities import linearise
from tensor_library import build_library, from_shear

N = len(LIBRARY)


@pytest.fixture(scope="module")
def problem():
    return make_problem(small_dataset("giesekus", {"alpha": 0.3}).runs, LIBRARY, strain_step=0.2)


@pytest.fixture(scope="module")
def trial():
    coefficients = np.zeros(N)
    coefficients[[3, 8, N - 1]] = 0.15, 0.1, 0.5
    return coefficients, np.array([0.3])


@pytest.mark.parametrize("library", [LIBRARY, build_library(degree=2, closed_forms=("exp",))])
def test_active_terms_are_rows_of_the_whole_library(library):
    generator = np.random.default_rng(0)
    stress, rate = jnp.asarray(generator.normal(size=(2, 4)))
    active = generator.integers(0, len(library), 12)
    active[1] = active[0]  # a position may be asked for twice
    inner = jnp.asarray(library.inner_default)
    few, whole = jax.jit(partial(evaluate_active, library)), jax.jit(library.evaluate)
    for s, r in ((stress, rate), (from_shear(stress), from_shear(rate))):
        expected = whole(s, r, inner)[active]
        # the same products in another order: rounding only
        np.testing.assert_allclose(few(jnp.asarray(active), s, r, inner), expected, rtol=1e-12)


def test_the_augmented_system_predicts_what_the_law_predicts(problem, trial):
    coefficients, inner = trial
    residual, _ = linearise(problem, jnp.asarray(coefficients), jnp.asarray(inner))
    law = LibraryExpansion(jnp.asarray(coefficients), jnp.asarray(inner), LIBRARY)
    stress = solve_batch(Fluid.dimensionless(law), problem.flows)[..., 3]
    expected = problem.records.weight[..., 0] * (stress - problem.records.recorded[..., 0])
    shear_rows = np.asarray(residual).reshape(problem.records.recorded.shape)[..., 0]
    # the same method on the same grid: rounding only
    np.testing.assert_allclose(shear_rows, expected, atol=1e-12)


def test_sensitivities_are_derivatives_of_the_trajectory(problem, trial):
    coefficients, inner = trial
    _, columns = linearise(problem, jnp.asarray(coefficients), jnp.asarray(inner))
    step = 1e-5
    for column in range(N + 1):
        ends = []
        for sign in (1.0, -1.0):
            c, i = coefficients.copy(), inner.copy()
            if column < N:
                c[column] += sign * step
            else:
                i[column - N] += sign * step
            ends.append(np.asarray(linearise(problem, jnp.asarray(c), jnp.asarray(i))[0]))
        difference = (ends[0] - ends[1]) / (2.0 * step)
        # central differences: truncation and rounding are both near step² = 1e-10
        np.testing.assert_allclose(columns[:, column], difference, atol=1e-8)


def test_a_term_without_influence_has_no_sensitivity(problem):
    # 33 is never driven, so a term that acts on 33 alone is invisible: σγ̇+γ̇σ is not such a term
    _, columns = linearise(problem, jnp.zeros(N), jnp.asarray([0.3]))
    sizes = np.linalg.norm(np.asarray(columns), axis=0)
    assert sizes[N] == 0.0  # an inner parameter whose term is absent
    assert np.all(sizes[:N] > 1e-3)


def test_a_runaway_start_is_a_large_misfit_and_not_an_error(problem):
    start = np.zeros(N)
    start[3] = -50.0  # −50 σ·σ on the wrong side: finite-time blow-up
    fits = refit(
        problem,
        [(3,), (3,)],
        [(start, np.array([0.3])), (np.zeros(N), np.array([0.3]))],
        np.ones(N),
        5,
    )
    assert fits[0].misfit > 100.0
    # its neighbour in the same batch is not disturbed
    np.testing.assert_allclose(fits[1].coefficients, [0.3], atol=1e-6)


def test_samples_left_out_do_not_count(problem):
    keep = np.zeros(problem.records.recorded.shape[:2], dtype=bool)
    keep[:, :30] = True
    spoiled = problem.records.recorded.at[:, 30:].add(5.0)
    import equinox as eqx

    spoiled_problem = eqx.tree_at(lambda p: p.records.recorded, problem, spoiled)
    start = (np.zeros(N), np.array([0.3]))
    kept, whole = refit(
        spoiled_problem,
        [(3,), (3,)],
        [start, start],
        np.ones(N),
        5,
        [keep, np.ones_like(keep)],
    )
    np.testing.assert_allclose(kept.coefficients, [0.3], atol=1e-6)
    assert abs(whole.coefficients[0] - 0.3) > 1e-3
