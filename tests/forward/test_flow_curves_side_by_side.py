"""Flow curves of many vectors at once: each steady state is the one that its law has."""

import numpy as np
import pytest
from in_continuous_time import ContinuousFluid
from scipy.optimize import brentq
from vectors import vector_of

from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel
from discover.protocols import start_up, steady_rates
from discover.protocols.protocol import in_flow

MODULI, TIMES, SOLVENT = np.array([60.0, 20.0]), np.array([0.1, 2.0]), 1.0
RATES, SLOW = np.geomspace(0.01, 300.0, 13), np.geomspace(0.01, 3.0, 5)
NAMES = "ptt_exponential", "thixotropy", "wall_slip", "bearing_friction", "rate_gain"


def curve(name, protocol, rates):
    return Run(name, 1.0 + np.arange(len(rates)), protocol, rates, np.full(len(rates), 50.0))


@pytest.fixture(scope="module")
def asked():
    """Return a model, flow curves in shear and extension, and vectors."""
    model = AugmentedModel(
        DeclaredModel.maxwell(MODULI, TIMES, solvent_viscosity=SOLVENT),
        list(map(make_effect, NAMES)),
    )
    batch = make_batch(
        [
            curve("shear", steady_rates(RATES), RATES),
            curve("extension", in_flow(steady_rates(SLOW), "uniaxial"), SLOW),
        ]
    )
    tried = (), ("ptt_exponential",), ("wall_slip",), NAMES
    return model, batch, np.array([vector_of(model, *names) for names in tried])


def ptt(rate, time, epsilon, extends):
    """Return the recorded stress over the modulus: f = exp(ε tr σ) is the one unknown."""
    flow = rate * time
    if not extends:
        # f σ12 = Wi and tr σ = 2 Wi σ12 / f
        f = brentq(lambda f: np.log(f) - 2.0 * epsilon * (flow / f) ** 2, 1.0, 1e9, xtol=1e-14)
        return flow / f
    along, across = (lambda f: 2.0 * flow / (f - 2.0 * flow)), (lambda f: -flow / (f + flow))
    least = max(1.0, 2.0 * flow * (1.0 + 1e-14))
    f = brentq(lambda f: np.log(f) - epsilon * (along(f) + 2.0 * across(f)), least, 1e9, xtol=1e-14)
    return along(f) - across(f)


def test_ptt_has_its_closed_flow_curve_in_shear_and_extension(asked):
    model, batch, vectors = asked
    found = model.predictions(vectors, batch)[1]
    epsilon = vectors[1][model.positions("ptt_exponential")[0]]
    for row, (rates, extends) in enumerate([(RATES, False), (SLOW, True)]):
        modes = [[g * ptt(r, t, epsilon, extends) for r in rates]
                 for g, t in zip(MODULI, TIMES, strict=True)]  # fmt: skip
        exact = np.sum(modes, axis=0) + (3.0 if extends else 1.0) * SOLVENT * rates
        np.testing.assert_allclose(found[row, : len(rates)], exact, rtol=1e-9)


def test_a_state_that_no_flow_reaches_is_told_and_spoils_none_beside_it(asked):
    model, batch, vectors = asked
    away = vector_of(model, ptt_exponential=-0.5)
    found, calm = model.predictions([away, vectors[0]], batch)
    # f² ln f = 2 ε Wi² is nowhere less than −1/(2 e)
    none = (TIMES[1] * RATES) ** 2 > 1.0 / (2.0 * np.e)
    newtonian = (MODULI @ TIMES + SOLVENT) * RATES
    # without one it is no number, or off by orders of magnitude: f is least 1/√e where there is one
    np.testing.assert_array_equal(found[0] < 2.0 * newtonian, ~none)
    assert 0 < np.sum(none) < len(RATES)
    np.testing.assert_allclose(calm[0], newtonian, rtol=1e-12)


def test_effects_on_flow_curves_are_where_a_start_up_ends(asked):
    model, batch, vectors = asked
    found = model.predictions(vectors, batch)
    long, any_of_them = np.array([100.0]), ContinuousFluid(model, vectors[0])
    for number, theta in enumerate(vectors):
        for place in (2, 7, 10):
            rate = RATES[place]
            run = Run("long", long, start_up(rate), np.full(1, rate), np.ones(1))
            # what is still to come after fifty of the longest time, to scipy's tolerance
            exact = any_of_them.of(theta).recorded(run)
            np.testing.assert_allclose(found[number, 0, place], exact[0], rtol=1e-5)
    # and not because effects do nothing
    assert np.all(np.max(np.abs(found[1:, 0] / found[0, 0] - 1.0), axis=1) > 1e-3)


def test_moduli_and_solvent_of_each_vector_are_those_of_a_model_that_declares_them(asked):
    model, batch, vectors = asked
    factors = np.array([1.0, 2.0, 0.5, 3.0])[:, None]
    found = model.predictions(vectors, batch, factors * model.moduli)
    # all stresses of modes and solvent grow alike, where nothing slips or rubs
    np.testing.assert_allclose(found[1], 2.0 * model.predictions(vectors, batch)[1], rtol=1e-9)
    other = AugmentedModel(
        DeclaredModel.maxwell(3.0 * MODULI, TIMES, solvent_viscosity=3.0 * SOLVENT), model.effects
    )
    np.testing.assert_allclose(found[3], other.predictions(vectors[3:], batch)[0], rtol=1e-12)
