"""Units: what a heading says, what numbers tell, what is asked for, and what a check says of it."""

import math

import numpy as np
import pytest
from command_line import invoke
from made_exports import columns, csv, write_files

from discover.dataset import check_folder, load_dataset
from discover.dataset.importing import import_files
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.text_rows import is_clock, seconds, with_points
from discover.dataset.tables.units import name_and_unit, read_heading, read_unit
from discover.errors import InputError

# factor to SI, by hand: 1 dyn = 1e-5 N, 1 psi = 0.45359237 kg · 9.80665 m/s² / (0.0254 m)²
HEADINGS = {
    "kPa": 1e3, "mPa": 1e-3, "MPa": 1e6, "bar": 1e5, "mbar": 100.0, "dyn_cm2": 0.1, "N_mm2": 1e6,
    "psi": 0.45359237 * 9.80665 / 0.0254**2, "lbf_in2": 0.45359237 * 9.80665 / 0.0254**2,
    "pascal": 1.0, "kilopascals": 1e3, "1_min": 1 / 60, "ms": 1e-3, "us": 1e-6, "minutes": 60.0,
    "percent": 0.01, "rad_s": 1.0, "Hz": 1.0,
}  # fmt: skip
WRITTEN = {
    "kPa": 1e3, "1/s": 1.0, "s-1": 1.0, "s^-1": 1.0, "s**-1": 1.0, "s⁻¹": 1.0, "1/min": 1 / 60,
    "N.m": 1.0, "mN·m": 1e-3, "µN m": 1e-6, "dyn/cm²": 0.1, "dyn/cm^2": 0.1, "N/(m.mm)": 1e3,
    "%": 0.01, "rad/s": 1.0, "rpm": math.pi / 30, "deg": math.pi / 180, "°": math.pi / 180,
    "-": 1.0, "": 1.0, "1": 1.0,
}  # fmt: skip
IN_EVERY_WRITING = {
    "1/s|s⁻¹|s^-1|s-1|s^{-1}|/s|1/sec|１／ｓ|1/с|с⁻¹": 1.0,
    "mPa·s|mPa s|mPas|mPa.s|mPa-s|mPa・s|cP|мПа·с|ｍＰａ・ｓ": 1e-3,
    "dyn/cm²|dyn/cm^2|Dyne/cm2|dynes/cm^2": 0.1,
    "min|Min|分|мин|분": 60.0,
    "°|deg|度|Grad": np.pi / 180.0,
    "㎪|kPa|ｋＰａ|кПа": 1e3,
}
WRITTEN |= {text: factor for texts, factor in IN_EVERY_WRITING.items() for text in texts.split("|")}
NO_UNITS = ("Pa_2", "10Pa", "2", "1", "1e3Pa", "s_2", "Pa_10", "Pa22", "Pa__2", "pi", "e", "Pas",
            "mkPa", "Pa_", "__", "raw", "9**9")  # fmt: skip


NEVER_WORKED_OUT = (
    "9**9**9**9", "10Pa", "Pa*10", "s^9^9", "(" * 30, "((s))(", "Pa/", "//Pa", "Pa-", "ms11",
)  # fmt: skip


@pytest.mark.parametrize(("read", "known"), [(read_heading, HEADINGS), (read_unit, WRITTEN)])
def test_units_of_headings_and_of_exports_in_every_writing_have_their_factors(read, known):
    for text, factor in known.items():
        unit = read(text)
        assert unit is not None, text
        assert unit.factor == pytest.approx(factor, rel=1e-12), text


@pytest.mark.parametrize(
    ("read", "texts"), [(read_heading, NO_UNITS), (read_unit, NEVER_WORKED_OUT)]
)
def test_digits_other_than_exponents_are_no_unit_and_none_is_worked_out(read, texts):
    assert [text for text in texts if read(text) is not None] == []


def write(folder, table, sweep="omega_rad_s,Gp_Pa,Gpp_Pa\n0.1,1,5\n1,10,10\n10,15,5\n"):
    return write_files(folder, {"runs.csv": "file\na.csv\n", "a.csv": table, "lve.csv": sweep})


ROWS = "0.1,1,1\n0.2,1,2\n"


