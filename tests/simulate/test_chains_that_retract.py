"""Chains that retract within a fraction of λ, in steps of any length, against scipy."""

import numpy as np
import pytest
from independent import RoliePoly
from independent.homogeneous import UNIT
from scipy.integrate import solve_ivp

from discover.forward.of_fluids import bare_run, observed_in, pieces_in_time
from discover.laws import Fluid, make_law
from discover.protocols import start_up
from discover.simulate import simulate

MODULUS, TIMES = (1000.0, 300.0, 100.0), (1e-3, 0.1, 10.0)
SAMPLES = np.linspace(0.5, 30.0, 60)
RUN = bare_run(start_up(0.3), SAMPLES)


def exact(ratio, rate):
    """Return σ12 of three modes in Pa, on full tensors, by an implicit method."""
    total = np.zeros(len(SAMPLES))
    for modulus, time in zip(MODULUS, TIMES, strict=True):
        law = RoliePoly(0.5, ratio * time, modulus=modulus, relaxation_time=time)
        gradient = rate * UNIT["shear"]
        found = solve_ivp(
            lambda t, y, law=law, gradient=gradient: law.change(y, gradient),
            (0.0, SAMPLES[-1]), law.rest(), "Radau", SAMPLES, rtol=1e-8, atol=1e-10,
        )  # fmt: skip
        total += [law.stress(state, gradient)[0, 1] for state in found.y.T]
    return total


def fluid(ratio):
    law = make_law("rolie_poly", {"stretch_time_ratio": ratio, "beta": 0.5})
    return Fluid(law, MODULUS, TIMES)


def test_steps_much_longer_than_a_mode_and_its_retraction_follow_both():
    """The fastest mode relaxes in 1/500 of a step, and retracts in 1/5,000; it ran away."""
    wanted = exact(0.1, 0.3)
    found = observed_in(fluid(0.1), start_up(0.3), SAMPLES)[:, 0]
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.max(wanted))


@pytest.mark.slow
def test_steps_that_adapt_follow_them_to_the_tolerance():
    wanted = exact(0.1, 0.3)
    adapted = simulate(fluid(0.1), start_up(0.3), SAMPLES).shear_stress
    np.testing.assert_allclose(adapted, wanted, atol=1e-6 * np.max(wanted))


@pytest.mark.parametrize("ratio", [0.01, 0.5])
def test_steps_are_cut_until_cutting_them_changes_nothing(ratio):
    pieces = pieces_in_time(fluid(ratio), [RUN], 0.2)
    found = observed_in(fluid(ratio), start_up(0.3), SAMPLES, 0.2, pieces=pieces)[:, 0]
    wanted = exact(ratio, 0.3)
    # a change of 1e-4 on halving bounds the error of a method that converges
    assert np.linalg.norm(found - wanted) < 2e-4 * np.linalg.norm(wanted)
    assert pieces < 10


def test_a_law_that_does_not_retract_keeps_its_steps():
    assert pieces_in_time(Fluid(make_law("giesekus", {"alpha": 0.3}), 1.0, 1.0), [RUN], 0.2) == 1
