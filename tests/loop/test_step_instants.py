"""A rate that steps between two samples: its instant is fitted along. Truth by scipy alone."""

from dataclasses import replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from independent import Giesekus
from independent.flow import start_up
from independent.flow import steps as stepped
from independent.folders import write_folder
from independent.instruments import Instrument

import discover as dc
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.rate_steps import RateSteps
from discover.loop.measured_rates import with_places, with_rate_steps
from discover.report.loop import loop_verdict

MODULUS, TIME, MOBILITY, NOISE = 100.0, 1.0, 0.3, 0.01
INSTANTS = {"up.csv": 4.01, "down.csv": 3.99, "stop.csv": 4.02, "judge.csv": 3.02}
FLOWS = {
    "up.csv": (stepped([0.0, 4.01], [1.0, 3.0]), 8.0),
    "down.csv": (stepped([0.0, 3.99], [3.0, 0.5]), 8.0),
    "stop.csv": (stepped([0.0, 4.02], [2.0, 0.0]), 7.0),
    "judge.csv": (stepped([0.0, 3.02], [5.0, 1.0]), 6.0),
}
EFFECTS = ["giesekus_mobility", "ptt_linear", "rate_rise_time"]
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


def loop_on(folder, flows):
    """Return the loop on records of a Giesekus fluid, of 1 % noise."""
    generator, runs = np.random.default_rng(0), {}
    for name, (flow, end) in flows.items():
        run = Instrument().record(
            Giesekus(MOBILITY, MODULUS, TIME), flow, np.linspace(0.02, end, 120)
        )
        size = NOISE * np.sqrt(np.mean(run.stress**2))
        runs[name] = replace(run, stress=run.stress + size * generator.standard_normal(120))
    data = dc.load_dataset(write_folder(folder, runs))
    return dc.close_loop(
        data, BASE, held_out=["judge.csv"], effects=EFFECTS, max_effects=1, explanations=1
    )


@pytest.fixture(scope="module")
def loop(tmp_path_factory):
    return loop_on(tmp_path_factory.mktemp("data") / "steps", FLOWS)


@pytest.mark.slow
def test_the_law_is_found_behind_steps_that_the_samples_do_not_date(loop):
    # with straight lines between the samples the verdict is "unexplained"
    assert loop.verdict == "effects_added"
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low <= MOBILITY <= high
    assert loop.error_after.fit == pytest.approx(NOISE, rel=0.2)
    assert loop.error_after.held_out == pytest.approx(NOISE, rel=0.3)


@pytest.mark.slow
def test_instants_are_told_with_intervals_that_hold_them(loop):
    found = loop.remaining["step_instants"]
    assert set(found) == set(INSTANTS)
    for name, (one,) in found.items():
        before, after = one["between_s"]
        assert before < INSTANTS[name] < after
        if name == "judge.csv":
            assert one["ci95"] is None
            # noise of 1 % on a slope that changes by GΔγ̇: some ten such samples tell it to this
            assert one["instant_s"] == pytest.approx(INSTANTS[name], abs=0.005)
        else:
            low, high = one["ci95"]
            assert low <= INSTANTS[name] <= high
            assert high - low < 0.5 * (after - before)


@pytest.mark.slow
def test_the_verdict_says_that_instants_were_fitted(loop):
    said = " ".join(loop_verdict(loop))
    assert "steps between two samples" in said
    assert "those of a held-out run to that run" in said


@pytest.mark.slow
def test_nothing_is_said_of_steps_where_the_rate_has_none(tmp_path):
    flows = {name: (start_up(1.0 + i), 5.0) for i, name in enumerate(FLOWS)}
    loop = loop_on(tmp_path, flows)
    assert loop.remaining["step_instants"] == {}
    assert "steps between" not in " ".join(loop_verdict(loop))


stepped_rate = jax.jit(RateSteps.in_rate)


class TestRateSteps:
    """The rate in one run."""

    times = np.linspace(0.0, 1.0, 21)  # ten steps of the integration, with their middles

    def in_rate(self, share, start=0.2, end=0.6):
        steps = RateSteps(
            *(jnp.array([value]) for value in (start, end, 2.0, share)), jnp.array([-1])
        )
        straight = 1.0 + 2.0 * np.clip((self.times - start) / (end - start), 0.0, 1.0)
        times = jnp.asarray(self.times)
        return np.asarray(stepped_rate(steps, jnp.asarray(straight), times, jnp.zeros(0)))

    @pytest.mark.parametrize("share", [0.0, 0.13, 0.25, 0.5, 0.8, 1.0])
    def test_has_the_strain_of_the_step_by_simpson_s_rule(self, share):
        rate = self.in_rate(share)
        strain = np.sum((rate[:-2:2] + 4.0 * rate[1::2] + rate[2::2]) * 0.1 / 6.0)
        assert strain == pytest.approx(1.0 + 2.0 * (1.0 - (0.2 + 0.4 * share)), rel=1e-12)

    def test_is_as_recorded_beyond_the_two_samples(self):
        rate = self.in_rate(0.3)
        np.testing.assert_array_equal(rate[self.times < 0.21], 1.0)
        np.testing.assert_array_equal(rate[self.times > 0.59], 3.0)

    def test_changes_smoothly_with_the_instant(self):
        shares = np.linspace(0.0, 1.0, 101)
        rates = np.stack([self.in_rate(share) for share in shares])
        # at most six changes of the rate for the whole interval, which is four steps long
        assert np.max(np.abs(np.diff(rates, axis=0))) < 2.0 * 4 * 1.5 / 100 * 1.01


def maxwell_after_a_step(times, instant):
    """Return σ12 of a Maxwell fluid, 1 then 3 1/s from an instant on, in closed form."""
    late = np.maximum(times - instant, 0.0)
    return 100.0 * (1.0 - np.exp(-times) + 2.0 * (1.0 - np.exp(-late)))


def test_what_else_a_run_recorded_shares_its_instants():
    times = np.linspace(0.1, 8.0, 80)
    rate = np.where(times < 3.95, 1.0, 3.0)
    stress = maxwell_after_a_step(times, 3.97)
    run = with_rate_steps(
        dc.Run(
            "a.csv", times, dc.measured_rate(times, rate), rate, stress,
            first_normal_stress_difference=stress,
        )
    )  # fmt: skip
    other = replace(run, name="b.csv")
    declared, fitted, held = with_places(
        DeclaredModel.maxwell(100.0, 1.0), [run, other], [run.observing("N1")]
    )
    assert declared.step_instants == 2
    assert [one.rate_steps[0].place for one in (*fitted, *held)] == [0, 1, 0]


def test_a_fitted_instant_takes_the_place_of_the_run_s_own():
    times = np.linspace(0.1, 8.0, 80)
    rate = np.where(times < 3.95, 1.0, 3.0)
    run = dc.Run("a.csv", times, dc.measured_rate(times, rate), rate, rate)
    declared, (run,), _ = with_places(DeclaredModel.maxwell(100.0, 1.0), [with_rate_steps(run)], [])
    model, batch = AugmentedModel(declared, []), make_batch([run])
    theta = model.zero()
    assert model.free_positions == [model.size - 1]
    theta[model.instants] = 0.7
    moved = eqx.tree_at(lambda b: b.parts[0].steps.share, batch, jnp.array([[0.2]]))
    assert model.predict(theta, batch)[0] == pytest.approx(
        maxwell_after_a_step(times, 3.97), abs=0.02
    )
    np.testing.assert_array_equal(model.predict(theta, moved), model.predict(theta, batch))
