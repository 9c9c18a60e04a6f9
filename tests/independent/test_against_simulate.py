"""The software's own integrator against code that shares nothing with it."""

import numpy as np
import pytest
from independent import (
    FenePeterlin,
    Giesekus,
    JohnsonSegalman,
    PhanThienTanner,
    UpperConvectedMaxwell,
    oscillation,
)

from discover.laws import Fluid, make_law
from discover.protocols import oscillatory_shear
from discover.simulate import simulate

G, LAMBDA = 80.0, 0.7
SCALE = {"modulus": G, "relaxation_time": LAMBDA}
LAWS = {
    "ucm": ({}, UpperConvectedMaxwell(**SCALE)),
    "johnson_segalman": ({"xi": 0.4}, JohnsonSegalman(0.4, **SCALE)),
    "giesekus": ({"alpha": 0.3}, Giesekus(0.3, **SCALE)),
    "ptt_linear": ({"epsilon": 0.4}, PhanThienTanner(0.4, **SCALE)),
    "ptt_exponential": ({"epsilon": 0.4}, PhanThienTanner(0.4, "exponential", **SCALE)),
    "fene_p": ({"L2": 30.0}, FenePeterlin(30.0, **SCALE)),
}
TOLERANCE = 1e-6
"""Of the largest stress; both integrate to 1e-8 or better at each step."""


# each law at any state: `tests/laws/test_law_accuracy.py`
@pytest.mark.parametrize(
    "name", [n if n == "fene_p" else pytest.param(n, marks=pytest.mark.slow) for n in LAWS]
)
def test_simulate_agrees_with_scipy(name):
    parameters, independent = LAWS[name]
    times = np.linspace(0.0, 12.0, 61)
    ours = simulate(
        Fluid(make_law(name, parameters), G, LAMBDA), oscillatory_shear(4.0, 1.3, 0.3), times
    )
    theirs = independent.respond(oscillation(4.0, 1.3, 0.3), times)
    scale = TOLERANCE * np.max(np.abs(theirs.N1))
    np.testing.assert_allclose(ours.shear_stress, theirs.sigma12, rtol=0, atol=scale)
    np.testing.assert_allclose(ours.first_normal_stress_difference, theirs.N1, rtol=0, atol=scale)
    np.testing.assert_allclose(ours.second_normal_stress_difference, theirs.N2, rtol=0, atol=scale)


def test_the_agreement_can_fail():
    times = np.linspace(0.0, 12.0, 61)
    fluid = Fluid(make_law("giesekus", {"alpha": 0.301}), G, LAMBDA)
    ours = simulate(fluid, oscillatory_shear(4.0, 1.3, 0.3), times).shear_stress
    theirs = Giesekus(0.3, **SCALE).respond(oscillation(4.0, 1.3, 0.3), times)
    assert np.max(np.abs(ours - theirs.sigma12)) > 100 * TOLERANCE * np.max(np.abs(theirs.N1))
