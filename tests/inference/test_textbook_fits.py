"""Least squares on problems from the literature, against scipy's.

Moré, Garbow & Hillstrom 1981, ACM Trans. Math. Softw. 7, 17: their functions and starts. In several
of them derivatives change so much on the way that those of a few steps before mislead.
"""

from types import SimpleNamespace

import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from scipy.optimize import least_squares

from discover.inference.least_squares import fit_batch

_TIMES = 0.1 * np.arange(1, 11)
_Y = np.array(
    [0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246]
)
_U = np.array([4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625])
_BARD = np.array(
    [0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.1, 4.39]
)
_TENS = 10.0 * np.arange(33)
# fmt: off
_OSBORNE = np.array([
    0.844, 0.908, 0.932, 0.936, 0.925, 0.908, 0.881, 0.850, 0.818, 0.784, 0.751,
    0.718, 0.685, 0.658, 0.628, 0.603, 0.580, 0.558, 0.538, 0.522, 0.506, 0.490,
    0.478, 0.467, 0.457, 0.448, 0.438, 0.431, 0.424, 0.420, 0.414, 0.411, 0.406,
])
# fmt: on


def rosenbrock(x):
    return jnp.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])


def freudenstein_and_roth(x):
    one = -13.0 + x[0] + ((5.0 - x[1]) * x[1] - 2.0) * x[1]
    return jnp.array([one, -29.0 + x[0] + ((x[1] + 1.0) * x[1] - 14.0) * x[1]])


def helical_valley(x):
    turn = jnp.arctan2(x[1], x[0]) / (2.0 * jnp.pi)
    return jnp.array([10.0 * (x[2] - 10.0 * turn), 10.0 * (jnp.hypot(x[0], x[1]) - 1.0), x[2]])


def bard(x):
    u = jnp.arange(1, 16)
    v = 16 - u
    return _BARD - (x[0] + u / (v * x[1] + jnp.minimum(u, v) * x[2]))


def box(x):
    rows = jnp.exp(-_TIMES * x[0]) - jnp.exp(-_TIMES * x[1])
    return rows - x[2] * (jnp.exp(-_TIMES) - jnp.exp(-10.0 * _TIMES))


def kowalik_and_osborne(x):
    return _Y - x[0] * (_U**2 + _U * x[1]) / (_U**2 + _U * x[2] + x[3])


def osborne(x):
    return _OSBORNE - (x[0] + x[1] * jnp.exp(-_TENS * x[3]) + x[2] * jnp.exp(-_TENS * x[4]))


def jennrich_and_sampson(x):
    i = jnp.arange(1, 11)
    return 2.0 + 2.0 * i - jnp.exp(i * x[0]) - jnp.exp(i * x[1])


def wood(x):
    valleys = [10.0 * (x[1] - x[0] ** 2), 1.0 - x[0], 90.0**0.5 * (x[3] - x[2] ** 2), 1.0 - x[2]]
    return jnp.array([*valleys, 10.0**0.5 * (x[1] + x[3] - 2.0), 0.1**0.5 * (x[1] - x[3])])


PROBLEMS = {
    rosenbrock: (-1.2, 1.0),
    freudenstein_and_roth: (0.5, -2.0),
    helical_valley: (-1.0, 0.0, 0.0),
    bard: (1.0, 1.0, 1.0),
    box: (0.0, 10.0, 20.0),
    kowalik_and_osborne: (0.25, 0.39, 0.415, 0.39),
    osborne: (0.5, 1.5, -1.0, 0.01, 0.02),
    jennrich_and_sampson: (0.3, 0.4),
    wood: (-3.0, -1.0, -3.0, -1.0),
}

BOUNDS = {
    rosenbrock: ((-2.0, -2.0), (0.5, 2.0)),
    freudenstein_and_roth: ((-20.0, -30.0), (20.0, -0.9)),
    helical_valley: ((-2.0, -2.0, 0.5), (0.8, 2.0, 2.0)),
    bard: ((0.1, 0.0, 0.0), (1.0, 9.0, 9.0)),
    box: ((0.0, 0.0, 0.0), (20.0, 9.0, 30.0)),
    kowalik_and_osborne: ((0.0, 0.3, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0)),
    osborne: ((0.0, 0.0, -3.0, 0.0, 0.0), (0.36, 3.0, 3.0, 1.0, 1.0)),
    jennrich_and_sampson: ((0.0, 0.26), (1.0, 1.0)),
    wood: ((-5.0, -5.0, -5.0, -5.0), (5.0, 0.5, 5.0, 5.0)),
}


def model_of(function, size, bounds=None):
    """Return what a fit asks of a model, for one run whose weighted residuals are a function's."""
    asked = []

    def residuals(thetas, batch, limits=None):
        asked.append(len(thetas))
        return np.array([np.asarray(function(theta))[None] for theta in thetas])

    low, high = np.array(bounds or [[-1e3] * size, [1e3] * size])
    return SimpleNamespace(
        residuals=residuals, low=low, high=high, first_trial=np.full(size, 0.1), asked=asked
    )


@pytest.fixture(autouse=True)
def _without_types(monkeypatch):
    """Let a function stand in for a model."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


@pytest.mark.parametrize("function", PROBLEMS, ids=lambda function: function.__name__)
def test_a_textbook_problem_ends_at_the_minimum_that_scipy_finds(function):
    start = np.array(PROBLEMS[function])
    exact = least_squares(function, start, method="lm", xtol=1e-14, ftol=1e-14)
    model = model_of(function, start.size)
    fit = fit_batch(model, None, [start], [range(start.size)])[0]
    # the tolerance, a step's gain, is 1e-5; several such steps may be left
    assert fit.cost <= 2.0 * exact.cost * (1.0 + 1e-3) + 1e-9
    # two a step, and Wood's function takes most
    assert len(model.asked) < 120


@pytest.mark.parametrize("function", BOUNDS, ids=lambda function: function.__name__)
def test_within_bounds_it_ends_at_the_minimum_that_scipy_finds_there(function):
    low, high = np.array(BOUNDS[function])
    start = np.clip(PROBLEMS[function], low, high)
    inside = np.clip(start, low + 1e-9, high - 1e-9)  # scipy asks for such a start
    how = {"bounds": (low, high), "xtol": 1e-14, "ftol": 1e-14, "gtol": 1e-14}
    exact = min(least_squares(function, inside, method=m, **how).cost for m in ("trf", "dogbox"))
    model = model_of(function, start.size, (low, high))
    fit = fit_batch(model, None, [start], [range(start.size)])[0]
    assert fit.cost <= 2.0 * exact * (1.0 + 1e-3)
    assert np.any((fit.theta == low) | (fit.theta == high))  # or the bounds are none
    # a step that is only cut off takes 400 to 600 on six of the nine, and ends elsewhere on five
    assert sum(model.asked) < 150


def test_a_range_of_one_value_holds_a_parameter_and_lets_the_others_go():
    model = model_of(rosenbrock, 2, ((0.5, -2.0), (0.5, 2.0)))
    fit = fit_batch(model, None, [np.array([0.5, -1.0])], [range(2)])[0]
    np.testing.assert_allclose(fit.theta, [0.5, 0.25], rtol=1e-3)
