"""Steady states that are solved for, against start-ups that scipy follows until they are steady."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent.homogeneous import GiesekusFluid

from discover import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.laws.giesekus import Giesekus
from discover.protocols import in_flow, start_up
from discover.protocols.control import steady_rates
from discover.simulate import SimulationError, lay_out, simulate, solve_batch
from discover.simulate.steady_states import steady_state

MODULUS, TIME, MOBILITY = (100.0, 300.0), (1.0, 0.1), 0.3
RATES = np.array([0.02, 1.0, 30.0])
COUNTED = np.arange(1.0, 4.0)


def giesekus(mobility=MOBILITY):
    return Fluid(make_law("giesekus", {"alpha": mobility}), MODULUS, TIME)


@pytest.mark.parametrize("kind", ["shear", "uniaxial"])
def test_a_steady_state_is_where_a_start_up_ends(kind):
    exact = [
        GiesekusFluid(MODULUS, TIME, MOBILITY).recorded(kind, lambda _, r=r: r, np.array([40.0]))[0]
        for r in RATES
    ]
    flow = in_flow(steady_rates(RATES), kind)
    found = simulate(giesekus(), flow, COUNTED).components
    recorded = found[:, 3] if kind == "shear" else found[:, 0] - found[:, 1]
    np.testing.assert_allclose(recorded, exact, rtol=1e-6)  # scipy's tolerance over 40 times


def test_a_steady_state_follows_the_mobility_as_its_differences_do():
    def stress(mobility):
        fluid = Fluid(Giesekus(mobility), MODULUS, TIME)
        return fluid.stress(steady_state(fluid, jnp.asarray(3.0)), jnp.asarray(3.0))

    step = 1e-4  # the difference errs by its square
    expected = (stress(MOBILITY + step) - stress(MOBILITY - step)) / (2.0 * step)
    for derivative in (jax.jacfwd(stress), jax.jacrev(stress)):
        np.testing.assert_allclose(derivative(MOBILITY), expected, rtol=1e-6, atol=1e-9)


def test_a_batch_holds_what_goes_on_in_time_and_what_is_steady_in_the_order_of_its_runs():
    times = np.linspace(0.0, 40.0, 5)
    flows = [start_up(1.0), steady_rates(RATES), start_up(30.0)]
    found = solve_batch(giesekus(), lay_out(flows, [times, COUNTED, times]))
    # every start-up ends in the steady state of its rate, exp(−40) away
    np.testing.assert_allclose(found[0, 4], found[1, 1], rtol=1e-6)
    np.testing.assert_allclose(found[2, 4], found[1, 2], rtol=1e-6)


def test_a_law_without_a_steady_state_says_so():
    # h = −2 γ̇²: nothing relaxes, and the stress grows for ever
    fluid = Fluid(law_of_terms(["gammadot.gammadot"], [-2.0], {}, False), 1.0, 1.0)
    with pytest.raises(SimulationError, match="no steady state"):
        simulate(fluid, steady_rates(RATES), COUNTED)