@pytest.mark.parametrize(
    "header",
    ["time_s,shear_rate_1_s,stress_Pa_2", "time_s,shear_rate_1_s,stress_10Pa",
     "time_s_2,shear_rate_1_s,stress_Pa", "time_s,shear_rate_2_s,stress_Pa"],
)  # fmt: skip
def test_a_second_column_of_the_kind_is_not_taken_for_a_fraction(tmp_path, header):
    with pytest.raises(InputError, match="ends in no unit that is known"):
        load_dataset(write(tmp_path, f"{header}\n{ROWS}"))


@pytest.mark.parametrize(
    ("column", "words"),
    [("stress_Pa_2", "stress_Pa_2 in a.csv is not used"),
     ("N1_Pa_2", "N1_Pa_2 in a.csv is not read: it ends in no unit of N1")],
)  # fmt: skip
def test_a_column_that_is_not_read_for_its_heading_is_left_alone_and_said(tmp_path, column, words):
    table = f"time_s,shear_rate_1_s,stress_Pa,{column}\n0.1,1,1,7\n0.2,1,2,7\n"
    run = load_dataset(write(tmp_path, table)).runs[0]
    assert run.stress.tolist() == [1.0, 2.0]
    assert words in " ".join(map(str, check_folder(tmp_path)))


def test_every_conversion_is_said_and_si_units_are_none(tmp_path):
    sweep = "omega_Hz,Gp_kPa,Gpp_Pa\n0.1,1,5\n1,10,10\n10,15,5\n"
    write(tmp_path, f"time_ms,shear_rate_1_min,stress_kPa\n{ROWS}", sweep)
    said = " ".join(str(f) for f in check_folder(tmp_path) if f.subject == "units")
    for words in ("time_ms is read as time, times 0.001 to s", "stress_kPa is read as stress, "
                  "times 1000 to Pa", "shear_rate_1_min", "omega_Hz", "Gp_kPa"):  # fmt: skip
        assert words in said
    assert "Gpp" not in said
    write(tmp_path, f"time_s,shear_rate_1_s,stress_Pa\n{ROWS}")
    assert not [f for f in check_folder(tmp_path) if f.subject == "units"]


def test_an_import_says_its_conversions(tmp_path):
    (tmp_path / "x.csv").write_text("Time [s],Shear rate [1/s],Stress [kPa]\n" + ROWS)
    said = invoke("data", "import", tmp_path / "x.csv", "--out", tmp_path / "out").output
    assert "stress = Stress [kPa] × 1000" in said
    assert "Time [s] ×" not in said


def test_a_frequency_that_does_not_say_radians_is_said_to_be_read_so(tmp_path):
    write(tmp_path, f"time_s,shear_rate_1_s,stress_Pa\n{ROWS}", "omega_1_s,Gp_Pa,Gpp_Pa\n1,1,5\n")
    said = [str(f) for f in check_folder(tmp_path) if f.subject == "units"]
    assert ["omega_1_s is read as omega in rad/s; if it counts cycles, name it omega_Hz" in text
            for text in said] == [True]  # fmt: skip


@pytest.mark.parametrize(
    ("column", "rate"),
    [("rate_before_1_min", 0.05), ("rate_before_1_s", 3.0), ("rate_before", 3.0),
     ("rate_before_1_ms", 3000.0), ("gdot0", 3.0)],
)  # fmt: skip
def test_a_rate_before_is_read_in_the_unit_that_its_heading_names(tmp_path, column, rate):
    folder = write(tmp_path, f"time_s,shear_rate_1_s,stress_Pa\n{ROWS}")
    (folder / "runs.csv").write_text(f"file,{column}\na.csv,3\n")
    (run,) = load_dataset(folder, rate_before=column)
    assert run.rate_before == pytest.approx(rate, rel=1e-12)
    said = " ".join(str(f) for f in check_folder(folder) if f.subject == "start")
    assert ("multiplying by" in said) == (rate != 3.0)
    assert (f"multiplying by {rate / 3:.6g};" in said) == (rate != 3.0)


def test_a_rate_before_in_another_quantitys_unit_is_refused(tmp_path):
    folder = write(tmp_path, f"time_s,shear_rate_1_s,stress_Pa\n{ROWS}")
    (folder / "runs.csv").write_text("file,rate_before_Pa\na.csv,3\n")
    words = r"rate_before_Pa has the unit Pa, .* Name the column rate_before_1_s"
    with pytest.raises(InputError, match=words):
        load_dataset(folder, rate_before="rate_before_Pa")
    assert any("has the unit Pa" in str(f) for f in check_folder(folder).of("warning"))


