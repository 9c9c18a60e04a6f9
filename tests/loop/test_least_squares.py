"""Fits of many small problems: what they cost, what is left out of them, where they start again."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from discover.forward import DeclaredModel
from discover.closed_loop.judging.finer_steps import on_finer_steps
from discover.closed_loop.search.scoring.attribution import attribute
from discover.closed_loop.search.scoring.left_out import FEWEST_FOLDS, left_out_errors
from discover.closed_loop.search.scoring.refitting import simplest
from discover.dataset import Run
from discover.effects import make_effect
from discover.effects.base import EffectParameter, SignalEffect
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.inference.least_squares import fit_batch
from discover.inference.problem import FitProblem
from discover.laws import Fluid, Giesekus
from discover.programs.lanes import LANES
from discover.protocols import oscillatory_shear, shear_rates, start_up
from discover.simulate import simulate

TIMES = np.linspace(0.1, 8.0, 60)
FLOWS = [start_up(0.5), start_up(1.0), start_up(2.0), oscillatory_shear(1.5, 1.0)]
FLUID = Fluid(Giesekus(0.3), jnp.asarray(100.0), jnp.asarray(1.0))


def runs(count, noise=0.0, seed=0):
    generator = np.random.default_rng(seed)
    made = []
    for i, flow in enumerate(FLOWS[:count]):
        stress = np.asarray(simulate(FLUID, flow, TIMES).shear_stress)
        size = noise * np.sqrt(np.mean(stress**2))
        rate = shear_rates(flow, TIMES)
        noisy = stress + size * generator.standard_normal(len(TIMES))
        made.append(Run(f"run {i}", TIMES, flow, rate, noisy))
    return made


def fitted(model, batch, *names):
    at = [p for name in names for p in model.positions(name)]
    start = model.zero()
    start[at] = 0.05
    free = [*model.declared.free_positions, *at]
    return fit_batch(model, batch, [start], [free])[0]


def test_a_fit_asks_for_few_predictions(monkeypatch):
    model = AugmentedModel(
        DeclaredModel.maxwell(60.0, 2.0, fit_modulus=True, fit_relaxation_time=True),
        [make_effect("giesekus_mobility")],
    )
    batch = make_batch(runs(4))
    asked, residuals = [], AugmentedModel.residuals
    monkeypatch.setattr(
        AugmentedModel,
        "residuals",
        lambda self, thetas, *given: asked.append(len(thetas)) or residuals(self, thetas, *given),
    )
    fit = fitted(model, batch, "giesekus_mobility")
    value = fit.theta[model.positions("giesekus_mobility")[0]]
    assert value == pytest.approx(0.3, abs=1e-3)
    # derivatives come with every step, and no call needs more than stand side by side
    assert max(asked) <= LANES
    assert len(asked) <= 12


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_errors_left_out_are_near_the_noise_whatever_the_number_of_runs(count):
    model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [make_effect("giesekus_mobility")])
    batch = make_batch(runs(count, noise=0.01))
    fit = fitted(model, batch, "giesekus_mobility")
    errors = left_out_errors(FitProblem(model, batch), fit)
    assert errors.shape == (count,)
    assert np.all(errors >= fit.run_errors)
    # one parameter and dozens of samples: leaving some out changes little
    np.testing.assert_allclose(errors, 0.01, rtol=0.4)


def test_of_few_runs_parts_are_left_out_so_that_nothing_must_be_extrapolated():
    model = AugmentedModel(
        DeclaredModel.maxwell(100.0, 1.0, fit_modulus=True, fit_relaxation_time=True),
        [make_effect("giesekus_mobility")],
    )
    few, many = (make_batch(runs(count, noise=0.01)) for count in (2, FEWEST_FOLDS))
    from_few = left_out_errors(FitProblem(model, few), fitted(model, few, "giesekus_mobility"))
    from_many = left_out_errors(FitProblem(model, many), fitted(model, many, "giesekus_mobility"))
    # two slow start-ups, one left out, would leave the mobility to one of them
    assert np.mean(from_few) < 1.5 * np.mean(from_many)


def test_a_trial_lets_a_fitted_constant_give_way_that_stood_in_for_the_effect():
    # the modulus has taken over what it could: with it held, mobility lowers the stress twice
    model = AugmentedModel(
        DeclaredModel.maxwell(100.0, 1.0, fit_modulus=True), [make_effect("giesekus_mobility")]
    )
    batch = make_batch(runs(4))
    fit = fit_batch(model, batch, [model.zero()], [model.declared.free_positions])[0]
    (candidate,) = attribute(model, batch, fit, [], leaders=1).leading
    held = []
    for amplitude in np.linspace(0.0, 1.0, 101):
        theta = fit.theta.copy()
        theta[model.positions("giesekus_mobility")] = amplitude
        held.append(1.0 - float(np.sum(model.residuals([theta], batch) ** 2)) / fit.cost)
    assert candidate.start[0] > fit.theta[0]
    assert candidate.reduction > 1.5 * max(held)


@pytest.mark.slow
def test_finer_steps_take_the_bias_out_of_a_compliance():
    model = AugmentedModel(
        DeclaredModel.maxwell(100.0, 1.0), [make_effect("tool_compliance")], data_scales(runs(4))
    )
    at = model.positions("tool_compliance")
    planted = model.zero()
    planted[at] = 2e-3
    exact = model.predict(planted, make_batch(runs(4), strain_step=0.01))
    made = [
        Run(run.name, run.time, run.protocol, run.rate, row)
        for run, row in zip(runs(4), exact, strict=True)
    ]
    batch = make_batch(made)
    start = model.zero()
    start[at] = 1e-3
    fit = fit_batch(model, batch, [start], [at], tolerance=1e-8)[0]
    moved = on_finer_steps(model, batch, made, fit, ["tool_compliance"])
    before, after = (abs(f.theta[at[0]] / 2e-3 - 1.0) for f in (fit, moved))
    # steps a fifth as long, second order: at most a tenth is left
    assert before > 1e-3
    assert after < 0.1 * before


def test_finer_steps_leave_other_effects_alone():
    model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [make_effect("giesekus_mobility")])
    batch = make_batch(runs(2))
    fit = fitted(model, batch, "giesekus_mobility")
    assert on_finer_steps(model, batch, runs(2), fit, ["giesekus_mobility"]) is fit


class Runaway(SignalEffect):
    """A trial of it is a number, and its square is none."""

    def recorded_stress(self, values, record):
        return record.stress + 1e200 * values[0]


def test_a_trial_that_runs_away_scores_nothing_and_spoils_no_other():
    def ranked(*effects):
        model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0, fit_modulus=True), effects)
        batch = make_batch(runs(2))
        fit = fit_batch(model, batch, [model.zero()], [model.declared.free_positions])[0]
        return {c.effect: c.reduction for c in attribute(model, batch, fit, [], leaders=9).leading}

    amplitude = EffectParameter("size", "s", range_source="a test")
    runaway = Runaway("runaway", (amplitude,), "", "", "")
    alone, beside = (
        ranked(make_effect("giesekus_mobility")),
        ranked(make_effect("giesekus_mobility"), runaway),
    )
    assert alone["giesekus_mobility"] > 0.1
    assert beside == {**alone, "runaway": 0.0}


def test_of_effects_that_meet_the_records_exactly_the_simplest_is_taken(as_users_run_it):
    """Their evidence is infinite, and none is farther from the strongest than another."""

    def choice(name, evidence):
        return SimpleNamespace(candidate=SimpleNamespace(effect=name, evidence=evidence))

    effects = [SimpleNamespace(name="a", complexity=2), SimpleNamespace(name="b", complexity=1)]
    exact = [choice("a", float("inf")), choice("b", float("inf"))]
    model = SimpleNamespace(effects=effects)
    assert simplest(exact, model).candidate.effect == "b"  # pyright: ignore
    weaker = [choice("a", float("inf")), choice("b", 50.0)]
    assert simplest(weaker, model).candidate.effect == "a"  # pyright: ignore
