"""Faults of the simulated rheometer, each against its closed form, and folders that can be read."""

import numpy as np
import pytest
from independent import KBKZ, Giesekus, UpperConvectedMaxwell, oscillation, start_up, steps
from independent.folders import maxwell_sweep, write_folder, write_study, write_table
from independent.instruments import (
    Instrument,
    alternation_as_from_rest,
    nothing,
    relaxation_as_run,
)  # fmt: skip
from independent.noise import correlated, outliers, proportional, rms, white

from discover.dataset import load_dataset
from discover.study import read_study
from discover.study.data import load_study_data

TIMES = np.linspace(0.0, 6.0, 121)
MAXWELL, UP = UpperConvectedMaxwell(50.0, 1.0), start_up(2.0)
TRUE = MAXWELL.respond(UP, TIMES).sigma12


def decay(time):
    return np.exp(-TIMES / time)


@pytest.mark.parametrize(
    ("faults", "known", "tolerance"),
    [
        ({}, TRUE, 0.0),
        # σ' = G(γ̇ − sσ) − σ/λ
        ({"slip": 0.01}, 100.0 / 1.5 * (1 - decay(1 / 1.5)), 1e-5),
        # σ' (1 + G C) = Gγ̇ − σ/λ
        ({"compliance": 0.004}, 100.0 * (1 - decay(1.2)), 1e-5),
        ({"lag": 0.3}, 100.0 * (1 - (decay(1.0) - 0.3 * decay(0.3)) / 0.7), 0.01),
        ({"delay": 0.21}, 100.0 * -np.expm1(-np.maximum(TIMES - 0.21, 0.0)), 0.01),
        ({"offset": 7.0}, TRUE + 7.0, 1e-9),
        ({"drift": 0.5}, TRUE + 0.5 * TIMES, 1e-9),
        ({"drift": 3.0, "settling_time": 2.0}, TRUE + 6.0 * (1 - decay(2.0)), 1e-9),
        ({"gain": 0.1}, 1.1 * TRUE, 1e-9),
        ({"limit": 60.0}, np.minimum(TRUE, 60.0), 1e-9),
        ({"rate_gain": 0.1}, 1.1 * TRUE, 1e-6),
        ({"fastest": 1.0}, 0.5 * TRUE, 1e-6),
        ({"dead": True, "offset": 42.0}, np.full(121, 42.0), 0.0),
    ],
    ids=lambda value: ", ".join(value) if isinstance(value, dict) else None,
)
def test_a_fault_is_in_the_stress_as_it_is_written(faults, known, tolerance):
    run = Instrument(**faults).record(MAXWELL, UP, TIMES)
    np.testing.assert_allclose(run.stress, known, rtol=0.0, atol=tolerance)
    np.testing.assert_array_equal(run.rate, 2.0)  # what was commanded
    np.testing.assert_array_equal(nothing(run, 0.0).stress, 0.0)


def test_steps_clock_inertia_friction_and_rise_time_are_as_written():
    stepped = Instrument(adc_step=3.0).record(MAXWELL, UP, TIMES).stress
    np.testing.assert_allclose(stepped % 3.0, 0.0, atol=1e-12)
    assert np.max(np.abs(stepped - TRUE)) <= 1.5
    slow = Instrument(clock_slip=0.02).record(MAXWELL, UP, TIMES)
    np.testing.assert_allclose(slow.time, 1.02 * TIMES)
    # the trap: with slip the fluid's rate is 60 % of the tool's, and lags it
    instrument = Instrument(slip=0.02, inertia=3.0, friction=5.0)
    flow = oscillation(2.0, 1.5)
    run = instrument.record(MAXWELL, flow, TIMES)
    of_tool = 5.0 * np.sign(flow.rate(TIMES)) - 3.0 * 2.0 * 1.5 * np.sin(1.5 * TIMES)
    np.testing.assert_allclose(run.stress - run.true.sigma12, of_tool, atol=1e-3)
    assert rms(run.felt_rate - run.rate) > 0.3 * rms(run.rate)
    run = Instrument(rise_time=0.5, inertia=2.0).record(MAXWELL, UP, TIMES)
    np.testing.assert_allclose(run.tool_rate, 2.0 * (1 - decay(0.5)), atol=1e-7)
    np.testing.assert_allclose(run.stress - run.true.sigma12, 8.0 * decay(0.5), atol=1e-6)


