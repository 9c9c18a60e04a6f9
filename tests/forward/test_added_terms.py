"""Terms that effects add: the branch that a trial takes gives what the sum of all terms gives."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.effects import make_effect
from discover.forward.added_terms import AddedTerms

NAMES = (
    "sigma",
    "tr(sigma)*sigma",
    "sigma.sigma",
    "tr(sigma.gammadot)*gammadot.gammadot",
    "giesekus_mobility",
    "non_affine_motion",
    "ptt_exponential",
    "solvent_viscosity",
)
EFFECTS = [make_effect(name) for name in NAMES]
STRESS = np.random.default_rng(3).normal(size=(4, 5))
RATE = np.random.default_rng(4).normal(size=5)


def slices():
    ends = np.cumsum([len(effect.parameters) for effect in EFFECTS]).tolist()
    return {
        e.name: slice(end - len(e.parameters), end) for e, end in zip(EFFECTS, ends, strict=True)
    }


ADDED = AddedTerms(EFFECTS, slices())


@eqx.filter_jit
def added(theta, used):
    return ADDED.rate(theta, used)(jnp.asarray(STRESS), jnp.asarray(RATE))


def vector(sizes):
    theta = np.zeros(sum(len(effect.parameters) for effect in EFFECTS))
    for name, size in sizes.items():
        theta[slices()[name].start] = size
    return theta


@pytest.mark.parametrize(
    ("sizes", "branches"),
    [
        ({}, (0, 0)),
        ({"solvent_viscosity": 3.0}, (0, 0)),  # a stress beside the modes, no term
        ({"sigma": 0.3}, (1, 0)),
        ({"sigma": 0.3, "tr(sigma)*sigma": -0.1}, (1, 0)),  # one tensor
        ({"tr(sigma.gammadot)*gammadot.gammadot": 0.2}, (1, 0)),
        ({"sigma": 0.3, "sigma.sigma": 0.2}, (1, 0)),
        ({"non_affine_motion": 0.4}, (0, 2)),
        ({"sigma.sigma": 0.2, "ptt_exponential": 0.1}, (1, 3)),
        ({"giesekus_mobility": 0.4, "ptt_exponential": 0.1}, (0, 4)),
        ({name: 0.1 for name in NAMES}, (1, 4)),
    ],
)
def test_only_what_is_in_use_is_summed_and_all_of_it(sizes, branches):
    theta = vector(sizes)
    used = ADDED.in_use(theta)
    assert used[:2] == branches
    zero = np.zeros(5)
    deformation = np.stack([zero, zero, zero, RATE])
    expected = np.zeros((4, 5))
    for effect in EFFECTS:
        one = jax.vmap(effect.extra_term, in_axes=(None, -1, -1), out_axes=-1)
        expected += one(jnp.asarray(theta[slices()[effect.name]]), STRESS, deformation)
    np.testing.assert_allclose(added(theta, used), expected, atol=1e-13)


def test_terms_at_zero_are_not_computed():
    # beyond what a number holds 0 times a term is no number
    theta = vector({"sigma": 0.3})
    huge = jnp.full((4, 5), 1e200)
    rate = eqx.filter_jit(lambda t, used: ADDED.rate(t, used)(huge, jnp.asarray(RATE)))
    assert np.all(np.isfinite(rate(theta, ADDED.in_use(theta))))
    every = ADDED.in_use(vector({name: 0.1 for name in NAMES}))
    assert not np.all(np.isfinite(rate(theta, every)))
