"""One table that holds several tests is read as each of them, and nothing is left out unsaid."""

import made_exports as made
import numpy as np
import pytest
from made_exports import EXACT, LAMBDA, OMEGA, RATES, TIMES, assert_sweep, exported, imported, lines

from discover.dataset import load_dataset
from discover.dataset.importing.text_rows import temperature_in


def start_up(rate):
    return made.G * LAMBDA * rate * (1 - np.exp(-TIMES / LAMBDA))


def sweep(shift=1.0):
    return OMEGA, *made.moduli(OMEGA, shift)


def assert_start_ups(folder, names, rates):
    data = load_dataset(folder)
    assert set(data.names) == set(names)
    for name, rate in zip(names, rates, strict=True):
        np.testing.assert_allclose(data[name].time, TIMES, rtol=EXACT)
        np.testing.assert_allclose(data[name].rate, rate, rtol=EXACT)
        np.testing.assert_allclose(data[name].stress, start_up(rate), rtol=EXACT)


SWEEPS_SIDE_BY_SIDE = {
    "numbers over shared frequencies": [",20,,40,", "w (rad/s),Gp (Pa),Gpp (Pa),Gp (Pa),Gpp (Pa)"],
    "kelvin above names above units": [",T = 293.15 K,,T = 313.15 K,", "w,G',G'',G',G''",
                                       "rad/s,Pa,Pa,Pa,Pa"],
    "degrees in the names": ["omega [rad/s],G' 20 °C [Pa],G'' 20 °C [Pa],G' 40 °C [Pa],"
                             "G'' 40 °C [Pa]"],
    "degrees behind the units": ["omega_rad_s,Gp_Pa_20C,Gpp_Pa_20C,Gp_Pa_40C,Gpp_Pa_40C"],
    "grouped by what they are": ["w (rad/s),G' (Pa) 20C,G' (Pa) 40C,G'' (Pa) 20C,G'' (Pa) 40C"],
}  # fmt: skip


@pytest.mark.parametrize("case", SWEEPS_SIDE_BY_SIDE)
def test_sweeps_side_by_side_are_one_for_each_temperature(tmp_path, case):
    cold, warm = made.moduli(OMEGA), made.moduli(OMEGA, 0.1)
    pairs = zip(cold, warm, strict=True) if case == "grouped by what they are" else (cold, warm)
    columns = OMEGA, *(modulus for pair in pairs for modulus in pair)
    head = SWEEPS_SIDE_BY_SIDE[case]
    out, _ = exported(tmp_path, head, *columns)
    assert_sweep(out / "lve_20C.csv")
    assert_sweep(out / "lve_40C.csv", shift=0.1)
    exported(tmp_path, head, *columns, options=("--temperature", 40, "--overwrite"))
    assert_sweep(out / "lve.csv", shift=0.1)


RUNS_SIDE_BY_SIDE = {
    "rates above pairs": ["0.5 1/s,,2 1/s,", "Time [s],Stress [Pa],Time [s],Stress [Pa]"],
    "numbers above pairs": ["0.5,,2,", "time,stress,time,stress", "s,Pa,s,Pa"],
    "rates in the names": ["Time [s],Stress at 0.5 1/s [Pa],time [s],Stress at 2 1/s [Pa]"],
}


@pytest.mark.parametrize("case", RUNS_SIDE_BY_SIDE)
def test_pairs_of_time_and_stress_are_runs_at_the_rates_above_them(tmp_path, case):
    columns = TIMES, start_up(0.5), TIMES, start_up(2.0)
    out, _ = exported(tmp_path, RUNS_SIDE_BY_SIDE[case], *columns)
    assert_start_ups(out, ("a-1.csv", "a-2.csv"), (0.5, 2.0))


@pytest.mark.parametrize("count", [("", ".1"), ("_1", "_2")])
def test_columns_that_are_counted_are_runs_which_may_differ_in_length(tmp_path, count):
    names = [f"{name}{k}" for k in count for name in ("Time [s]", "Rate [1/s]", "Stress [Pa]")]
    rows = lines(TIMES, 0.5, start_up(0.5), TIMES, 2.0, start_up(2.0), mark=",")
    shorter = [",".join([*row.split(",")[:3], "", "", ""]) for row in rows[20:]]
    out, _ = imported(tmp_path, "a.csv", [",".join(names), *rows[:20], *shorter])
    first, second = load_dataset(out)
    np.testing.assert_allclose(first.stress, start_up(0.5), rtol=EXACT)
    np.testing.assert_allclose(second.stress, start_up(2.0)[:20], rtol=EXACT)


