"""What an export holds is told by its numbers, where no name of a format or of a step says it."""

import numpy as np
import pytest
from made_exports import (
    EXACT,
    LAMBDA,
    OMEGA,
    RATES,
    STRAINS,
    TIMES,
    G,
    assert_softening,
    imported,
    lines,
    moduli,
    softening,
    table,
)

from discover.dataset import load_dataset


def test_a_rate_that_alternates_is_not_taken_for_a_strain_without_a_name(tmp_path):
    time = np.linspace(0.0, 12.0, 300)
    stress = (np.cos(time) + np.sin(time) - np.exp(-time)) * G / 2  # from rest, Maxwell, De = 1
    rows = ["time_s,shear_rate_1_s,stress_Pa", *lines(time, np.cos(time), stress, mark=",")]
    out, _ = imported(tmp_path, "a.csv", rows)
    (test,) = load_dataset(out)
    np.testing.assert_allclose(test.rate, np.cos(time), rtol=EXACT)
    assert "start" not in test.metadata


def test_a_clock_that_goes_on_from_interval_to_interval_starts_anew_with_each(tmp_path):
    head = "Interval data:\tPoint No.\tTime\tShear Rate\tShear Stress", "\t\t[s]\t[1/s]\t[Pa]"
    start = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
    still = np.full(30, 0.5)
    rows = []
    for begin in (0.0, 10.0):
        rows += ["", *head, *(f"\t{i}\t{row}" for i, row in enumerate(
            lines(begin + TIMES, still * (1 + begin), start), start=1))]  # fmt: skip
    out, result = imported(tmp_path, "a.csv", rows, encoding="utf-16")
    for test in load_dataset(out):
        np.testing.assert_allclose(test.time, TIMES, rtol=1e-12, atol=1e-14)
    assert "time counts from the last sample before it, at 10 s" in result.stdout


@pytest.mark.parametrize("at_rest", [True, False])
def test_a_sine_of_stress_is_imposed_and_its_start_is_seen_in_the_strain(tmp_path, at_rest):
    time = np.linspace(0.0, 18.0, 400)
    strain = 0.1 * np.sin(time) - 0.3 * np.cos(time) + 0.03 * np.sin(3 * time)
    if at_rest:
        strain += 0.3 * np.exp(-time / 5.0)  # what starts from zero and fades
    rows = ["time_s,stress_Pa,strain", *lines(time, np.sin(time), strain, mark=",")]
    out, _ = imported(tmp_path, "a.csv", rows)
    (test,) = load_dataset(out)
    assert test.protocol.control == "stress"
    assert ("start" in test.metadata) is not at_rest


def test_an_amplitude_sweep_without_a_frequency_says_where_to_write_it(tmp_path):
    rows = ["strain_percent,Gp_Pa,Gpp_Pa", *lines(100 * STRAINS, *softening(STRAINS), mark=",")]
    out, result = imported(tmp_path, "a.csv", rows)
    assert "amplitude_sweep_rad_s" in result.stdout
    np.testing.assert_allclose(table(out / "amplitude_sweep.csv")["strain"], STRAINS, rtol=EXACT)
    rows.insert(0, "Frequency [rad/s]: 10")
    out, _ = imported(tmp_path, "a.csv", rows, "--overwrite")
    assert_softening(out / "amplitude_sweep.csv")


def test_a_radius_a_gap_and_a_rate_of_the_header_are_used(tmp_path):
    start = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
    torque = start * np.pi * 0.0125**3 / 2
    rows = [
        "Radius: 12.5 mm",
        "Gap [µm]: 800",
        "Shear rate = 6 1/min",
        "",
        "Time [s]\tTorque [mN.m]",
    ]
    out, result = imported(tmp_path, "a.txt", rows + lines(TIMES, torque * 1e3))
    (test,) = load_dataset(out)
    np.testing.assert_allclose(test.stress, start, rtol=1e-10)
    np.testing.assert_allclose(test.rate, 0.1)
    assert "of the header" in result.stdout
    # masked by zeros, as in exports that are given away
    rows[0] = "Radius: 00.0 mm"
    _, result = imported(tmp_path, "b.txt", rows + lines(TIMES, torque), "--overwrite", code=2)
    assert "--geometry" in result.stderr


UNITS = {"Step time": "s", "Stress": "Pa", "Shear rate": "1/s", "Strain": "%"}


def steps(*parts):
    rows = []
    for name, columns in parts:
        rows += ["[step]", name, "\t".join(columns), "\t".join(UNITS[key] for key in columns)]
        rows += [*lines(*columns.values()), ""]
    return rows


