"""Records without a signal, of one flow, or of an oil behind a motor: what they do not tell."""

import re
from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, UpperConvectedMaxwell, of_rate
from independent.noise import white
from noisy_runs import run_at, start_ups
from scipy.optimize import brentq

import discover as dc
from discover.dataset.records.repeats import count_flows
from discover.identify.twins import oil_twin
from discover.loop import DeclaredModel, run_loop
from discover.protocols import after_step_strain, oscillatory_shear, start_up
from discover.protocols.control import steady_rates
from discover.report.loop import loop_verdict

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
TIMES = np.linspace(0.1, 10.0, 100)
FLOWS = {"slow": start_up(0.4), "fast": start_up(1.5), "wave": oscillatory_shear(1.5, 0.8)}
RATES = {"slow": np.full(100, 0.4), "fast": np.full(100, 1.5), "wave": 1.5 * np.cos(0.8 * TIMES)}
DECLARED = DeclaredModel.maxwell(100.0, 1.0)
TO_FIT = replace(DECLARED, fit_modulus=True, fit_relaxation_time=True)


def maxwell(rate):
    """Return σ' + σ = 100 γ̇ from rest, by scipy."""
    flow = of_rate(lambda t: np.interp(t, TIMES, rate), TIMES[-1])
    return UpperConvectedMaxwell(100.0).respond(flow, TIMES).sigma12


def loop(stress, declared=DECLARED, effects=("stress_offset", "stress_gain"), **options):
    runs = [dc.Run(n, TIMES, FLOWS[n], RATES[n], np.asarray(stress[n])) for n in FLOWS]
    options = {"effects": list(effects), "max_effects": 2, "explanations": 1} | options
    return run_loop(dc.Dataset("made", tuple(runs)), declared, **options)


def drawn(signal, noise, seed=0):
    generator = np.random.default_rng(seed)
    return {n: signal(RATES[n]) + noise * generator.standard_normal(100) for n in FLOWS}


# constants that are fitted can follow more: they are the harder case
BOTH = pytest.mark.parametrize(
    "declared",
    [pytest.param(DECLARED, marks=pytest.mark.slow, id="known"), pytest.param(TO_FIT, id="to_fit")],
)


@BOTH
@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2, 3, 4))]
)
def test_pure_noise_is_no_signal(seed, declared):
    result = loop(drawn(lambda rate: 0.0 * rate, 5.0, seed), declared)
    assert (result.verdict, result.stages) == ("no_signal", ())
    assert result.to_json()["verdict"] == "no_signal"
    # all of it is noise: the median of 100 differences, in three runs, to some 6 % each
    assert result.noise_floor == pytest.approx(1.0, rel=0.2)
    sentences = loop_verdict(result)
    assert sentences[0].startswith("No signal")
    assert "explains" not in sentences[0]
    assert "sensor is connected" in result.answer.next_test
    form = r"only noise of (.*)–(.*) Pa rms; the sample's mean stress is below (.*) Pa \(95 %\), so"
    said = re.search(form, result.answer.headline)
    assert said
    *noise, most = map(float, said.groups())
    # that of each run, which median differences of 100 samples tell to some 10 %
    assert noise == pytest.approx([5.0, 5.0], rel=0.35)
    # the mean of a run is known to 5/√100 Pa: a bound of 1.6 of these above it, at most three off
    assert 1.645 * 0.8 * 0.5 < most < (1.645 * 1.2 + 3.0) * 0.5
    # the table of the page has the same numbers
    table = [f(r.scatter for r in result.records) for f in (min, max)]
    assert noise == pytest.approx(table, rel=0.05)


