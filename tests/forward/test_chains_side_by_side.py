"""Laws whose chains retract are predicted side by side, as exactly as others."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discover.dataset import Run
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel
from discover.laws import make_law
from discover.protocols import start_up
from discover.protocols.protocol import in_flow

MODULI, TIMES = np.array([60.0, 20.0]), np.array([0.2, 2.0])
RATIO, BETA = 0.05, 0.5
SHEAR, EXTENSION = np.array([[0, 1, 0], [0, 0, 0], [0, 0, 0]]), np.diag([1.0, -0.5, -0.5])
WHEN = np.geomspace(0.02, 4.0, 40)


def runs():
    rate, record = np.full(len(WHEN), 3.0), np.full(len(WHEN), 50.0)
    return [
        Run("shear", WHEN, start_up(3.0), rate, record),
        Run("extension", 0.3 * WHEN, in_flow(start_up(3.0), "uniaxial"), rate, record),
    ]


@pytest.fixture(scope="module")
def predicted():
    """Return a function from a law to predictions of nine vectors."""

    def of(law):
        model = AugmentedModel(DeclaredModel(law, MODULI, TIMES, fit_modulus=True), [])
        thetas = np.tile(model.zero(), (9, 1))
        thetas[:, 0] = np.linspace(0.0, 0.8, 9)
        return model.predictions(thetas, make_batch(runs()))

    return of


def rolie_poly(gradient, when):
    """Return σ(t) of the modes over their moduli, by scipy from the equation as published."""

    def of(time):
        flow = 3.0 * time * gradient

        def change(_, a):
            a = a.reshape(3, 3)
            still = a - np.eye(3)
            stretch = np.sqrt(np.trace(a) / 3.0)
            pull = 2.0 / RATIO * (1.0 - 1.0 / stretch)
            released = a + BETA / stretch * still
            return (flow @ a + a @ flow.T - still - pull * released).ravel()

        own = when / time
        found = solve_ivp(
            change, (0, own[-1]), np.eye(3).ravel(), "LSODA", own, rtol=1e-10, atol=1e-12
        )
        return found.y.T.reshape(-1, 3, 3) - np.eye(3)

    return [of(time) for time in TIMES]


def test_rolie_poly_follows_its_equation_in_shear_and_extension(predicted):
    law = make_law("rolie_poly", {"stretch_time_ratio": RATIO, "beta": BETA})
    found = predicted(law)
    shear, extension = rolie_poly(SHEAR, WHEN), rolie_poly(EXTENSION, 0.3 * WHEN)
    sheared = sum(g * a[:, 0, 1] for g, a in zip(MODULI, shear, strict=True))
    drawn = sum(g * (a[:, 0, 0] - a[:, 1, 1]) for g, a in zip(MODULI, extension, strict=True))
    exact = np.stack([sheared, drawn])
    # the error of the steps that a loop takes, largest where chains stretch
    np.testing.assert_allclose(found[0] / exact, 1.0, atol=2e-4)
    np.testing.assert_allclose(found, found[0] * np.exp(np.linspace(0, 0.8, 9))[:, None, None])


def test_a_blend_of_chains_that_are_all_long_is_the_law_of_these(predicted):
    alone = make_law("rolie_poly", {"stretch_time_ratio": RATIO, "beta": BETA})
    blend = make_law(
        "rolie_poly_blend",
        {
            "long_fraction": 1.0, "short_time_ratio": 0.3, "stretch_time_ratio": RATIO,
            "short_stretch_time_ratio": 0.5, "beta": BETA,
        },
    )  # fmt: skip
    # the stress is carried beside the tensors that make it up: roundings
    np.testing.assert_allclose(predicted(blend), predicted(alone), rtol=1e-9)
