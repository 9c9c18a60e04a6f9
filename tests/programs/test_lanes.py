"""What is written for lanes against NumPy: every digit, infinities, and what is no number."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.programs import lanes

SPECIAL = np.array([0.0, -0.0, np.inf, -np.inf, np.nan, 1e-320, -1.0, 800.0])


def in_lanes(function, *arguments):
    """Return a function of numbers for eight sets of them, by machine code."""
    w = lanes.Writing((), ("x", "y"), ("x", "y"), ())
    given = [w.load("x", i) for i in range(len(arguments))]
    translation = lanes.Translation(lanes.Arithmetic(w.builder))
    found = translation(function, *given)
    leaves = [value for leaf in jax.tree.leaves(found) for value in np.atleast_1d(leaf).flat]
    for i, value in enumerate(leaves):
        w.store(lanes.Arithmetic(w.builder).lanes(value), "y", i)
    x, y = np.array(arguments, dtype=float), np.empty((len(leaves), lanes.LANES))
    lanes.callable_of(w.compiled(), 0, 2)(x.ctypes.data, y.ctypes.data)
    assert translation.calls is not None  # they live as long as the code
    return y if len(leaves) > 1 else y[0]


@pytest.mark.parametrize(
    ("of_jax", "of_numpy", "low", "high"),
    [
        (jnp.exp, np.exp, -700.0, 700.0),
        (jnp.expm1, np.expm1, -1.0, 1.0),
        (jnp.expm1, np.expm1, -1e-9, 1e-9),
        (jnp.log, np.log, 1e-300, 1e3),
        (jnp.log, np.log, 0.5, 2.0),
        (jnp.log1p, np.log1p, -1e-9, 1e-9),
        (jnp.tanh, np.tanh, -1e-3, 30.0),
        (jnp.arcsinh, np.arcsinh, -3.0, 3.0),
        (jnp.arcsinh, np.arcsinh, -1e-9, 1e-9),
        (jnp.arcsinh, np.arcsinh, -1e9, 1e200),
        (jnp.sqrt, np.sqrt, 0.0, 1e10),
        (lambda x: x**1.7, lambda x: x**1.7, 1e-6, 1e6),
        (lambda x: x**-3, lambda x: x**-3.0, -2.0, -0.1),
    ],
)
def test_functions_have_the_digits_of_numpy(of_jax, of_numpy, low, high):
    x = np.linspace(low, high, lanes.LANES)
    # a few roundings; a power loses those of its exponent, here up to 30
    np.testing.assert_allclose(in_lanes(of_jax, x), of_numpy(x), rtol=2e-14)


@pytest.mark.parametrize(
    ("of_jax", "of_numpy"),
    [
        (jnp.exp, np.exp),
        (jnp.expm1, np.expm1),
        (jnp.tanh, np.tanh),
        (jnp.arcsinh, np.arcsinh),
        (jnp.sqrt, np.sqrt),
        (jnp.maximum, np.maximum),
        (lambda x: jnp.minimum(x, 60.0), lambda x: np.minimum(x, 60.0)),
        (lambda x: jnp.clip(x, -1.0, 1.0), lambda x: np.clip(x, -1.0, 1.0)),
        (lambda x: jnp.where(x > 0.0, x, 2.0), lambda x: np.where(x > 0.0, x, 2.0)),
    ],
)
def test_what_is_infinite_or_no_number_stays_so(of_jax, of_numpy):
    given = (SPECIAL, SPECIAL[::-1].copy()) if of_jax is jnp.maximum else (SPECIAL,)
    with np.errstate(all="ignore"):
        wanted = of_numpy(*given)
    np.testing.assert_allclose(in_lanes(of_jax, *given), wanted, rtol=1e-14, atol=1e-300)


def test_a_logarithm_of_what_has_none_is_no_number():
    found = in_lanes(jnp.log, np.array([0.0, -1.0, np.nan, np.inf, -np.inf, 1.0, np.e, 2.0]))
    np.testing.assert_allclose(
        found, [-np.inf, np.nan, np.nan, np.inf, np.nan, 0.0, 1.0, np.log(2.0)], atol=1e-15
    )


def test_branches_by_numbers_are_taken_lane_by_lane():
    def function(x):
        return jax.lax.cond(x > 0.0, lambda v: jnp.sqrt(v), lambda v: 1.0 - v, x)

    x = np.linspace(-2.0, 2.0, lanes.LANES)
    wanted = np.where(x > 0.0, np.sqrt(np.abs(x)), 1.0 - x)
    np.testing.assert_allclose(in_lanes(function, x), wanted, rtol=1e-15)


def test_what_is_not_known_in_lanes_is_computed_by_jax_for_each_of_them():
    def doubled(x, y):
        reached = jax.lax.while_loop(lambda v: v < 1.0, lambda v: 2.0 * v, x)
        return reached, jnp.stack([x, jnp.sin(y)]), y > reached

    x, y = np.linspace(0.1, 2.0, lanes.LANES), np.linspace(0.0, 3.0, lanes.LANES)
    reached = x * 2.0 ** np.maximum(np.ceil(-np.log2(x)), 0.0)
    wanted = [reached, x, np.sin(y), y > reached]
    np.testing.assert_allclose(in_lanes(doubled, x, y), wanted, rtol=1e-15)


def test_systems_of_equations_are_solved_lane_by_lane_whatever_their_pivots():
    rng = np.random.default_rng(0)
    entries, right = rng.normal(size=(9, lanes.LANES)), rng.normal(size=(3, lanes.LANES))
    entries[0, ::2] = 0.0  # the first pivot is none in half of the lanes

    def solved(*values):
        return jnp.linalg.solve(jnp.stack(values[:9]).reshape(3, 3), jnp.stack(values[9:]))

    found = in_lanes(solved, *entries, *right)
    matrices = np.moveaxis(entries.reshape(3, 3, lanes.LANES), -1, 0)
    exact = np.linalg.solve(matrices, right.T[:, :, None])[:, :, 0].T
    np.testing.assert_allclose(found, exact, rtol=1e-11)