@pytest.mark.parametrize(
    ("shown", "other", "declared"),
    [
        pytest.param(lambda rate: 42.0, "stress_gain", DECLARED, marks=pytest.mark.slow),
        pytest.param(lambda rate: 42.0, "stress_gain", TO_FIT),
        pytest.param(lambda rate: 3.0 * TIMES, "stress_drift", TO_FIT),
    ],
    ids=["a dead sensor", "a dead sensor, constants to fit", "a drift without a fluid"],
)
def test_what_does_not_change_with_the_rate_is_no_signal(shown, other, declared):
    result = loop(drawn(shown, 0.5), declared, ("stress_offset", other))
    assert (result.verdict, result.stages) == ("no_signal", ())
    assert "alone explain the data as well" in result.remaining["description"]


@pytest.mark.slow
def test_a_good_record_with_an_offset_is_a_signal():
    result = loop(drawn(lambda rate: maxwell(rate) + 200.0, 2.0))
    assert result.verdict == "effects_added"
    assert [stage.effect for stage in result.stages] == ["stress_offset"]


def test_a_weak_signal_is_a_signal():
    result = loop(drawn(maxwell, 25.0))
    assert result.verdict == "no_effect_needed"
    assert 0.2 < result.error_after.fit < 0.9


def test_outliers_are_left_out_and_said():
    stress = drawn(maxwell, 1.0)
    clean = loop(stress)
    off = np.arange(7, 97, 17)
    thrown = {n: values + 40.0 * np.isin(np.arange(100), off) for n, values in stress.items()}
    result = loop(thrown)
    assert (clean.remaining["outliers"], result.remaining["outliers"]) == (0, 3 * len(off))
    assert result.remaining["outlier_times_s"]["slow"] == pytest.approx(TIMES[off])
    assert result.verdict == clean.verdict == "no_effect_needed"
    assert result.noise_floor == pytest.approx(clean.noise_floor, rel=0.2)
    assert f"{3 * len(off)} outliers were excluded" in loop_verdict(result)[1]


# a name that as few flows as constants tell
def looped(*runs: dc.Run):
    base = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)
    effects = ["giesekus_mobility", "ptt_linear"]
    return dc.close_loop(dc.Dataset("giesekus", runs), base, effects=effects, max_effects=1)


def sheared(rate, seed=0):
    times, name = np.linspace(0.1, 6.0, 40), f"{rate:g}, {seed}"
    return start_ups(Giesekus(0.3, 100.0), (rate,), times, seed=seed, names=[name])[0]


