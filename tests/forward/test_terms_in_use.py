"""Terms that effects add: what a trial has in use is summed, and nothing else is looked at."""

import jax.numpy as jnp
import numpy as np
import pytest

from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel
from discover.forward.side_by_side.step import Flags, Step, laid_out

NAMES = (
    "sigma", "tr(sigma)*sigma", "sigma.sigma", "tr(sigma.gammadot)*gammadot.gammadot",
    "giesekus_mobility", "non_affine_motion", "ptt_exponential", "solvent_viscosity",
)  # fmt: skip
EFFECTS = [make_effect(name) for name in NAMES]
STRESS = np.random.default_rng(3).normal(size=4)
RATE = np.array([0.0, 0.0, 0.0, 0.7])


@pytest.fixture(scope="module")
def model():
    return AugmentedModel(DeclaredModel.maxwell(50.0, 2.0), EFFECTS)


def added(model, sizes, stress=STRESS, used=None):
    """Return what a trial of these sizes adds to a mode."""
    thetas = np.zeros((2, model.size))
    for theta, of in zip(thetas, (sizes, sizes if used is None else used), strict=True):
        for name, size in of.items():
            theta[model.positions(name)[0]] = size
    fluid, numbers = model._predictor.program.fluid, model._predictor._numbers
    mode, shared = laid_out(fluid, numbers, jnp.asarray(thetas[0]))
    flags = Flags(fluid)
    on = dict(zip(flags.names, flags.of(thetas)[1].tolist(), strict=True))
    step = Step(fluid, numbers.law)
    return step._added(shared, mode, on, jnp.asarray(stress), jnp.asarray(RATE))


@pytest.mark.parametrize(
    "sizes",
    [
        {},
        {"solvent_viscosity": 3.0},  # a stress beside the modes, no term
        {"sigma": 0.3},
        {"sigma": 0.3, "tr(sigma)*sigma": -0.1},  # one tensor
        {"tr(sigma.gammadot)*gammadot.gammadot": 0.2},
        {"sigma": 0.3, "sigma.sigma": 0.2},
        {"non_affine_motion": 0.4},
        {"sigma.sigma": 0.2, "ptt_exponential": 0.1},
        {"giesekus_mobility": 0.4, "ptt_exponential": 0.1},
        dict.fromkeys(NAMES, 0.1),
    ],
)
def test_only_what_is_in_use_is_summed_and_all_of_it(model, sizes):
    expected = np.zeros(4)
    for effect in EFFECTS:
        values = np.zeros(len(effect.parameters))
        values[0] = sizes.get(effect.name, 0.0)
        expected += effect.extra_term(jnp.asarray(values), jnp.asarray(STRESS), jnp.asarray(RATE))
    np.testing.assert_allclose(added(model, sizes), expected, atol=1e-13)


def test_terms_at_zero_are_not_computed(model):
    # beyond what a number holds 0 times a term is no number
    huge = np.full(4, 1e200)
    assert np.all(np.isfinite(added(model, {"sigma": 0.3}, huge)))
    every = dict.fromkeys(NAMES, 0.1)
    assert not np.all(np.isfinite(added(model, {"sigma": 0.3}, huge, used=every)))
