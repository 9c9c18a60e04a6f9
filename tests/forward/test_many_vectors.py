"""Many vectors at once are predicted as their equations say, whatever code these ask for."""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compilations import compilations
from fluids_with_effects import effects_in, fluid_with, instrument_with
from independent import oscillation
from independent.instruments import Instrument
from vectors import vector_of

from discover.dataset import Run
from discover.effects import ConstitutiveEffect, EffectParameter, make_effect
from discover.effects.library_term import library_effects
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel
from discover.forward.side_by_side import code
from discover.protocols import oscillatory_shear, start_up
from discover.protocols.protocol import in_flow

NAMES = (
    "giesekus_mobility", "ptt_exponential", "thixotropy", "viscous_heating", "tool_compliance",
    "wall_slip", "rate_rise_time", "transducer_lag", "relaxation_mode",
)  # fmt: skip
TERMS = "tr(sigma.sigma)*sigma.sigma", "tr(sigma.gammadot)*sigma.sigma"  # one tensor


MODES = (60.0, 0.1), (20.0, 2.0)


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
    declared = DeclaredModel.maxwell(*zip(*MODES, strict=True), solvent_viscosity=1.0)
    model = AugmentedModel(declared, effects)
    names = [effect.name for effect in effects]
    vectors = [model.zero()]
    for one, other in zip(names, names[1:] + names[:1], strict=True):
        vectors += [vector_of(model, one), vector_of(model, one, other)]
    vectors[3][1] = 0.2  # times of e^0.2 of those that most have
    return model, make_batch(runs()), np.array(vectors)


def test_effects_of_every_kind_follow_their_equations(asked):
    model, batch, vectors = asked
    found = model.predictions(vectors, batch)
    largest = np.max(np.abs(found), axis=2, keepdims=True)
    assert np.all(np.isfinite(found))
    waves, pulled = (run.time for run in runs()[1:])
    # those with one effect, and two terms of the library together
    for number in (*range(1, len(vectors), 2), -3):
        effects = effects_in(model, vectors[number], (*NAMES, *TERMS))
        if "tool_compliance" in effects:
            continue  # beside a solvent the rate lags too: test_state_effects.py
        modes = [(modulus, time * np.exp(vectors[number][1])) for modulus, time in MODES]
        fluid, bench = fluid_with(effects, modes, solvent=1.0), instrument_with(effects)
        exact = bench.record(fluid, oscillation(2.0, 1.5), waves).stress
        # the error of the steps: what gives way, what the instrument shapes, and heat, which is
        # the work of each step, are of first or second order in them, the modes of fourth
        slow = bench != Instrument() or "viscous_heating" in effects
        off = np.abs(found[number, 1, : len(waves)] - exact) / largest[number, 1]
        assert np.max(off) < (4e-3 if slow else 2e-5), effects
        if "thixotropy" in effects:
            continue  # of a shear rate alone; in extension: tests/effects/test_structure.py
        off = np.abs(found[number, 2] - fluid.pull(0.5, pulled)) / largest[number, 2]
        assert np.max(off) < (4e-3 if "viscous_heating" in effects else 2e-5), effects
    # and not because effects do nothing
    assert np.min(np.max(np.abs(found[1:] - found[0]) / largest[0], axis=(1, 2))) > 1e-6


def test_a_vector_does_not_depend_on_those_beside_it(asked):
    model, batch, vectors = asked
    together = model.predictions(vectors, batch)
    for i in (0, 3, 7, len(vectors) - 1):
        alone = model.predictions(vectors[i : i + 1], batch)[0]
        largest = np.max(np.abs(alone))
        np.testing.assert_allclose(together[i], alone, atol=1e-12 * largest)


def test_a_trial_that_runs_away_is_told_from_the_sample_on_where_shorter_steps_tell_it(asked):
    model, batch, vectors = asked
    away = vector_of(model, **{TERMS[0]: -5.0})
    found, calm = model.predictions([away, vectors[1]], batch)
    exact = model.predict(away, make_batch(runs(), strain_step=0.02))
    samples = np.sum(np.abs(found) < 1e6, axis=1), np.sum(np.abs(exact) < 1e6, axis=1)
    # within a step of the integration, some tenth of a sample's interval
    np.testing.assert_allclose(*samples, atol=1)
    assert 0 < samples[0][0] < len(runs()[0])
    np.testing.assert_allclose(calm, model.predictions(vectors[1:2], batch)[0], rtol=1e-12)


