"""What ``runs.csv`` says was done is how a run is read."""

import numpy as np
import pytest

from discover.dataset import check_folder, load_dataset
from discover.errors import InputError
from discover.protocols import shear_rates

TIME = np.linspace(0.1, 2.0, 8)


def folder(path, header, *lines):
    """Write a data folder by hand; each line of ``runs.csv`` begins with the name of a file."""
    path.mkdir(exist_ok=True)
    (path / "runs.csv").write_text("\n".join([header, *lines]) + "\n")
    for line in lines:
        name = line.split(",")[0]
        rows = ["time_s,shear_rate_1_s,stress_Pa,strain"]
        rows += [f"{t},0.5,{1 - np.exp(-t)},{0.5 * t}" for t in TIME]
        if "uniaxial" in line:
            rows = ["time_s,hencky_rate_1_s,tensile_stress_Pa", *(f"{t},0.5,{t}" for t in TIME)]
        (path / name).write_text("\n".join(rows) + "\n")
    return path


def test_extension_is_read_with_its_own_columns_and_refused_in_those_of_shear(tmp_path):
    made = folder(tmp_path / "melt", "file,flow", "a.csv,shear", "b.csv,uniaxial", "c.csv,")
    data = load_dataset(made)
    assert [run.flow for run in data] == ["shear", "uniaxial", "shear"]
    assert list(data["b.csv"].to_dataframe()) == ["time_s", "hencky_rate_1_s", "tensile_stress_Pa"]
    np.testing.assert_array_equal(data["b.csv"].stress, TIME)
    assert not [f for f in check_folder(made) if "aside" in f.text or "not used" in f.text]
    made = folder(tmp_path / "melt", "file,flow", "a.csv,uniaxial")
    index = made / "runs.csv"
    index.write_text(index.read_text().replace("uniaxial", "shear"))
    with pytest.raises(InputError, match="Write uniaxial, planar or biaxial in its column flow"):
        load_dataset(made)


def test_a_steady_start_takes_its_rate_from_its_column_and_is_no_start_from_rest_without(tmp_path):
    made = folder(tmp_path / "melt", "file,start", "a.csv,", "b.csv,steady")
    data = load_dataset(made)
    assert data.names == ("a.csv",)
    assert "rate_before" in data.left_out
    (said,) = (f.text for f in check_folder(made) if f.file == "b.csv" and f.subject == "runs")
    assert "b.csv is set aside: it starts from a steady flow" in said
    with pytest.raises(InputError, match="rate_before"):
        data.select(["b.csv"])
    # where the study says from which rate, it is used
    named = folder(tmp_path / "blood", "file,start,before", "a.csv,steady,5")
    assert load_dataset(named, rate_before="before").names == ("a.csv",)
    made = folder(tmp_path / "blood", "file,start,rate_before_1_min", "a.csv,steady,300", "b.csv,,")
    data = load_dataset(made)
    assert [run.rate_before for run in data] == [5.0, 0.0]
    assert [run.from_rest for run in data] == [False, True]
    (made / "runs.csv").write_text("file,start,rate_before_1_s\na.csv,steady,\n")
    with pytest.raises(InputError, match="line 2"):
        load_dataset(made)
    assert [f.subject for f in check_folder(made) if f.severity == "error"] == ["start"]


def test_what_is_said_of_a_rate_before_is_what_is_done_and_a_wrong_one_names_its_cell(tmp_path):
    made = folder(tmp_path / "melt", "file,rate_before_1_s,temperature_C", "a.csv,,", "b.csv,x,25")
    (said,) = (f for f in check_folder(made) if f.subject == "start")
    assert said.severity == "error"
    assert "rate_before_1_s in runs.csv must hold finite numbers; line 3 holds x" in said.text
    with pytest.raises(InputError, match="line 3 holds x"):
        load_dataset(made)
    lines = ("a.csv,steady,5", "b.csv,,", "c.csv,,3")
    made = folder(tmp_path / "melt", "file,start,rate_before_1_s", *lines)
    used, beside = (f.text for f in check_folder(made) if f.subject == "start")
    assert "the rate of the steady flow before a.csv (start is steady)" in used
    assert "a rate in rate_before_1_s for c.csv, taken as starting from rest" in beside
    assert [run.rate_before for run in load_dataset(made)] == [5.0, 0.0, 0.0]
    named = load_dataset(made, rate_before="rate_before_1_s")
    assert [run.rate_before for run in named] == [5.0, 0.0, 3.0]
    (made / "runs.csv").write_text("file,rate_before_1_s\na.csv,5\nb.csv,\n")
    (unused,) = (f.text for f in check_folder(made) if f.subject == "start")
    assert "without it the column is not used" in unused


