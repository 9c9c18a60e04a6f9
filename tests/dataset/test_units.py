"""What stands after the underscore of a heading, and what `data check` says of it."""

import math

import pytest
from made_exports import write_files
from typer.testing import CliRunner

from discover.cli import app
from discover.dataset import check_folder, load_dataset
from discover.dataset.tables.units import read_heading, read_unit
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
NO_UNITS = ("Pa_2", "10Pa", "2", "1", "1e3Pa", "s_2", "Pa_10", "Pa22", "Pa__2", "pi", "e", "Pas",
            "mkPa", "Pa_", "__", "raw", "9**9")  # fmt: skip


NEVER_WORKED_OUT = (
    "9**9**9**9", "10Pa", "Pa*10", "s^9^9", "(" * 30, "((s))(", "Pa/", "//Pa", "Pa-", "ms11",
)  # fmt: skip


@pytest.mark.parametrize(("read", "known"), [(read_heading, HEADINGS), (read_unit, WRITTEN)])
def test_units_of_headings_and_of_exports_have_their_factors(read, known):
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


def test_every_conversion_is_said(tmp_path):
    sweep = "omega_Hz,Gp_kPa,Gpp_Pa\n0.1,1,5\n1,10,10\n10,15,5\n"
    write(tmp_path, f"time_ms,shear_rate_1_min,stress_kPa\n{ROWS}", sweep)
    said = " ".join(str(f) for f in check_folder(tmp_path) if f.subject == "units")
    for words in ("time_ms is read as time, times 0.001 to s", "stress_kPa is read as stress, "
                  "times 1000 to Pa", "shear_rate_1_min", "omega_Hz", "Gp_kPa"):  # fmt: skip
        assert words in said
    assert "Gpp" not in said


def test_si_units_are_no_conversion(tmp_path):
    write(tmp_path, f"time_s,shear_rate_1_s,stress_Pa\n{ROWS}")
    assert not [f for f in check_folder(tmp_path) if f.subject == "units"]


def test_an_import_says_its_conversions(tmp_path):
    (tmp_path / "x.csv").write_text("Time [s],Shear rate [1/s],Stress [kPa]\n" + ROWS)
    arguments = ["data", "import", str(tmp_path / "x.csv"), "--out", str(tmp_path / "out")]
    said = CliRunner().invoke(app, arguments).output
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
