"""Records that hold no signal: no effect is named, and nothing is said to explain them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import odeint

from discover.dataset import Dataset, Run
from discover.loop import DeclaredModel, run_loop
from discover.protocols import oscillatory_shear, start_up
from discover.report.loop import loop_verdict

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
TIMES = np.linspace(0.1, 10.0, 100)
FLOWS = {"slow": start_up(0.4), "fast": start_up(1.5), "wave": oscillatory_shear(1.5, 0.8)}
RATES = {"slow": np.full(100, 0.4), "fast": np.full(100, 1.5), "wave": 1.5 * np.cos(0.8 * TIMES)}
DECLARED = DeclaredModel.maxwell(100.0, 1.0)
TO_FIT = replace(DECLARED, fit_modulus=True, fit_relaxation_time=True)


def maxwell(rate):
    """Return σ' + σ = 100 γ̇ from rest, by scipy."""
    fine = np.append(0.0, TIMES)
    of_time = lambda t: np.interp(t, TIMES, rate)  # noqa: E731
    return odeint(lambda y, t: 100.0 * of_time(t) - y, 0.0, fine, tcrit=None)[1:, 0]


def loop(stress, declared=DECLARED, effects=("stress_offset", "stress_gain"), **options):
    runs = [Run(n, TIMES, FLOWS[n], RATES[n], np.asarray(stress[n])) for n in FLOWS]
    options = {"effects": list(effects), "max_effects": 2, "explanations": 1} | options
    return run_loop(Dataset("made", tuple(runs)), declared, **options)


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
    form = r"only noise of (.*)–(.*) Pa rms; a fluid's mean stress is below (.*) Pa \(95 %\), so"
    said = re.search(form, result.answer.headline)
    assert said
    *noise, most = map(float, said.groups())
    # that of each run, which median differences of 100 samples tell to some 10 %
    assert noise == pytest.approx([5.0, 5.0], rel=0.35)
    # the mean of a run is known to 5/√100 Pa: a bound of 1.6 of these above it, at most three off
    assert 1.645 * 0.8 * 0.5 < most < (1.645 * 1.2 + 3.0) * 0.5
    # the table of the page has the same numbers
    assert noise == pytest.approx(
        [f(r.scatter for r in result.records) for f in (min, max)], rel=0.05
    )


@BOTH
def test_a_dead_sensor_is_no_signal(declared):
    result = loop(drawn(lambda rate: 42.0 + 0.0 * rate, 0.5), declared)
    assert (result.verdict, result.stages) == ("no_signal", ())
    assert "alone explain the data as well" in result.remaining["description"]


def test_an_effect_that_switches_the_fluid_off_explains_nothing():
    # an instrument that drifts, with no fluid in it: the records change, but not with the rate
    result = loop(drawn(lambda rate: 3.0 * TIMES, 0.5), TO_FIT, ("stress_offset", "stress_drift"))
    assert result.verdict == "no_signal"
    assert result.stages == ()
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
