"""Chains that retract within a fraction of λ, in steps of any length, against scipy."""

import jax.numpy as jnp
import numpy as np
import pytest
from independent import RoliePoly
from independent.homogeneous import UNIT
from scipy.integrate import solve_ivp

from discover.forward.exponential_weights import turned
from discover.forward.flow_batch import lay_out
from discover.forward.fluids import in_enough_steps, solve_batch
from discover.laws import Fluid, make_law
from discover.protocols import start_up
from discover.simulate import simulate

MODULUS, TIMES = (1000.0, 300.0, 100.0), (1e-3, 0.1, 10.0)
SAMPLES = np.linspace(0.5, 30.0, 60)


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
    flows = lay_out([start_up(0.3)], [SAMPLES])
    found = np.asarray(solve_batch(fluid(0.1), flows))[0, :, 3]
    np.testing.assert_allclose(found, wanted, atol=1e-3 * np.max(wanted))


@pytest.mark.slow
def test_steps_that_adapt_follow_them_to_the_tolerance():
    wanted = exact(0.1, 0.3)
    adapted = simulate(fluid(0.1), start_up(0.3), SAMPLES).shear_stress
    np.testing.assert_allclose(adapted, wanted, atol=1e-6 * np.max(wanted))


@pytest.mark.parametrize("ratio", [0.01, 0.5])
def test_steps_are_cut_until_cutting_them_changes_nothing(ratio):
    flows = lay_out([start_up(0.3)], [SAMPLES], strain_step=0.2)
    cut = in_enough_steps(fluid(ratio), flows)
    found = np.asarray(solve_batch(fluid(ratio), cut))[0, :, 3]
    wanted = exact(ratio, 0.3)
    # a change of 1e-4 on halving bounds the error of a method that converges
    assert np.linalg.norm(found - wanted) < 2e-4 * np.linalg.norm(wanted)
    assert cut.n_steps < 10 * flows.n_steps


def test_a_law_that_does_not_retract_keeps_its_steps():
    flows = lay_out([start_up(1.0)], [SAMPLES])
    assert in_enough_steps(Fluid(make_law("giesekus", {"alpha": 0.3}), 1.0, 1.0), flows) is flows


def test_a_state_turned_twice_is_itself_and_once_has_its_trace_first():
    state = jnp.arange(1.0, 11.0).reshape(2, 5)
    once = turned(state)
    np.testing.assert_allclose(once[:, 0], np.sum(state[:, :3], axis=1) / np.sqrt(3.0), rtol=1e-14)
    np.testing.assert_array_equal(once[:, 3:], state[:, 3:])
    np.testing.assert_allclose(turned(once), state, rtol=1e-14)
