"""What arithmetic leaves is no missing effect, and no more than that is put down to it."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus
from independent import start_up as strain_rate

from discover.loop import DeclaredModel, run_loop
from discover.closed_loop.judging.numerical_resolution import (
    COMPUTED,
    NumericalResolution,
    rounding,
)
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.dataset import Dataset, Run
from discover.errors import InputError
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.forward import DeclaredModel as ForwardDeclared
from discover.inference.problem import FitProblem
from discover.protocols import measured_rate, oscillatory_shear, start_up
from discover.statistics.residual import STRUCTURE, Expectation

TIMES = np.linspace(0.1, 10.0, 100)
WAVE = 1.5 * np.cos(0.8 * TIMES)


def rounded(values, digits):
    return np.array([float(f"{value:.{digits}g}") for value in values])


@pytest.mark.parametrize("scale", [1.0, 1e-6, 1e6])
def test_rounding_is_half_a_unit_in_the_last_place(scale):
    values = scale * (100.0 + 800.0 * np.sin(TIMES) ** 2)
    # three digits between 100 and 900 are whole numbers
    assert rounding(rounded(values, 3)) == pytest.approx(0.5 * scale)
    assert rounding(values) == 0.0


def test_decimals_round_small_numbers_as_much_as_large_ones():
    values = np.round(0.01 + 30.0 * np.exp(-TIMES), 2)
    assert rounding(values) == pytest.approx(0.005)


def test_a_few_numbers_do_not_tell_how_they_were_rounded():
    assert rounding(np.array([10.0, 20.0, 20.0, 0.0, 30.0, 10.0])) == 0.0


def maxwell_runs(offset=0.0, digits=17, stress=1.0, time=1.0):
    """Two start-ups and a wave of a Maxwell fluid, analytic, as from files of so many digits.

    The rate of the wave is known at the samples only.
    """

    def run(name, flow, rate, values):
        kept = rounded(stress * (values + offset), digits)
        return Run(name, time * TIMES, flow, rate / time, kept)

    steady = 100.0 * -np.expm1(-TIMES)
    # σ' + σ = 100 γ̇ from rest
    late = 1.5 * (np.cos(0.8 * TIMES) + 0.8 * np.sin(0.8 * TIMES) - np.exp(-TIMES)) / (1 + 0.8**2)
    ones = np.ones(100)
    return [
        run("start", start_up(0.5 / time), 0.5 * ones, 0.5 * steady),
        run("wave", measured_rate(time * TIMES, WAVE / time), WAVE, 100.0 * late),
        run("held", start_up(0.7 / time), 0.7 * ones, 0.7 * steady),
    ]


def declared(stress=1.0, time=1.0):
    return DeclaredModel.maxwell(100.0 * stress, time)


def loop(runs, *units):
    # one list of candidates, so that all loops here share a program
    return run_loop(
        Dataset("exact", tuple(runs)), declared(*units), held_out=["held"],
        effects=["stress_offset", "stress_gain"], max_effects=2,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("digits", [17, 6, 3])
def test_exact_data_of_the_declared_law_lack_nothing(digits):
    result = loop(maxwell_runs(digits=digits))
    assert result.verdict == "no_effect_needed"
    assert result.stages == ()


@pytest.mark.slow
@pytest.mark.parametrize("digits", [17, 4])
def test_the_one_effect_that_exact_data_have_is_found_and_explains_them(digits):
    result = loop(maxwell_runs(3.0, digits))
    assert [stage.effect for stage in result.stages] == ["stress_offset"]
    assert result.verdict == "effects_added"
    assert result.stages[0].parameters["offset"].value == pytest.approx(3.0, rel=3e-3)


@pytest.mark.slow
def test_a_small_effect_that_no_candidate_is_stays_unexplained_in_exact_data():
    # a slow wave of 0.1 % of the stress, ten times what the samples of the rate leave
    runs = maxwell_runs()
    flaw = 0.04 * np.sin(2.0 * TIMES)
    bent = [Run(r.name, r.time, r.protocol, r.rate, r.stress + flaw) for r in runs]
    result = loop(bent)
    assert result.error_after.fit < 2e-3
    assert result.verdict == "unexplained"


@pytest.mark.slow
@pytest.mark.parametrize(("stress", "time"), [(1e-6, 1.0), (1e6, 1e-3), (1.0, 1e3)])
def test_units_decide_nothing(stress, time):
    result = loop(maxwell_runs(3.0, 17, stress, time), stress, time)
    assert result.verdict == "effects_added"
    assert [stage.effect for stage in result.stages] == ["stress_offset"]
    assert result.stages[0].parameters["offset"].value == pytest.approx(3.0 * stress, rel=3e-3)


def test_a_copy_of_a_fitted_run_is_not_held_out():
    runs = maxwell_runs()
    with pytest.raises(InputError, match="same samples as the fitted run 'wave'"):
        loop([*runs[:2], replace(runs[1], name="held")])


@pytest.mark.slow
def test_every_candidate_may_be_in_the_model():
    runs = [Run(r.name, r.time, r.protocol, r.rate, 1.2 * r.stress + 3.0) for r in maxwell_runs()]
    result = loop(runs)
    assert {stage.effect for stage in result.stages} == {"stress_offset", "stress_gain"}
    assert result.verdict == "effects_added"


def test_a_misfit_is_put_down_to_arithmetic_only_where_that_leaves_as_much():
    model = AugmentedModel(declared(), [])
    sampled = maxwell_runs()[1:2]
    smooth = [replace(sampled[0], protocol=oscillatory_shear(1.5, 0.8))]
    limits = [
        NumericalResolution(model, make_batch(runs), runs).limit(model.zero(), (), 1e-4)
        for runs in (smooth, sampled)
    ]
    assert limits[0] < 2.0 * COMPUTED
    # straight lines between samples 0.08 rad apart miss the rate by φ²/12
    assert 0.02 * 0.08**2 / 12 < limits[1] < 0.08**2 / 12
    far = NumericalResolution(model, make_batch(sampled), sampled).limit(model.zero(), (), 0.1)
    assert far == pytest.approx(COMPUTED)


def test_steps_of_a_converter_round_as_digits_do():
    values = 2.7 * np.round(100.0 * np.sin(TIMES) ** 2 / 2.7)
    assert rounding(values) == pytest.approx(1.35)
    noise = np.random.default_rng(0).standard_normal(100)
    assert rounding(values + 1e-3 * noise) == 0.0
    assert rounding(np.repeat(noise[:20], 5)) == 0.0


def test_a_law_that_is_a_little_wrong_is_not_hidden_by_steps_of_a_converter():
    runs, step = [], {}
    for rate in (0.5, 2.0):
        stress = Giesekus(0.3, modulus=100.0, relaxation_time=1.0)
        stress = stress.respond(strain_rate(rate), TIMES).sigma12
        step[rate] = 0.04 * np.max(stress)
        read = step[rate] * np.round(stress / step[rate])
        runs.append(Run(f"at_{rate:g}", TIMES, start_up(rate), np.full(100, rate), read))
    hidden = {}
    for mobility in (0.3, 0.29, 0.28, 0.27):
        modes = np.array([100.0]), np.array([1.0])
        law = ForwardDeclared.named("giesekus", {"alpha": mobility}, *modes)
        model = AugmentedModel(law, [], data_scales(runs))
        problem = FitProblem(model, make_batch(runs))
        fit = problem.at(model.zero(), ())
        resolution = NumericalResolution(model, problem.batch, runs)
        error = resolution.mean(fit.run_errors)
        # by its size alone, what is left would be the steps'
        assert error <= STRUCTURE * resolution.limit(fit.theta, (), error)
        hidden[mobility] = ToleratedMisfit(Expectation(), resolution).unresolved(fit, ())
    assert hidden == {0.3: True, 0.29: False, 0.28: False, 0.27: False}