@pytest.mark.parametrize("repeated", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_name_that_one_flow_alone_tells_is_fitted_and_not_tested(repeated):
    loop = looped(sheared(2.0), *([sheared(2.0, 1)] if repeated else []))
    assert loop.verdict == "effects_added"
    found, sure = loop_verdict(loop)
    assert found.startswith("Fitted, not tested")
    assert "there are as few flows as fitted constants" in sure
    assert "fitted to the noise" not in found
    assert loop.answer.next_test


def test_a_name_that_two_flows_tell_is_believed_and_nothing_fitted_is_tested_by_any():
    loop = looped(sheared(0.7), sheared(2.0, 1))
    assert loop.verdict == "effects_added"
    assert loop.explanations.inclusion["giesekus_mobility"] > 0.5
    assert not loop.remaining["untested"]
    assert "Fitted, not tested" not in loop_verdict(loop)[0]
    times = np.linspace(0.1, 6.0, 40)
    noise = 1 + np.random.default_rng(0).normal(0, 0.01, 40)
    loop = looped(run_at(2.0, times, 200.0 * (1.0 - np.exp(-times)) * noise))
    assert loop.verdict == "no_effect_needed"
    assert loop.explanations.unexplained_probability < 0.5


def test_the_points_of_a_flow_curve_are_flows_of_their_own():
    for runs, flows in (((1.0,), 1), ((1.0, 1.0), 1), ((1.0, 2.0), 2)):
        assert count_flows([sheared(rate, seed) for seed, rate in enumerate(runs)]) == flows
    rates = np.geomspace(0.1, 10.0, 12)
    curve = dc.Run("curve", np.arange(12.0), steady_rates(rates), rates, 100.0 * rates)
    assert count_flows([curve]) == 12


# start-ups of an oil behind a slow motor, which record what a Maxwell mode does
VISCOSITY, RISE = 10.0, 0.3
SHORT = np.linspace(0.02, 3.0, 60)


def of_oil(rates, measured=False):
    """Return σ = η γ̇ₘ, γ̇ₘ = γ̇ (1 − exp(−t/t_m)), in closed form, with 1 % noise."""
    for seed, rate in enumerate(rates):
        behind = rate * -np.expm1(-SHORT / RISE)
        stress = white(VISCOSITY * behind, 0.01, np.random.default_rng(seed))
        run = run_at(rate, SHORT, stress)
        flow = dc.measured_rate(SHORT, behind)
        yield replace(run, protocol=flow, rate=behind, rate_is_measured=True) if measured else run


def loop_of_oil(*declared, rates=(1.0, 3.0, 10.0), measured=False):
    data = dc.Dataset("oil", tuple(of_oil(rates, measured)))
    few = ["giesekus_mobility", "stress_offset"]
    return dc.close_loop(data, *declared, effects=few, max_effects=1)


def test_an_oil_behind_a_slow_motor_is_told_beside_the_fitted_mode_that_records_the_same():
    commanded = loop_of_oil()
    # 180 samples of 1 % noise tell each constant to a per cent; 1 Pa and 1 s are far off
    found = commanded.declared_parameters
    assert found["modulus_Pa"].value == pytest.approx(VISCOSITY / RISE, rel=0.03)
    assert found["relaxation_time_s"].value == pytest.approx(RISE, rel=0.03)
    twin = commanded.remaining["oil_twin"]
    assert twin["viscosity"] == pytest.approx(VISCOSITY, rel=0.02)
    assert twin["rise_time"] == pytest.approx(RISE, rel=0.03)
    assert twin["inertia"] == 0.0
    assert "An oil of 10" in commanded.answer.alternative
    assert "motor's angle" in commanded.answer.next_test
    # nor is a normal stress claimed, of which an oil has none
    assert "no nonlinear law determined" in commanded.answer.title


def test_no_such_oil_is_told_where_the_rate_was_measured_or_a_relaxation_time_is_known():
    # control: the same records beside the rate that made them are those of an oil
    found = loop_of_oil(measured=True)
    assert not found.remaining.get("oil_twin")
    assert found.material.law == "newtonian"
    base = dc.Fluid(dc.make_law("ucm"), VISCOSITY / RISE, RISE)
    assert loop_of_oil(base, rates=(1.0, 10.0)).remaining["oil_twin"] is None


def test_an_inertia_behind_the_motor_is_a_solvent_beside_the_mode():
    # σ = η γ̇ₘ + I dγ̇ₘ/dt integrated by itself, and a Maxwell mode with a solvent in closed form
    viscosity, rise, inertia, rate = 8.0, 0.2, 0.5, 3.0
    behind, change = rate * -np.expm1(-SHORT / rise), rate / rise * np.exp(-SHORT / rise)
    solvent = inertia / rise
    mode = (viscosity - solvent) * rate * -np.expm1(-SHORT / rise) + solvent * rate
    np.testing.assert_allclose(mode, viscosity * behind + inertia * change, rtol=1e-12)
    step = after_step_strain(start_up(0.0), 1.0, first=0.1)
    relaxed = dc.Run("step", np.ones(1), step, np.zeros(1), np.ones(1))
    assert oil_twin(1.0, 1.0, 0.0, [relaxed]) is None  # the strain was on when the record began
    found = oil_twin((viscosity - solvent) / rise, rise, solvent, list(of_oil((1.0,))))
    exact = {"viscosity": viscosity, "rise_time": rise, "inertia": inertia}
    assert found == {name: pytest.approx(value, rel=1e-12) for name, value in exact.items()}


def in_flow_curve(law, declared, effects=("giesekus_mobility", "wall_slip", "ptt_linear")):
    """Return what a loop finds in a flow curve with 1 % noise."""
    rates = np.geomspace(0.05, 50.0, 25)
    drawn = 1.0 + 0.01 * np.random.default_rng(5).standard_normal(25)
    curve = np.array([law(rate) for rate in rates]) * drawn
    run = dc.Run("flow_curve.csv", np.arange(1.0, 26.0), steady_rates(rates), rates, curve)
    return run_loop(dc.Dataset("made", (run,)), declared, effects=list(effects), max_effects=2)


@pytest.mark.parametrize("alpha", [0.3, pytest.param(0.5, marks=pytest.mark.slow)])
def test_a_giesekus_flow_curve_slips_at_no_wall_where_modulus_and_time_are_fitted(alpha):
    declared = replace(TO_FIT, modulus=np.array([3.6]), relaxation_time=np.array([0.6]))
    result = in_flow_curve(lambda rate: Giesekus(alpha, 100.0).steady_shear(rate)[0], declared)
    assert [stage.effect for stage in result.stages] == ["giesekus_mobility"]
    low, high = result.stages[0].parameters["alpha"].ci95
    # three halves of a 95 % interval on either side: one draw of noise
    assert abs(alpha - 0.5 * (low + high)) < 1.5 * (high - low)


def test_of_a_law_and_a_term_that_predict_a_flow_curve_alike_the_law_is_named():
    declared = replace(TO_FIT, modulus=np.array([3.6]), relaxation_time=np.array([0.6]))
    both = ["giesekus_mobility", term := "tr(sigma.gammadot)*sigma"]
    (stage,) = in_flow_curve(
        lambda rate: Giesekus(0.5, 100.0).steady_shear(rate)[0], declared, both
    ).stages
    assert (stage.effect, stage.aliases) == ("giesekus_mobility", (term,))


def test_slip_of_a_flow_curve_is_told_where_modulus_and_time_are_known():
    def slips(rate):
        # γ̇ = γ̇ of the fluid + β σ, which rises with the fluid's own rate
        own = brentq(lambda r: r + 0.03 * fluid(r) - rate, 1e-9, rate)
        return fluid(own)

    def fluid(rate):
        return Giesekus(0.3, 100.0).steady_shear(rate)[0]

    result = in_flow_curve(slips, DECLARED)
    assert "wall_slip" in [stage.effect for stage in result.stages]


def structure(result):
    (stage,) = result.stages
    assert stage.effect == "thixotropy"
    return stage.left_open, [one.ci95 for one in stage.parameters.values()]


def softened(rate, times):
    """Return s σ of a Maxwell fluid, ds/dt = (1 − s)/t_b − k γ̇ s with k = 0.25 and t_b = 2 s."""
    decay = 0.5 + 0.25 * rate
    level = 0.5 / decay
    s = level + (1.0 - level) * np.exp(-decay * times)
    return s * 100.0 * rate * -np.expm1(-times)


def test_a_flow_curve_tells_the_product_of_breakdown_and_build_up_time_and_neither_alone():
    result = in_flow_curve(lambda rate: softened(rate, np.inf), DECLARED, ["thixotropy"])
    left_open, (breakdown, time) = structure(result)
    assert left_open == ("breakdown", "build_up_time")
    assert breakdown[0] < 0.25 < breakdown[1]
    assert time[0] < 2.0 < time[1]
    assert not any(one.determined for one in result.answer.constants)


def test_start_ups_tell_breakdown_and_build_up_time():
    rates = (0.3, 1.0, 3.0)
    drawn = np.random.default_rng(0)
    stresses = [white(softened(rate, TIMES), 0.01, drawn) for rate in rates]
    runs = [run_at(rate, TIMES, own) for rate, own in zip(rates, stresses, strict=True)]
    result = run_loop(dc.Dataset("made", tuple(runs)), DECLARED, effects=["thixotropy"])
    left_open, ends = structure(result)
    assert left_open == ()
    # to a tenth of it: a hundred samples of each of three runs with noise below 1 %
    assert [high - low < 0.1 * high for low, high in ends] == [True, True]