TIME = np.array([0.1, 0.2, 0.4, 0.8, 1.6, 3.2])
STRESS = np.array([2.0, 3.5, 6.0, 9.0, 11.0, 12.0])


def read(folder, text, **known):
    file = folder / "a.csv"
    file.write_text(text, "utf-8")
    return import_files([file], Mapping(**known))


def table(**columns):
    return csv({name: np.asarray(values, float) for name, values in columns.items()})


def start_up(time="Time", rate="Shear Rate", stress="Shear Stress", **more):
    return table(**{time: TIME, rate: np.full(6, 2.0), stress: STRESS, **more})


def sweep(strain):
    size = np.geomspace(0.1, 1000.0, 12)
    moduli = {"G' (Pa)": 500.0 / (1 + size / 50), "G'' (Pa)": 200.0 / (1 + size / 90)}
    return table(**{strain: size, "Angular frequency (rad/s)": np.ones(12), **moduli})


def test_plain_names_without_units_are_SI_and_one_warning_says_so(tmp_path):
    made = read(tmp_path, start_up())
    warnings = [line for line in made.said if line.startswith("warning")]
    assert len(warnings) == 1
    for word in ("Time in s", "Shear Rate in 1/s", "Shear Stress in Pa", "--unit"):
        assert word in warnings[0]
    np.testing.assert_allclose(columns(made.files["a.csv"])["stress_Pa"], STRESS)
    given = read(tmp_path, start_up("Time (s)", "Shear Rate (1/s)", "Shear Stress (Pa)"))
    assert not [line for line in given.said if line.startswith("warning")]


def test_all_units_that_only_the_user_knows_are_asked_for_at_once(tmp_path):
    text = sweep("Strain").replace("Angular frequency (rad/s)", "Frequency")
    with pytest.raises(InputError) as caught:
        read(tmp_path, text)
    for option in ("strain=%", "strain=1", "omega=Hz", "omega=rad/s"):
        assert f"--unit {option}" in str(caught.value)
    made = read(tmp_path, text, units={"strain": "%", "omega": "Hz"})
    got = columns(made.files["amplitude_sweep.csv"])
    np.testing.assert_allclose(got["strain"], np.geomspace(1e-3, 10.0, 12))
    np.testing.assert_allclose(got["omega_rad_s"], 2.0 * np.pi)


@pytest.mark.parametrize("heading", ["Strain (%)", "Strain %", "Strain_percent", "Strain in %"])
def test_per_cent_in_any_heading_is_per_cent(tmp_path, heading):
    got = columns(read(tmp_path, sweep(heading)).files["amplitude_sweep.csv"])
    np.testing.assert_allclose(got["strain"], np.geomspace(1e-3, 10.0, 12))


def test_a_viscosity_without_a_unit_is_asked_for_only_where_it_stands_for_the_stress(tmp_path):
    rate = np.geomspace(1.0, 100.0, 6)
    thin = {"Shear rate (1/s)": rate, "Viscosity": STRESS / rate}
    with pytest.raises(InputError, match="--unit viscosity=mPa\\*s or --unit viscosity=Pa\\*s"):
        read(tmp_path, table(**thin))
    got = columns(read(tmp_path, table(**thin, Stress=STRESS)).files["flow_curve.csv"])
    np.testing.assert_allclose(got["stress_Pa"], STRESS)


def test_no_unit_is_asked_of_a_temperature_our_own_table_or_an_unused_strain(tmp_path):
    rate = np.geomspace(1.0, 100.0, 6)
    text = table(T=np.full(6, 25.0), **{"Shear rate": rate, "Stress": STRESS})
    assert "flow_curve.csv" in read(tmp_path, text).files
    assert "a.csv" in read(tmp_path, start_up("t")).files
    text = table(time_s=TIME, strain=2.0 * TIME, stress_Pa=STRESS)
    np.testing.assert_allclose(columns(read(tmp_path, text).files["a.csv"])["strain"], 2.0 * TIME)
    omega = np.geomspace(0.1, 10.0, 8)
    known = {"Angular frequency (rad/s)": omega, "G' (Pa)": omega, "G'' (Pa)": omega}
    text = table(Strain=np.full(8, 0.5), **known)
    assert "lve.csv" in read(tmp_path, text).files


