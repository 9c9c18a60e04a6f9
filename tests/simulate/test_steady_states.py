"""Steady states that are solved for, against start-ups that scipy follows until they are steady."""

import numpy as np
import pytest
from independent import PhanThienTanner, steps
from independent.authors import ByAuthors, rolie_poly_fene
from independent.homogeneous import GiesekusFluid
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.of_fluids import observed_in
from discover.laws import Fluid, make_law
from discover.laws.expansion import law_of_terms
from discover.protocols import after_steady_flow, in_flow, start_up
from discover.protocols.control import steady_rates
from discover.simulate import SimulationError, simulate
from tensor_library.law_terms import LawTerms

MODULUS, TIME, MOBILITY = (100.0, 300.0), (1.0, 0.1), 0.3
RATES = np.array([0.02, 1.0, 30.0])
COUNTED = np.arange(1.0, 4.0)


def giesekus(mobility=MOBILITY):
    return Fluid(make_law("giesekus", {"alpha": mobility}), MODULUS, TIME)


@pytest.mark.parametrize("kind", ["shear", "uniaxial"])
def test_a_steady_state_is_where_a_start_up_ends(kind):
    scipy = GiesekusFluid(MODULUS, TIME, MOBILITY)
    exact = [scipy.recorded(kind, lambda _, r=r: r, np.array([40.0]))[0] for r in RATES]
    flow = in_flow(steady_rates(RATES), kind)
    found = simulate(giesekus(), flow, COUNTED).components
    recorded = found[:, 3] if kind == "shear" else found[:, 0] - found[:, 1]
    np.testing.assert_allclose(recorded, exact, rtol=1e-6)  # scipy's tolerance over 40 times


def test_where_there_is_no_steady_state_or_none_is_reached_none_is_told():
    # h = −2 γ̇²: nothing relaxes, and the stress grows for ever
    fluid = Fluid(law_of_terms(LawTerms({"gammadot.gammadot": -2.0}), False), 1.0, 1.0)
    with pytest.raises(SimulationError, match="no steady state"):
        simulate(fluid, steady_rates(RATES), COUNTED)
    # at a Weissenberg number of 1e5 the steps end at springs of no strength: that is no answer
    fluid = Fluid.dimensionless(make_law("fene_p", {"L2": 50.0}))
    found = observed_in(fluid, steady_rates([1.0, 1e5]), np.array([1.0, 2.0]))[:, 0]
    assert found[0] == pytest.approx(fene_p_shear_stress(50.0, 1.0), rel=1e-6)
    assert np.isnan(found[1]) or found[1] == pytest.approx(fene_p_shear_stress(50.0, 1e5))


FAST = np.array([30.0, 100.0, 316.0, 1000.0])


def fene_p_shear_stress(limit, rate):
    """Return σ12/G of A12 = Wi/f², A22 = A33 = 1/f, A11 = 1/f + 2 Wi²/f³; f is the root."""

    def off(f):
        trace = 3.0 / f + 2.0 * rate**2 / f**3
        return f * (limit - trace) - (limit - 3.0)

    return rate / brentq(off, 1.0, 1e4)


def followed_until_steady(rate, constants):
    law = ByAuthors(rolie_poly_fene, constants)
    states = solve_ivp(
        lambda t, y: law.change(y, rate), (0, 30.0), law.rest(), "Radau", rtol=1e-9, atol=1e-11
    )
    return law.stress(states.y[:, -1], rate)[0, 1]


CHAINS = {"stretch_time_ratio": 0.25, "beta": 0.0, "maximum_stretch": 5.0}


@pytest.mark.parametrize(
    "name", ["fene_p", pytest.param("rolie_poly_fene", marks=pytest.mark.slow)]
)
def test_chains_that_end_have_the_steady_state_of_their_start_up_however_fast(name):
    """FENE-P is at rest without strength too, where the steps used to end from Wi 100 on."""
    if name == "fene_p":
        law, wanted = make_law(name, {"L2": 50.0}), [fene_p_shear_stress(50.0, r) for r in FAST]
    else:
        law, wanted = make_law(name, CHAINS), [followed_until_steady(r, CHAINS) for r in FAST]
    flow, times = steady_rates(FAST), np.arange(1.0, 5.0)
    found = observed_in(Fluid.dimensionless(law), flow, times)[:, 0]
    np.testing.assert_allclose(found, wanted, rtol=1e-6)
    constants = {"L2": 50.0} if name == "fene_p" else CHAINS
    model = AugmentedModel(DeclaredModel.named(name, constants, np.ones(1), np.ones(1)), [])
    run = Run("curve", times, flow, FAST, np.ones(4))
    np.testing.assert_allclose(model.predict(model.zero(), make_batch([run]))[0], wanted, rtol=1e-6)


@pytest.mark.parametrize("ratio", [0.1, 1.0])
def test_chains_with_few_arms_are_not_steady_beyond_their_end(ratio):
    """q = 1.5: where a backbone is drawn to q its stress is 3 q² Wi/(3 + 2 Wi²), and no more."""
    rates = np.array([3.0, 10.0, 100.0, 1e4])
    law = make_law("pom_pom", {"q": 1.5, "stretch_time_ratio": ratio})
    curve = steady_rates(rates)
    found = observed_in(Fluid.dimensionless(law), curve, np.arange(1.0, 5.0))[:, 0]
    ends = 3.0 * 1.5**2 * rates / (3.0 + 2.0 * rates**2)
    # growth stops at q only if it is faster than retraction there: Wi²/(3 + 2 Wi²) > (1 − 1/q)/θ
    drawn_to_the_end = rates**2 / (3.0 + 2.0 * rates**2) > (1.0 - 1.0 / 1.5) / ratio
    np.testing.assert_allclose(found[drawn_to_the_end], ends[drawn_to_the_end], rtol=1e-6)
    assert np.all(found[~drawn_to_the_end] < ends[~drawn_to_the_end])


BEFORE, AFTER = 20.0, 0.1
TIMES = np.geomspace(1e-3, 60.0, 60)


@pytest.mark.parametrize(
    ("time", "epsilon", "told"),
    [
        pytest.param(0.036, 5.8, True, marks=pytest.mark.slow), (0.014, 8.3, True),
        (0.9, 0.5, True), (0.03, 10.0, False), (0.1, 10.0, False), (0.5, 10.0, False),
    ],
)  # fmt: skip
def test_the_stress_before_a_step_is_that_of_the_steady_flow_with_and_without_its_time_told(
    time, epsilon, told
):
    """In steps of a strain of one a law that thins ran away where it relaxes in 0.1 s or less."""
    fluid = Fluid(make_law("ptt_linear", {"epsilon": epsilon}), 1.0, time)
    flow = after_steady_flow(start_up(AFTER), BEFORE, end=float(TIMES[-1]))
    found = observed_in(fluid, flow, TIMES, **({"relaxation_time": time} if told else {}))[:, 0]
    law = PhanThienTanner(extensibility=epsilon, relaxation_time=time)
    held = 200.0 * time
    exact = law.respond(steps([0.0, held], [BEFORE, AFTER]), held + TIMES).sigma12
    # in steps of a strain of one throughout, the first case is off by 35 %
    np.testing.assert_allclose(found, exact, atol=(2e-5 if told else 1e-3) * exact[0])
