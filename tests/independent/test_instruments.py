"""Faults of the simulated rheometer, each against its closed form, and folders that can be read."""

import numpy as np
import pytest
from independent import (
    KBKZ,
    Giesekus,
    UpperConvectedMaxwell,
    oscillation,
    start_up,
    steps,
)
from independent.folders import maxwell_sweep, write_folder, write_study, write_table
from independent.instruments import (
    Instrument,
    alternation_as_from_rest,
    nothing,
    relaxation_as_run,
    scaled,
)
from independent.noise import correlated, outliers, proportional, rms, white

from discover.dataset import load_dataset
from discover.study import read_study
from discover.study.data import load_study_data

TIMES = np.linspace(0.0, 6.0, 121)
MAXWELL = UpperConvectedMaxwell(50.0, 1.0)


def test_a_perfect_instrument_records_the_stress():
    run = Instrument().record(MAXWELL, start_up(2.0), TIMES)
    np.testing.assert_array_equal(run.stress, run.true.sigma12)
    np.testing.assert_array_equal(run.felt_rate, run.rate)


def test_slip_makes_maxwell_relax_faster():
    # σ' = G(γ̇ − sσ) − σ/λ
    slip, rate = 0.01, 2.0
    run = Instrument(slip=slip).record(MAXWELL, start_up(rate), TIMES)
    relaxing = 1.0 + 50.0 * slip
    np.testing.assert_allclose(
        run.stress, 50.0 * rate / relaxing * -np.expm1(-relaxing * TIMES), atol=1e-5
    )


def test_compliance_softens_maxwell():
    # σ' (1 + G C) = Gγ̇ − σ/λ
    run = Instrument(compliance=0.004).record(MAXWELL, start_up(2.0), TIMES)
    np.testing.assert_allclose(run.stress, 100.0 * -np.expm1(-TIMES / 1.2), atol=1e-5)


def test_inertia_and_friction_follow_the_tool_and_not_the_fluid():
    # the trap: with slip the fluid's rate is 60 % of the tool's, and lags it
    instrument = Instrument(slip=0.02, inertia=3.0, friction=5.0)
    flow = oscillation(2.0, 1.5)
    run = instrument.record(MAXWELL, flow, TIMES)
    of_tool = 5.0 * np.sign(flow.rate(TIMES)) - 3.0 * 2.0 * 1.5 * np.sin(1.5 * TIMES)
    np.testing.assert_allclose(run.stress - run.true.sigma12, of_tool, atol=1e-3)
    assert rms(run.felt_rate - run.rate) > 0.3 * rms(run.rate)


def test_rise_time_is_the_tools_own_and_inertia_feels_it():
    run = Instrument(rise_time=0.5, inertia=2.0).record(MAXWELL, start_up(2.0), TIMES)
    np.testing.assert_allclose(run.tool_rate, 2.0 * -np.expm1(-TIMES / 0.5), atol=1e-7)
    np.testing.assert_allclose(
        run.stress - run.true.sigma12, 2.0 * 4.0 * np.exp(-TIMES / 0.5), atol=1e-6
    )


def test_lag_and_delay_of_the_transducer_are_exact():
    run = Instrument(lag=0.3).record(MAXWELL, start_up(2.0), TIMES)
    known = 100.0 * (1 - (np.exp(-TIMES) - 0.3 * np.exp(-TIMES / 0.3)) / 0.7)
    np.testing.assert_allclose(run.stress, known, atol=0.01)
    late = Instrument(delay=0.21).record(MAXWELL, start_up(2.0), TIMES)
    known = 100.0 * -np.expm1(-np.maximum(TIMES - 0.21, 0.0))
    np.testing.assert_allclose(late.stress, known, atol=0.01)


def test_offset_drift_gain_steps_limits_and_clock_are_as_written():
    flow = start_up(2.0)
    true = MAXWELL.respond(flow, TIMES).sigma12
    record = {
        name: Instrument(**{name: value}).record(MAXWELL, flow, TIMES)
        for name, value in {
            "offset": 7.0, "drift": 0.5, "gain": 0.1, "adc_step": 3.0, "limit": 60.0,
            "clock_slip": 0.02, "rate_gain": 0.1, "fastest": 1.0,
        }.items()
    }  # fmt: skip
    np.testing.assert_allclose(record["offset"].stress, true + 7.0)
    np.testing.assert_allclose(record["drift"].stress, true + 0.5 * TIMES)
    np.testing.assert_allclose(record["gain"].stress, 1.1 * true)
    np.testing.assert_allclose(record["adc_step"].stress % 3.0, 0.0, atol=1e-12)
    assert np.max(np.abs(record["adc_step"].stress - true)) <= 1.5
    np.testing.assert_allclose(record["limit"].stress, np.minimum(true, 60.0))
    np.testing.assert_allclose(record["clock_slip"].time, 1.02 * TIMES)
    np.testing.assert_allclose(record["rate_gain"].stress, 1.1 * true, atol=1e-6)
    np.testing.assert_allclose(record["fastest"].stress, 0.5 * true, atol=1e-6)
    np.testing.assert_allclose(record["fastest"].rate, 2.0)