def test_a_unit_that_changes_nothing_is_named(tmp_path):
    with pytest.raises(InputError, match="--unit torque changes nothing"):
        read(tmp_path, start_up(), units={"torque": "mN*m"})
    thick = {"Viscosity": STRESS / 2.0}
    made = read(tmp_path, start_up(**thick), units={"viscosity": "cP"})
    assert any("--unit viscosity changes nothing" in line for line in made.said)
    # the strain of a sweep may be called by either name
    for key in ("strain", "strain_amplitude"):
        made = read(tmp_path, sweep("Strain"), units={key: "%"})
        assert columns(made.files["amplitude_sweep.csv"])["strain"][-1] == pytest.approx(10.0)


def test_units_in_lines_above_are_used_a_time_of_day_is_none_and_a_clock_is_the_time(tmp_path):
    above = "Time: 12:15:24\nDate: 2024-01-05\nShear Stress Unit: dyn/cm^2\n\n"
    made = read(tmp_path, above + start_up("Elapsed Time", "S. Rate", "S. Stress"))
    np.testing.assert_allclose(columns(made.files["a.csv"])["stress_Pa"], 0.1 * STRESS)
    stamps = [f"00:00:{t:02d}" for t in range(2, 14, 2)]
    rows = "".join(f"{t},10.0,{s}\n" for t, s in zip(stamps, STRESS, strict=True))
    made = read(tmp_path, "Elapsed Time,Shear Rate,Shear Stress\n(hh:mm:ss),(1/s),(Pa)\n" + rows)
    np.testing.assert_allclose(columns(made.files["a.csv"])["time_s"], np.arange(2.0, 14.0, 2.0))


@pytest.mark.parametrize(
    ("cells", "wanted"),
    [
        (["00:00:02", "00:01:04.5"], [2.0, 64.5]),
        (["0:30", "1:00,5", "59:59", "1:00:00"], [30.0, 60.5, 3599.0, 3600.0]),
        (["12:15:24", "12:15:26"], [0.0, 2.0]),
        (["23:59:58", "00:00:02"], [0.0, 4.0]),
        (["2024-01-05 12:15:24.5", "2024-01-05T12:15:26"], [0.0, 1.5]),
        (["31.01.2024 23:59:59", "01.02.2024 00:00:01"], [0.0, 2.0]),
        (["1/31/2024 11:59:59 AM", "1/31/2024 12:00:01 PM"], [0.0, 2.0]),
        (["1 day, 0:00:02", "1 day, 0:00:05"], [0.0, 3.0]),
    ],
)
def test_clock_times_become_seconds(cells, wanted):
    assert all(map(is_clock, cells))
    np.testing.assert_allclose(seconds(cells), wanted, atol=1e-6)  # a stamp has digits of 1e-7 s


@pytest.mark.parametrize(
    ("heading", "name", "unit"),
    [
        ("τ [Pa]", "τ", "Pa"), ("τ (Pa)", "τ", "Pa"), ("τ in Pa", "τ", "Pa"),
        ("粘度（ｍＰａ・ｓ）", "粘度", "ｍＰａ・ｓ"), ("Rate (s^(-1))", "Rate", "s^(-1)"),
        ("G(t) [Pa]", "G(t)", "Pa"), ("tan(delta)", "tan(delta)", ""),
        ("Time (action)", "Time (action)", ""),
    ],
)  # fmt: skip
def test_a_unit_is_taken_off_a_heading(heading, name, unit):
    assert name_and_unit(heading, "") == (name, unit)


@pytest.mark.parametrize(
    ("cells", "wanted"),
    [
        ("1.234,5|12,3|2.000", "1234.5|12.3|2000"),
        ("1,234.5|12.3|2,000", "1234.5|12.3|2000"),
        ("1 234,5|−1,5|1\u202f234", "1234.5|-1.5|1234"),
        ("1'234.5|１２.５|0.123", "1234.5|12.5|0.123"),
        ("0,5|0,123|12,75", "0.5|0.123|12.75"),
    ],
)
def test_numbers_of_every_country_have_points_in_the_end(cells, wanted):
    assert with_points([cells.split("|")], "a.txt") == [wanted.split("|")]
