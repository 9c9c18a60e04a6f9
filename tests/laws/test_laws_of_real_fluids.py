"""Laws of melts, solutions and gels against the same equations on full tensors in scipy."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent.homogeneous import UNIT
from scipy.integrate import solve_ivp

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import make_law
from discover.protocols import in_flow, start_up
from discover.simulate import simulate_homogeneous_flow

ONE = np.eye(3)


# Each returns what the upper convected derivative of A = I + σ is, as its authors write it.
def rolie_poly(a, gradient, stretch_time_ratio, beta):
    stretch = np.sqrt(np.trace(a) / 3)
    retraction = 2 / stretch_time_ratio * (1 - 1 / stretch)
    return -(a - ONE) - retraction * (a + beta / stretch * (a - ONE))


def cohen(squared, limit):
    """Return Cohen's approximation of the inverse Langevin function, over that at rest."""

    def spring(ratio):
        return (3 - ratio) / (1 - ratio)

    return spring(squared / limit) / spring(1 / limit)


def rolie_poly_fene(a, gradient, stretch_time_ratio, beta, maximum_stretch):
    stretch = np.sqrt(np.trace(a) / 3)
    k = cohen(stretch**2, maximum_stretch**2)
    retraction = 2 / stretch_time_ratio * k * (1 - 1 / stretch)
    return -(a - ONE) - retraction * (a + beta / stretch * (a - ONE))


def xpp(a, gradient, q, stretch_time_ratio, alpha):
    s = a - ONE
    stretch = np.sqrt(1 + abs(np.trace(s)) / 3)
    f = 2 / stretch_time_ratio * np.exp(2 / q * (stretch - 1)) * (1 - 1 / stretch)
    f += (1 - alpha * np.trace(s @ s) / 3) / stretch**2
    return -(alpha * s @ s + f * s + (f - 1) * ONE)


def white_metzner(a, gradient, k, n):
    rate = gradient + gradient.T
    size = np.sqrt(0.5 * np.trace(rate @ rate))
    return -(a - ONE) * (1 + (k * size) ** 2) ** ((1 - n) / 2)


def saramito(a, gradient, yield_strain):
    s = a - ONE
    deviator = s - np.trace(s) / 3 * ONE
    size = np.sqrt(0.5 * np.trace(deviator @ deviator))
    return -max(0.0, 1 - yield_strain / size if size > 0 else 0.0) * s


def giesekus_non_affine(a, gradient, alpha, xi):
    s, rate = a - ONE, gradient + gradient.T
    return -s - alpha * s @ s - xi / 2 * (s @ rate + rate @ s)


def ptt_exponential_non_affine(a, gradient, epsilon, xi):
    s, rate = a - ONE, gradient + gradient.T
    return -np.exp(epsilon * np.trace(s)) * s - xi / 2 * (s @ rate + rate @ s)


LAWS_AND_CONSTANTS = [
    (rolie_poly, {"stretch_time_ratio": 0.1, "beta": 0.7}),
    (xpp, {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}),
    (rolie_poly_fene, {"stretch_time_ratio": 0.3, "beta": 0.5, "maximum_stretch": 2.0}),
    (white_metzner, {"k": 0.8, "n": 0.4}),
    (saramito, {"yield_strain": 0.4}),
    (giesekus_non_affine, {"alpha": 0.2, "xi": 0.1}),
    (ptt_exponential_non_affine, {"epsilon": 0.2, "xi": 0.15}),
]
named = pytest.mark.parametrize(
    ("law", "constants"), LAWS_AND_CONSTANTS, ids=lambda p: getattr(p, "__name__", "")
)


def stress(law, constants, gradient, times, relaxation_time=1.0):
    """Return σ/G in a start-up, (n, 3, 3)."""
    scaled = gradient * relaxation_time

    def change(t, y):
        a = y.reshape(3, 3)
        return ((scaled @ a + a @ scaled.T + law(a, scaled, **constants)) / relaxation_time).ravel()

    # Radau: retraction is stiff
    found = solve_ivp(change, (0, times[-1]), ONE.ravel(), "Radau", times, rtol=1e-9, atol=1e-11)
    conformation = found.y.T.reshape(-1, 3, 3)
    if law is not rolie_poly_fene:
        return conformation - ONE
    squared = np.trace(conformation, axis1=1, axis2=2) / 3
    return cohen(squared, constants["maximum_stretch"] ** 2)[:, None, None] * (conformation - ONE)


@named
@pytest.mark.parametrize(("kind", "rate"), [("shear", 3.0), ("uniaxial", 0.8), ("biaxial", 0.3)])
def test_a_law_is_its_authors_in_shear_and_in_extension(law, constants, kind, rate):
    times = np.linspace(0.05, 3.0, 30)
    gradient = rate * UNIT[kind]
    made = make_law(law.__name__, constants)
    found = simulate_homogeneous_flow(made, lambda t: jnp.asarray(gradient), times)
    exact = stress(law, constants, gradient, times)
    # rtol of both integrators, with room for a retraction ten times as fast as the flow
    np.testing.assert_allclose(found, exact, atol=1e-5 * np.max(np.abs(exact)))


@named
def test_four_components_say_what_full_tensors_say(law, constants):
    made = make_law(law.__name__, constants)
    full = np.array([[1.3, 0.6, 0.0], [0.6, 0.2, 0.0], [0.0, 0.0, -0.1]])
    rate = np.array([[0.4, 1.1, 0.0], [1.1, -0.3, 0.0], [0.0, 0.0, -0.1]])
    at = [0, 1, 2, 0], [0, 1, 2, 1]
    short = made.extra_term(jnp.asarray(full[at]), jnp.asarray(rate[at]))
    np.testing.assert_allclose(
        short, made.extra_term(jnp.asarray(full), jnp.asarray(rate))[at], rtol=1e-12, atol=1e-14
    )


@pytest.mark.parametrize(("law", "constants"), LAWS_AND_CONSTANTS[:2], ids=["rolie_poly", "xpp"])
@pytest.mark.parametrize(("kind", "rate"), [("shear", 2.0), ("uniaxial", 0.5)])
def test_fast_modes_of_a_retracting_law_need_no_small_steps(law, constants, kind, rate):
    """The trace of the fastest mode relaxes within 1e-5 of a step."""
    modulus, time = np.array([1000.0, 300.0, 50.0]), np.array([1e-4, 1e-2, 3.0])
    times = np.linspace(0.1, 4.0, 40)
    declared = DeclaredModel.named(law.__name__, constants, modulus, time)
    model = AugmentedModel(declared, [])
    run = Run("run", times, in_flow(start_up(rate), kind), np.full(40, rate), np.ones(40))
    found = model.predict(model.zero(), make_batch([run]))[0]
    gradient = rate * UNIT[kind]
    exact = sum(
        g * stress(law, constants, gradient, times, t) for g, t in zip(modulus, time, strict=True)
    )
    wanted = exact[:, 0, 1] if kind == "shear" else exact[:, 0, 0] - exact[:, 1, 1]
    # what the fixed steps of a fit cost, 1e-6 of other laws; a retraction is ten times as fast
    np.testing.assert_allclose(found, wanted, atol=2e-4 * np.max(np.abs(wanted)))