def test_a_dead_sensor_and_an_absent_fluid_have_nothing_of_the_flow():
    run = Instrument(dead=True, offset=42.0).record(MAXWELL, start_up(2.0), TIMES)
    np.testing.assert_array_equal(run.stress, 42.0)
    np.testing.assert_array_equal(nothing(run, 0.0).stress, 0.0)


def test_slip_of_an_integral_law_is_refused():
    with pytest.raises(ValueError, match="rate law"):
        Instrument(slip=0.1).record(KBKZ(), start_up(1.0), TIMES)
    run = Instrument(offset=1.0).record(KBKZ(), steps([0.0, 1.0], [1.0, 0.5]), TIMES)
    assert run.stress[0] == pytest.approx(1.0)


def test_relaxation_and_alternation_are_what_they_are_taken_for_not():
    relaxing = relaxation_as_run(MAXWELL, 0.03, 0.01, TIMES)
    np.testing.assert_allclose(relaxing.stress, 1.5 * np.exp(-TIMES), rtol=0.01)
    np.testing.assert_array_equal(relaxing.strain, 0.03)
    late = alternation_as_from_rest(MAXWELL, 2.0, 1.5, TIMES)
    wt = 1.5
    known = 100.0 * (np.cos(wt * TIMES) + wt * np.sin(wt * TIMES)) / (1 + wt**2)
    np.testing.assert_allclose(late.stress, known, atol=1e-4)
    np.testing.assert_allclose(scaled(late, 10.0, 1e3).stress, 10.0 * late.stress)


def test_noise_has_the_size_and_the_kind_asked_for():
    signal, generator = 5.0 * np.ones(20_000), np.random.default_rng(0)
    plain = white(signal, 0.02, generator) - signal
    assert rms(plain) == pytest.approx(0.1, rel=0.03)
    assert abs(np.corrcoef(plain[1:], plain[:-1])[0, 1]) < 0.03
    coloured = correlated(signal, 0.02, 0.9, generator) - signal
    assert rms(coloured) == pytest.approx(0.1, rel=0.1)
    assert np.corrcoef(coloured[1:], coloured[:-1])[0, 1] == pytest.approx(0.9, abs=0.02)
    ramp = np.linspace(0.0, 1.0, 20_000)
    noise = proportional(ramp, 0.1, generator) - ramp
    assert rms(noise[-2000:]) / rms(noise[:2000]) == pytest.approx(16.4, rel=0.2)
    thrown = outliers(signal, 0.05, 3.0, generator) - signal
    assert np.count_nonzero(thrown) == 1000
    assert np.min(np.abs(thrown[thrown != 0])) >= 7.5


def test_a_folder_and_a_study_written_by_hand_are_read(tmp_path):
    fluid = Giesekus(0.2, 50.0, 1.0)
    runs = {
        "a.csv": Instrument().record(fluid, start_up(2.0), TIMES),
        "b.csv": Instrument().record(fluid, oscillation(2.0, 1.0), TIMES),
    }
    folder = write_folder(
        tmp_path / "data", runs, {"a.csv": {"temperature_C": 20}}, normal_stresses=True
    )
    write_table(folder / "lve.csv", maxwell_sweep([50.0], [1.0], np.geomspace(0.01, 100, 20)))
    dataset = load_dataset(folder)
    np.testing.assert_allclose(dataset["b.csv"].stress, runs["b.csv"].stress, rtol=1e-8)
    np.testing.assert_allclose(
        dataset["b.csv"].second_normal_stress_difference, runs["b.csv"].N2, rtol=1e-8
    )
    assert dataset.linear_sweep is not None
    study = read_study(
        write_study(
            tmp_path / "study.toml",
            {
                "data": {"folder": "data", "held_out": ["b.csv"]},
                "model": {
                    "law": "giesekus",
                    "parameters": {"alpha": 0.2},
                    "modulus_Pa": 50.0,
                    "known_relaxation": True,
                },
                "loop": {"max_effects": 2, "effects": "named"},
            },
        )
    )
    assert load_study_data(study).held_out.names == ("b.csv",)