def test_a_step_of_strain_is_part_of_what_was_imposed(tmp_path):
    header = "file,step_strain,step_time_s"
    made = folder(tmp_path / "melt", header, "a.csv,2,", "b.csv,2,0.5")
    for name in ("a.csv", "b.csv"):
        rows = ["time_s,stress_Pa", *(f"{t},{np.exp(-t)}" for t in TIME)]
        (made / name).write_text("\n".join(rows) + "\n")
    at_once, slow = load_dataset(made)
    assert float(slow.protocol.begins) == -0.5
    assert 0.0 < -float(at_once.protocol.begins) < 0.01 * TIME[0]
    assert not np.any(slow.rate)
    assert slow.strain[0] == 2.0
    np.testing.assert_allclose(shear_rates(slow.protocol, np.array([-0.25])) * 0.5, 2.0)


def waves(path, start, cycles=2.0):
    made = folder(path, "file,start", f"a.csv,{start}")
    time = np.linspace(0.0, cycles * np.pi, 80)
    rows = [f"{t},{2.0 * np.cos(2.0 * t)},{np.sin(2.0 * t + 0.3)}" for t in time]
    (made / "a.csv").write_text("\n".join(["time_s,shear_rate_1_s,stress_Pa", *rows]) + "\n")
    return made


def test_steady_alternation_goes_back_by_whole_cycles_of_the_record_and_needs_one(tmp_path):
    run = load_dataset(waves(tmp_path / "gel", "periodic"))[0]
    assert float(run.protocol.begins) < -8.0 * np.pi
    times = np.array([0.3, 1.1, 2.9])
    before = shear_rates(run.protocol, times - 3.0 * np.pi)
    # straight lines between 40 samples of a cycle miss (2 pi / 40)^2 / 8 of the amplitude
    np.testing.assert_allclose(before, 2.0 * np.cos(2.0 * times), atol=0.02)
    with pytest.raises(InputError, match=r"less than one period|does not alternate"):
        load_dataset(waves(tmp_path / "gel", "periodic", cycles=0.8))
    with pytest.raises(InputError, match="does not alternate"):
        load_dataset(folder(tmp_path / "melt", "file,start", "a.csv,periodic"))


def test_what_is_declared_is_used_and_a_rate_under_imposed_stress_is_measured(tmp_path):
    header = "file,flow,control,start,step_strain,temperature_C"
    made = folder(tmp_path / "melt", header, "a.csv,shear,rate,rest,,25", "b.csv,,,,,")
    data = load_dataset(made)
    assert (data.names, dict(data.set_aside), data.left_out) == (("a.csv", "b.csv"), {}, "")
    made = folder(tmp_path / "gel", "file,control", "a.csv,stress", "b.csv,rate")
    data = load_dataset(made)
    assert [run.rate_is_measured for run in data] == [True, False]


def test_imposed_stress_without_the_strain_that_answered_is_refused_once(tmp_path):
    made = folder(tmp_path / "gel", "file,control,flow", "a.csv,stress,", "b.csv,stress,uniaxial")
    rows = ["time_s,shear_rate_1_s,stress_Pa", *(f"{t},0.5,{t}" for t in TIME)]
    (made / "a.csv").write_text("\n".join(rows) + "\n")
    said = [str(f) for f in check_folder(made).of("error")]
    wanted = zip(said, (2, 3), ("a.csv", "b.csv"), ("strain", "hencky_strain"), strict=True)
    for text, line, file, column in wanted:
        assert f"Line {line} of runs.csv declares control = stress, but {file} has" in text
        assert f"no column {column}, " in text
        assert "leave the cell control empty if the rate was imposed" in text
    with pytest.raises(InputError, match="2 problems"):
        load_dataset(made)


def test_no_temperature_is_below_absolute_zero(tmp_path):
    lines = ("a.csv,-300", "b.csv,-273.15", "c.csv,hot")
    made = folder(tmp_path / "melt", "file,temperature_C", *lines)
    cold, hot = (str(f) for f in check_folder(made).of("error"))
    assert "Line 2 of runs.csv: temperature_C is -300, below absolute zero (-273.15 °C)" in cold
    assert "'hot'" in hot


@pytest.mark.parametrize(
    ("header", "cells", "words"),
    [
        ("step_strain", "300000", ["1 for 100 %"]),
        ("step_strain,step_time_s", "1,-2", ["from 0 on"]),
        ("step_strain,start", "1,periodic", ["both a step of strain"]),
        ("flow", "elongation", ["'elongation'", "shear, uniaxial, planar, biaxial"]),
        ("control", "torque", ["'torque'", "rate, stress"]),
        ("start", "cold", ["'cold'", "rest, periodic, steady"]),
        ("step_strain", "3 %", ["'3 %'", "Write a number"]),
    ],
)
def test_what_cannot_have_been_done_is_refused_with_what_is_known(tmp_path, header, cells, words):
    made = folder(tmp_path / "melt", f"file,{header}", f"a.csv,{cells}")
    with pytest.raises(InputError, match=r"[Ll]ine 2") as error:
        load_dataset(made)
    assert all(word in str(error.value) for word in words)


@pytest.mark.measured
def test_a_melt_is_read_with_its_extensions(measured_data):
    data = load_dataset(measured_data / "ldpe150r")
    assert [run.flow for run in data].count("uniaxial") == 6
    assert len(data) == 13
    assert not data.set_aside