def test_creep_and_the_recovery_after_it_are_one_run(tmp_path):
    rise = 0.2 + 0.1 * TIMES
    fall = rise[-1] - 0.2 * (1 - np.exp(-TIMES))
    made = steps(
        ("Creep - 1", {"Step time": TIMES, "Stress": TIMES * 0 + 50.0, "Strain": rise * 100}),
        ("Recovery - 2", {"Step time": TIMES, "Stress": TIMES * 0 + 1e-4, "Strain": fall * 100}),
    )
    out, _ = imported(tmp_path, "a.txt", made)
    (test,) = load_dataset(out)
    assert test.protocol.control == "stress"
    np.testing.assert_allclose(test.strain, np.concatenate([rise, fall]), rtol=EXACT)
    np.testing.assert_allclose(test.time[30:], 10.0 + TIMES, rtol=EXACT)
    assert np.all(test.stress[30:] == 0.0)


def test_a_run_in_a_file_that_is_called_as_a_table_is_still_a_run(tmp_path):
    columns = {"Step time": TIMES, "Stress": TIMES * 0 + 50.0, "Strain": 20 + 10 * TIMES}
    out, _ = imported(tmp_path, "creep.txt", steps(("Creep", columns)))
    assert load_dataset(out).names == ("creep-run.csv",)


def test_the_rise_of_a_step_of_strain_is_told_from_what_follows(tmp_path):
    time = np.concatenate([[0.0, 0.01, 0.02], 0.03 + TIMES])
    strain = np.concatenate([[0.0, 33.0, 66.0], np.full(30, 100.0)])
    stress = G * np.concatenate([[0.0, 0.33, 0.66], np.exp(-TIMES / LAMBDA)])
    made = steps(("Stress relaxation", {"Step time": time, "Strain": strain, "Stress": stress}))
    out, _ = imported(tmp_path, "a.txt", made)
    (test,) = load_dataset(out)
    assert float(test.metadata["step_strain"]) == 1.0
    # the first sample at full strain ends the step
    assert float(test.metadata["step_time_s"]) == 0.04
    np.testing.assert_allclose(test.time, TIMES[1:] - TIMES[0], rtol=1e-12, atol=1e-15)


def test_what_follows_a_steady_flow_starts_from_it(tmp_path):
    start = 50.0 * (1 - np.exp(-TIMES / LAMBDA))
    made = steps(
        ("Peak hold - 1", {"Step time": TIMES, "Shear rate": TIMES * 0 + 0.5, "Stress": start}),
        ("Peak hold - 2", {"Step time": TIMES, "Shear rate": TIMES * 0,
                           "Stress": start[-1] * np.exp(-TIMES / LAMBDA)}),
        ("Peak hold - 3", {"Step time": TIMES, "Shear rate": TIMES * 0, "Stress": TIMES * 0}),
    )  # fmt: skip
    out, result = imported(tmp_path, "a.txt", made)
    first, second = load_dataset(out)
    assert (first.rate_before, second.rate_before) == (0.0, 0.5)
    assert "block 3 Peak hold - 3: left out" in result.stdout


LEFT_OUT = {
    "a time sweep": (np.full(13, 10.0), np.full(13, 1.0), np.full(13, 25.0), "a time sweep"),
    "a temperature sweep": (np.full(13, 10.0), np.full(13, 1.0), 25.0 + 2 * np.arange(13.0),
                            "a temperature sweep"),
}  # fmt: skip


@pytest.mark.parametrize("case", LEFT_OUT)
def test_oscillations_that_nothing_is_fitted_to_are_said_not_taken(tmp_path, case):
    omega, strain, degrees, word = LEFT_OUT[case]
    rows = ["Time,Angular frequency,Strain,G',G'',Temperature", "s,rad/s,%,Pa,Pa,°C"]
    rows += lines(TIMES[:13], omega, strain, *moduli(OMEGA), degrees, mark=",")
    out, result = imported(tmp_path, "a.csv", rows, code=2)
    assert word in result.stderr
    assert "--test" in result.stderr
    assert not out.exists()


def test_a_rise_of_the_rate_in_time_is_a_run_where_the_user_says_so(tmp_path):
    rows = ["Time,Shear rate,Shear stress", "s,1/s,Pa"]
    rows += lines(np.arange(1.0, 12.0), RATES, 3 * RATES, mark=",")
    out, result = imported(tmp_path, "a.csv", rows)
    assert (out / "flow_curve.csv").exists()
    assert "every row has another rate" in result.stdout
    out, _ = imported(tmp_path, "a.csv", rows, "--test", "run", "--overwrite")
    assert load_dataset(out).names == ("a.csv",)


def test_moduli_follow_from_their_size_and_angle(tmp_path):
    a, b = moduli(OMEGA)
    rows = ["Frequency,Complex viscosity,Phase angle", "Hz,Pa.s,°"]
    columns = OMEGA / (2 * np.pi), np.hypot(a, b) / OMEGA, np.degrees(np.arctan2(b, a))
    out, _ = imported(tmp_path, "a.csv", rows + lines(*columns, mark=","))
    found = table(out / "lve.csv")
    # arctan and back costs some roundings of the smaller modulus
    np.testing.assert_allclose(found["Gp_Pa"], a, rtol=1e-10)
    np.testing.assert_allclose(found["Gpp_Pa"], b, rtol=1e-10)
