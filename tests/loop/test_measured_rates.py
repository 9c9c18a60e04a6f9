from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import in_sequence
from discover.dataset.records.thinning import thin_run
from discover.effects import Record, make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, make_batch
from discover.laws import Fluid, Giesekus
from discover.loop import DeclaredModel, run_loop, run_loop_on_each
from discover.protocols import measured_rate, start_up, strains
from discover.simulate import simulate

TIMES = np.linspace(0.05, 8.0, 80)
EFFECTS = ("giesekus_mobility", "rate_rise_time", "rate_gain", "stress_offset")
pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")


def start_ups(alpha, rates=(0.5, 1.0, 2.0), noise=0.01):
    fluid = Fluid(Giesekus(alpha), jnp.asarray(100.0), jnp.asarray(1.0))
    generator = np.random.default_rng(0)
    runs = []
    for rate in rates:
        stress = simulate(fluid, start_up(rate), TIMES).shear_stress
        stress = stress * (1.0 + noise * generator.standard_normal(len(TIMES)))
        runs.append(Run(f"{rate:g}", TIMES, start_up(rate), np.full(80, rate), stress))
    return Dataset("start-ups", tuple(runs))


@pytest.mark.parametrize("effect", ["stress_offset", "rate_rise_time", "thixotropy"])
def test_a_run_from_a_steady_flow_relaxes_to_the_next_one(effect):
    before, after = 2.0, 0.5
    run = Run("down", TIMES, start_up(after), np.full(80, after), np.ones(80), rate_before=before)
    # an effect at zero amplitude changes nothing, whatever the program it is compiled into
    model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [make_effect(effect)])
    predicted = model.predict(model.zero(), make_batch([run]))[0]
    exact = 100.0 * (after + (before - after) * np.exp(-TIMES))
    np.testing.assert_allclose(predicted, exact, rtol=1e-4)


def test_a_run_from_a_steady_flow_starts_at_the_steady_state_of_a_nonlinear_law():
    run = Run("on", TIMES, start_up(30.0), np.full(80, 30.0), np.ones(80), rate_before=30.0)
    declared = DeclaredModel.named("giesekus", {"alpha": 0.3}, 100.0, 1.0)
    model = AugmentedModel(declared, [make_effect("stress_offset")])
    predicted = model.predict(model.zero(), make_batch([run]))[0]
    fluid = Fluid(Giesekus(0.3), jnp.asarray(100.0), jnp.asarray(1.0))
    steady = simulate(fluid, start_up(30.0), np.array([40.0])).shear_stress[0]
    np.testing.assert_allclose(predicted, steady, rtol=1e-4)


def test_strain_is_counted_from_the_start_of_the_run_and_not_of_the_flow_before_it():
    times = jnp.array([-2.0, -1.0, 0.0, 1.0, 2.0])
    record = Record(times, jnp.array([9.0, 9.0, 1.0, 1.0, 1.0]), jnp.zeros(5), jnp.asarray(1.0))
    np.testing.assert_allclose(record.total_strain, [0.0, 0.0, 0.0, 1.0, 2.0])


def test_constants_of_the_declared_law_come_back_with_units_from_a_guess_far_off():
    declared = DeclaredModel.named(
        "giesekus", {"alpha": 0.1}, 2.0, 90.0, free=("modulus_Pa", "relaxation_time_s", "alpha")
    )
    result = run_loop(start_ups(0.3), declared, effects=EFFECTS, max_effects=0)
    assert result.verdict == "no_effect_needed"
    truth = {"modulus_Pa": (100.0, "Pa"), "relaxation_time_s": (1.0, "s"), "alpha": (0.3, "")}
    assert set(result.declared_parameters) == set(truth)
    for name, (value, unit) in truth.items():
        found = result.declared_parameters[name]
        assert found.unit == unit
        assert found.ci95[0] < found.value < found.ci95[1]
        assert found.value == pytest.approx(value, rel=0.05)
        assert found.ci95[0] < value * 1.02
        assert found.ci95[1] > value * 0.98


@pytest.mark.slow
def test_each_run_is_judged_by_a_search_that_did_not_see_it():
    dataset, declared = start_ups(0.3), DeclaredModel.maxwell(100.0, 1.0)
    options = {"effects": EFFECTS, "max_effects": 1, "explanations": 1}
    result = run_loop_on_each(dataset, declared, **options)
    assert [fold.run for fold in result.folds] == list(dataset.names)
    assert {fold.effects for fold in result.folds} == {("giesekus_mobility",)}
    alone = run_loop(dataset, declared, held_out=["2"], **options)
    assert result.folds[-1].error_after == alone.error_after.held_out
    mean = np.mean([fold.error_after for fold in result.folds])
    assert result.error_after.held_out == pytest.approx(mean)
    assert result.error_after.held_out < 0.03 < 0.1 < result.error_before.held_out
    # a wrong record spoils its own judgement, and what is found without it stays
    wrong = replace(dataset["2"], stress=3.0 * dataset["2"].stress)
    spoilt = run_loop_on_each(Dataset("x", (*dataset.runs[:2], wrong)), declared, **options)
    assert spoilt.folds[-1].effects == result.folds[-1].effects
    assert spoilt.folds[-1].error_after > 10 * result.folds[-1].error_after


def test_one_run_cannot_be_held_out_of_itself():
    dataset = start_ups(0.3, rates=(1.0,))
    with pytest.raises(InputError, match="at least 2 are needed; got 1"):
        run_loop_on_each(dataset, DeclaredModel.maxwell(100.0, 1.0))


def test_as_many_constants_as_samples_are_refused():
    run = start_ups(0.3, rates=(1.0,)).runs[0].window(np.arange(80) < 6)
    declared = DeclaredModel.named("ucm", {}, 1.0, 1.0, free=("modulus_Pa", "relaxation_time_s"))
    with pytest.raises(InputError, match="6 samples in all, for 2 constants"):
        run_loop(Dataset("short", (run,)), declared, effects=EFFECTS)


def test_what_was_lost_in_earlier_runs_stays_lost():
    runs = start_ups(0.0, rates=(1.0, 2.0), noise=0.0).runs
    model = AugmentedModel(DeclaredModel.maxwell(100.0, 1.0), [make_effect("edge_fracture")])
    theta = model.zero()
    theta[model.positions("edge_fracture")] = [0.05, 0.0]
    fresh = model.predict(theta, make_batch([runs[1]]))[0]
    later = in_sequence(runs, np.array([1.0, 2.0]))[1]
    # the first run strained the sample by 8
    used = model.predict(theta, make_batch([later]))[0]
    np.testing.assert_allclose(used, np.exp(-0.05 * 8.0) * fresh, rtol=1e-9)


@pytest.mark.parametrize("samples", [400, 100])
def test_thinned_runs_hold_the_same_flow(samples):
    times = np.linspace(0.01, 20.0, 2000)
    rates = np.cos(times)
    run = Run("wave", times, measured_rate(times, rates), rates, np.sin(times))
    thinned = thin_run(run, samples)
    assert len(thinned) == samples
    assert thinned.time[-1] == times[-1]
    strain = strains(thinned.protocol, np.array([5.0, 20.0]))
    np.testing.assert_allclose(strain, np.sin([5.0, 20.0]), atol=2e-3)
