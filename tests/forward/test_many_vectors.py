"""Many vectors at once are predicted as each is by the program that takes them one by one."""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset import Run
from discover.effects import ConstitutiveEffect, EffectParameter, make_effect
from discover.effects.library_term import library_effects
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel
from discover.forward.program import Program
from discover.protocols import oscillatory_shear, start_up
from discover.protocols.protocol import in_flow

NAMES = (
    "giesekus_mobility", "ptt_exponential", "thixotropy", "viscous_heating", "tool_compliance",
    "wall_slip", "rate_rise_time", "transducer_lag", "relaxation_mode",
)  # fmt: skip
TERMS = "tr(sigma.sigma)*sigma.sigma", "tr(sigma.gammadot)*I"


def runs():
    times = np.linspace(0.02, 6.0, 60)
    record = np.full(60, 50.0)
    return [
        Run("start-up", times, start_up(0.5), np.full(60, 0.5), record),
        Run("waves", times[:50], oscillatory_shear(2.0, 1.5), np.zeros(50), record[:50]),
        Run("extension", 0.3 * times, in_flow(start_up(0.5), "uniaxial"), np.full(60, 0.5), record),
    ]


@pytest.fixture(scope="module")
def asked():
    """Return a model, runs, and vectors with each effect and with two of them."""
    terms = [term for term in library_effects() if term.name in TERMS]
    assert len(terms) == len(TERMS)
    effects = [*map(make_effect, NAMES), *terms]
    declared = DeclaredModel.maxwell([60.0, 20.0], [0.1, 2.0], solvent_viscosity=1.0)
    model = AugmentedModel(declared, effects)
    names = [effect.name for effect in effects]
    vectors = [model.zero()]
    for one, other in zip(names, names[1:] + names[:1], strict=True):
        for together in ([one], [one, other]):
            theta = model.zero()
            for name in together:
                theta[model.positions(name)] = model.first_trial[model.positions(name)]
            vectors.append(theta)
    vectors[3][1] = 0.2  # other times than those that most have
    return model, make_batch(runs()), np.array(vectors)


def one_by_one(model, vectors, batch, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(Program, "side_by_side", lambda *_: None)
        return model.predictions(vectors, batch)


def test_effects_of_every_kind_agree_with_the_other_program(asked, monkeypatch):
    model, batch, vectors = asked
    found = model.predictions(vectors, batch)
    other = one_by_one(model, vectors, batch, monkeypatch)
    largest = np.max(np.abs(other), axis=2, keepdims=True)
    assert np.all(np.isfinite(other))
    # the same scheme in the same steps: roundings alone
    np.testing.assert_allclose(found / largest, other / largest, atol=1e-11)
    # and not because effects do nothing
    assert np.min(np.max(np.abs(other[1:] - other[0]) / largest[0], axis=(1, 2))) > 1e-6


def test_a_vector_does_not_depend_on_those_beside_it(asked):
    model, batch, vectors = asked
    together = model.predictions(vectors, batch)
    for i in (0, 3, 7, len(vectors) - 1):
        alone = model.predictions(vectors[i : i + 1], batch)[0]
        largest = np.max(np.abs(alone))
        np.testing.assert_allclose(together[i], alone, atol=1e-12 * largest)


def test_a_trial_that_runs_away_is_told_from_the_same_sample_on(asked, monkeypatch):
    model, batch, vectors = asked
    away = model.zero()
    away[model.positions(TERMS[0])] = -5.0
    found, calm = model.predictions([away, vectors[1]], batch)
    other = one_by_one(model, [away], batch, monkeypatch)[0]
    assert np.any(~np.isfinite(other))
    # what is too large by far in the one may be no number in the other
    bounded = [np.abs(stress) < 1e6 for stress in (found, other)]
    np.testing.assert_array_equal(*bounded)
    np.testing.assert_allclose(calm, model.predictions(vectors[1:2], batch)[0], rtol=1e-12)
    assert np.all(np.isinf(model.residuals([away], batch, np.array([1e9]))))


@dataclass(frozen=True)
class Iterated(ConstitutiveEffect):
    """An effect of a user's own that asks for what lanes do not know."""

    def extra_term(self, values, stress, rate):
        """Return c times σ, found by adding it up in a loop."""
        del rate
        total = jax.lax.fori_loop(0, 2, lambda _, x: x + 0.5 * stress, jnp.zeros_like(stress))
        return values[0] * total


def test_an_effect_that_lanes_do_not_know_is_predicted_all_the_same():
    amplitude = EffectParameter("c", "c", low=0.0, high=10.0, range_source="a test")
    effect = Iterated("iterated", (amplitude,), equation="c", source="a test", check="none")
    model = AugmentedModel(DeclaredModel.maxwell(50.0, 2.0), [effect])
    times = np.linspace(0.1, 6.0, 20)
    batch = make_batch([Run("a", times, start_up(0.5), np.full(20, 0.5), np.full(20, 10.0))])
    theta = model.zero()
    theta[model.positions("iterated")] = 1.0
    # with c = 1 the mode relaxes twice as fast
    exact = 50.0 * 0.5 * 1.0 * (1.0 - np.exp(-times / 1.0))
    # the error of the steps that a loop takes
    np.testing.assert_allclose(model.predict(theta, batch)[0], exact, rtol=1e-5)