def test_a_ringing_transducer_overshoots_as_a_damped_oscillator():
    # a Maxwell fluid of very short memory has the stress G λ γ̇ at once: a step of 1 Pa
    fluid, times = UpperConvectedMaxwell(2e3, 5e-4), np.linspace(0.01, 2.0, 60)
    ringing = Instrument(resonance=8.0, damping=0.2).record(fluid, start_up(1.0), times)
    own, fading = 8.0 * np.sqrt(1.0 - 0.2**2), np.exp(-0.2 * 8.0 * times)
    step = 1.0 - fading * (np.cos(own * times) + 0.2 * 8.0 / own * np.sin(own * times))
    # the stress takes some 1e-3 s to rise, of a period of 0.8 s
    np.testing.assert_allclose(ringing.stress, step, atol=1e-2)
    assert np.max(ringing.stress) > 1.4


def test_slip_of_a_power_balances_the_rate_of_the_tool_and_of_an_integral_law_is_refused():
    fluid = UpperConvectedMaxwell(100.0, 0.01)
    record = Instrument(slip=0.3, slip_power=3.0).record(fluid, start_up(1.3), np.array([0.0, 2.0]))
    stress = record.stress[-1]  # η = 1 Pa s, so that γ̇_felt = σ
    assert stress + 0.3 * stress**3 == pytest.approx(1.3, rel=1e-6)
    with pytest.raises(ValueError, match="rate law"):
        Instrument(slip=0.1).record(KBKZ(), start_up(1.0), TIMES)
    run = Instrument(offset=1.0).record(KBKZ(), steps([0.0, 1.0], [1.0, 0.5]), TIMES)
    assert run.stress[0] == pytest.approx(1.0)


def test_relaxation_and_alternation_are_what_they_are_taken_for_not():
    relaxing = relaxation_as_run(MAXWELL, 0.03, 0.01, TIMES)
    np.testing.assert_allclose(relaxing.stress, 1.5 * decay(1.0), rtol=0.01)
    np.testing.assert_array_equal(relaxing.strain, 0.03)
    late, wt = alternation_as_from_rest(MAXWELL, 2.0, 1.5, TIMES), 1.5
    known = 100.0 * (np.cos(wt * TIMES) + wt * np.sin(wt * TIMES)) / (1 + wt**2)
    np.testing.assert_allclose(late.stress, known, atol=1e-4)


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
    flows = {"a.csv": UP, "b.csv": oscillation(2.0, 1.0)}
    runs = {name: Instrument().record(fluid, flow, TIMES) for name, flow in flows.items()}
    cells = {"a.csv": {"temperature_C": 20}}
    folder = write_folder(tmp_path / "data", runs, cells, normal_stresses=True)
    write_table(folder / "lve.csv", maxwell_sweep([50.0], [1.0], np.geomspace(0.01, 100, 20)))
    dataset = load_dataset(folder)
    read, written = dataset["b.csv"], runs["b.csv"]
    np.testing.assert_allclose(read.stress, written.stress, rtol=1e-8)
    np.testing.assert_allclose(read.second_normal_stress_difference, written.N2, rtol=1e-8)
    model = {"law": "giesekus", "parameters": {"alpha": 0.2}, "modulus_Pa": 50.0,
             "known_relaxation": True}  # fmt: skip
    sections = {
        "data": {"folder": "data", "held_out": ["b.csv"]},
        "model": model,
        "loop": {"max_effects": 2, "effects": "named"},
    }
    study = read_study(write_study(tmp_path / "study.toml", sections))
    assert load_study_data(study).held_out.names == ("b.csv",)