@dataclass(frozen=True)
class Iterated(ConstitutiveEffect):
    """An effect of a user's own that asks for what lanes do not know."""

    def extra_term(self, values, stress, rate):
        """Return c times σ, found by adding it up as long as less than two halves are there."""
        del rate

        def more(state):
            count, total = state
            return count + 1, total + 0.5 * stress

        start = 0, jnp.zeros_like(stress)
        return values[0] * jax.lax.while_loop(lambda state: state[0] < 2, more, start)[1]


def test_an_effect_that_lanes_do_not_know_is_predicted_all_the_same():
    amplitude = EffectParameter("c", "c", low=0.0, high=10.0, range_source="a test")
    effect = Iterated("iterated", (amplitude,), equation="c", source="a test", check="none")
    model = AugmentedModel(DeclaredModel.maxwell(50.0, 2.0), [effect])
    times = np.linspace(0.1, 6.0, 20)
    batch = make_batch([Run("a", times, start_up(0.5), np.full(20, 0.5), np.full(20, 10.0))])
    theta = vector_of(model, iterated=1.0)
    # with c = 1 the mode relaxes twice as fast
    exact = 50.0 * 0.5 * 1.0 * (1.0 - np.exp(-times / 1.0))
    # the error of the steps that a loop takes
    np.testing.assert_allclose(model.predict(theta, batch)[0], exact, rtol=1e-5)


def counted(monkeypatch):
    """Return lists to which kernels and programs that are made from here on are added."""
    kernels, loaded = [], code.callable_of
    monkeypatch.setattr(code, "callable_of", lambda *of: kernels.append(1) or loaded(*of))
    return kernels, compilations()


@pytest.mark.usefixtures("code_of_every_effect")
def test_another_set_of_effects_or_of_runs_compiles_nothing(monkeypatch):
    batch, declared = make_batch(runs()[:2]), DeclaredModel.maxwell([60.0, 20.0], [0.1, 2.0])

    def predicted(declared, *names, batch=batch):
        model = AugmentedModel(declared, [make_effect(name) for name in names])
        return model.predict(vector_of(model, *names), batch)

    predicted(declared, "giesekus_mobility", "rate_rise_time", "transducer_lag")
    kernels, programs = counted(monkeypatch)
    predicted(declared, "thixotropy", "stress_gain", "wall_slip", TERMS[0], "relaxation_mode")
    predicted(replace(declared, fit_modulus=True), "ptt_exponential")
    for others in (runs()[1:2], [*runs()[:2], *runs()[:2]]):
        predicted(declared, "thixotropy", batch=make_batch(others))
    assert (len(kernels), len(programs)) == (0, 0)
    # negative control: an effect of a user's own is none of those that stand in every kernel
    model = AugmentedModel(declared, [replace(make_effect("giesekus_mobility"), name="of_my_own")])
    model.predict(model.zero(), batch)
    assert len(kernels) == 1
    assert programs  # of JAX, one or with a small one that an earlier test may have made


def test_moved_moduli_move_the_prediction_as_the_closed_form_says():
    moduli, times = np.array([60.0, 20.0]), np.array([0.1, 2.0])
    model = AugmentedModel(DeclaredModel.maxwell(moduli, times, solvent_viscosity=1.0), [])
    batch, moves = make_batch(runs()[:1]), np.array([[3.0, 0.0, 0.0], [0.0, 2.0, 0.5]])
    signs = np.concatenate([moves, -moves])
    up_and_down = model.predictions([model.zero()] * 4, batch, model.moduli + signs)[:, 0]
    grown = 0.5 * times[:, None] * (1.0 - np.exp(-runs()[0].time / times[:, None]))
    found = 0.5 * (up_and_down[:2] - up_and_down[2:])
    for column, exact in zip(found, [3.0 * grown[0], 2.0 * grown[1] + 0.5 * 0.5], strict=True):
        # the error of the steps that a loop takes
        np.testing.assert_allclose(column, exact, rtol=1e-5)