def stacked(*parts):
    return np.concatenate([np.stack(np.broadcast_arrays(*part), 1) for part in parts]).T


def in_turn(columns):
    return columns[:, np.argsort(columns[0], kind="stable")]


TWO = stacked(*((TIMES, rate, start_up(rate)) for rate in (0.5, 2.0)))
SET = stacked(*((TIMES, rate, rate, start_up(rate)) for rate in (0.5, 2.0)))
# samples A and B
SAMPLES = stacked(*((TIMES, name, rate, start_up(rate)) for name, rate in ((7, 0.5), (8, 2.0))))
# head, columns, and what is said; of what has the name of a sample, not what stands before it
TOLD_APART = {
    "by a clock that starts again": (
        "Time (s),Shear rate (1/s),Stress (Pa)", TWO, "Shear rate 0.5 1/s"
    ),
    "row by row, by a set rate": (
        "Time (s),Set rate (1/s),Shear rate (1/s),Stress (Pa)", in_turn(SET), "Set rate 0.5 1/s"
    ),
    "by a column of samples": ("Time (s),Sample,Shear rate (1/s),Stress (Pa)", SAMPLES, ""),
    "row by row, by a column of samples": (
        "Time (s),Sample,Shear rate (1/s),Stress (Pa)", in_turn(SAMPLES), ""
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", TOLD_APART)
def test_runs_below_each_other_or_in_turn_are_told_apart(tmp_path, case):
    head, columns, words = TOLD_APART[case]
    rows = [
        row.replace(",7.0,", ",A,").replace(",8.0,", ",B,") for row in lines(*columns, mark=",")
    ]
    out, result = imported(tmp_path, "a.csv", [head, *rows])
    told = ("a-1.csv", "a-2.csv"), (0.5, 2.0)
    assert_start_ups(out, *told)
    assert words in result.stdout
    assert words or "stands before it" not in result.stdout
    again, _ = made.run(tmp_path, "--mapping", out / "import.toml", "--overwrite")
    assert_start_ups(again, *told)


def test_a_quantity_that_stands_in_a_table_twice_makes_no_second_test(tmp_path):
    head = "Time (s),Temperature (°C),Shear rate (1/s),Temperature (°C),Stress (Pa)"
    out, _ = exported(tmp_path, head, TIMES, 25.0, 0.5, 25.1, start_up(0.5))
    assert_start_ups(out, ("a.csv",), (0.5,))


def test_a_clock_that_goes_on_through_steps_of_rate_is_one_run(tmp_path):
    columns = stacked(*((TIMES + 10.0 * k, rate, start_up(rate))
                        for k, rate in enumerate((0.5, 2.0, 0.5))))  # fmt: skip
    made = exported(tmp_path, "Time (s),Shear rate (1/s),Stress (Pa)", *columns)
    assert len(made.run.time) == 90


CURVE = "shear_rate_1_s,stress_Pa,temperature_C"


@pytest.mark.parametrize("mixed", [False, True])
def test_flow_curves_at_two_temperatures_are_two(tmp_path, mixed):
    columns = stacked((RATES, 3.0 * RATES, 20.1), (RATES, 0.3 * RATES, 60.0))
    out, _ = exported(tmp_path, CURVE, *(in_turn(columns) if mixed else columns))
    made.assert_curve(out, 3.0, "flow_curve_20.1C.csv")
    made.assert_curve(out, 0.3, "flow_curve_60C.csv")


def test_a_thermometer_that_drifts_makes_one_curve_and_a_ramp_makes_none(tmp_path):
    out, _ = exported(tmp_path, CURVE, RATES, 3 * RATES, 20.0 + 0.2 * np.arange(11.0))
    made.assert_curve(out, 3.0)
    ramp = RATES, RATES, 20.0 + 4.0 * np.arange(11.0)
    _, result = exported(tmp_path, CURVE, *ramp, code=2, name="b.csv")
    assert "at no one temperature, but from 22 to 58 °C" in result.stderr


def test_curves_below_each_other_are_told_by_rates_that_start_again(tmp_path):
    columns = stacked((RATES, 3.0 * RATES), (RATES, 0.3 * RATES))
    out, result = exported(tmp_path, "shear_rate_1_s,stress_Pa", *columns)
    made.assert_curve(out, 3.0)
    assert "Nothing says its temperature" in result.stdout


def test_a_table_of_a_calibration_is_no_test_of_the_sample(tmp_path):
    rows = [
        "Model X", "", "-- {} --", "Slope = 13.5", "Rotor speed,Shear rate,Shear stress",
        "(rpm),(1/s),(Pa)", *lines(RATES, RATES, 0.2 * RATES, mark=","), "****", "-- Data --",
        "Time,Shear rate,Shear stress,Signal", "(s),(1/s),(Pa),(V)",
        *lines(TIMES, 0.5, start_up(0.5), TIMES, mark=","),
    ]  # fmt: skip
    for title in ("Calibration Data", "Reference oil", "Kalibrierung", "Blank run (air)"):
        told = [row.format(title) for row in rows]
        out, result = imported(tmp_path, "a.csv", told, "--overwrite")
        assert_start_ups(out, ("a-2.csv",), (0.5,))
        assert not (out / "flow_curve.csv").exists()
        assert f"block 1 {title}: left out" in result.stdout
        assert "--test a.csv:1=flow_curve" in result.stdout
        assert "columns not read: Signal." in result.stdout
    plain = [row.format("Blank ink, flow curve") for row in rows]
    out, _ = imported(tmp_path, "a.csv", plain, "--overwrite")
    made.assert_curve(out, 0.2)


def test_a_table_whose_first_column_is_the_time_of_day_is_not_passed_over(tmp_path):
    clock = [f"10:00:{i:02d}" for i in range(30)]
    rows = [f"{c},{row}" for c, row in zip(clock, lines(TIMES, start_up(1.0), mark=","),
                                          strict=True)]  # fmt: skip
    head = ["Lab time,Age (s),Torque (mN.m)"]
    _, result = imported(tmp_path, "a.csv", head + rows, code=2)
    assert "Its columns are Lab time, Age, Torque" in result.stderr


def test_zeros_in_one_segment_leave_out_that_segment_alone(tmp_path):
    rows = ["SegIndex;t in s;omega in rad/s;G' in Pa;G\" in Pa"]
    rows += [f"1|{i};{i};0;0;0" for i in range(1, 6)]
    rows += [f"2|{i};{i};{row}" for i, row in enumerate(lines(*sweep(), mark=";"), start=1)]
    out, result = imported(tmp_path, "a.csv", rows)
    assert_sweep(out / "lve.csv")
    assert "segment 1: left out" in result.stdout
    assert "divide" not in result.output


def test_a_table_that_cannot_be_read_does_not_keep_the_others_from_being_read(tmp_path):
    rows = ["[step]", "Sweep - 1", "Angular frequency\tStorage modulus\tLoss modulus",
            "rad/s\tPa\tPa", *lines(*sweep()), "", "[step]", "Hold - 2",
            "Step time\tShear rate\tStress", "s\t1/s\tblorp",
            *lines(TIMES, 1.0, TIMES)]  # fmt: skip
    out, result = imported(tmp_path, "a.txt", rows)
    assert_sweep(out / "lve.csv")
    assert "not read: a.txt, block 2 Hold - 2" in result.stderr
    assert "--unit stress=" in result.stderr
    _, result = imported(tmp_path, "a.txt", rows, "--block", 2, "--overwrite", code=2)
    assert "blorp" in result.stderr


def test_a_file_of_reptate_may_lack_its_first_line_and_have_more_columns(tmp_path):
    out, _ = imported(tmp_path, "a.tts", lines(*sweep()))
    assert_sweep(out / "lve.csv")
    x = np.linspace(0.0, 4 * np.pi, 200)
    wave = x, 2 * np.sin(x), 3 * np.sin(x + 0.5), 1 - np.cos(2 * x)
    rows = ["omega=1.0;gamma=2.0;", "#Time(s)\tStrain(-)\ttau_yx(Pa)\ttau_xx-tau_yy(Pa)"]
    test = imported(tmp_path, "b.laos", rows + lines(*wave), "--overwrite").run
    found = test.first_normal_stress_difference
    np.testing.assert_allclose(found, wave[3], atol=1e-14)
    rows[1] = "#Time(s)\tStrain(-)\ttau_yx(Pa)\tIntensity"
    out, result = imported(tmp_path, "b.laos", rows + lines(*wave), "--overwrite")
    assert "columns not read: Intensity" in result.stdout


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("T=40", ("40", "°C")),
        ("melt_T=40", ("40", "°C")),
        ("Sample: melt, 40 °C", ("40", "°C")),
        ("melt 313.15 K", ("313.15", "K")),
        ("T=313", None),  # kelvin, or a number of the sample
        ("T40", None),
        ("from 20 °C to 40 °C", None),
    ],
)
def test_words_say_a_temperature_only_where_it_is_certain(text, said):
    found = temperature_in(text)
    assert (found and (found.value, found.unit)) == said
