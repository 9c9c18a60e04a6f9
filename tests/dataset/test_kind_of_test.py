"""What ``runs.csv`` says was done: what is no transient in shear is not read as one."""

import numpy as np
import pytest

from discover.dataset import check_folder, load_dataset
from discover.errors import InputError

TIME = np.linspace(0.1, 2.0, 8)


def folder(path, header, *lines):
    """Write a data folder by hand; each line of ``runs.csv`` begins with the name of a file."""
    path.mkdir()
    (path / "runs.csv").write_text("\n".join([header, *lines]) + "\n")
    for line in lines:
        name = line.split(",")[0]
        extension = "uniaxial" in line
        rows = [
            "time_s,hencky_rate_1_s,tensile_stress_Pa"
            if extension
            else "time_s,shear_rate_1_s,stress_Pa,strain"
        ]
        for t in TIME:
            rows.append(f"{t},0.5,{t}" if extension else f"{t},0.5,{1 - np.exp(-t)},{0.5 * t}")
        (path / name).write_text("\n".join(rows) + "\n")
    return path


def test_extension_is_set_aside_and_shear_is_used(tmp_path):
    made = folder(tmp_path / "melt", "file,flow", "a.csv,shear", "b.csv,uniaxial", "c.csv,")
    data = load_dataset(made)
    assert data.names == ("a.csv", "c.csv")
    assert data.left_out == (
        "b.csv is set aside: it is uniaxial extension, and only shear is fitted."
    )
    findings = [f for f in check_folder(made) if f.severity == "note" and "aside" in f.text]
    assert [f.file for f in findings] == ["b.csv"]


@pytest.mark.parametrize(
    ("header", "cells", "word"),
    [
        ("file,start", "periodic", "steady alternation"),
        ("file,start", "steady", "rate_before"),
        ("file,step_strain", "0.03", "step of strain"),
        ("file,flow", "planar", "planar extension"),
    ],
)
def test_a_test_that_is_no_transient_from_rest_is_not_read_as_one(tmp_path, header, cells, word):
    made = folder(tmp_path / "melt", header, "a.csv,", f"b.csv,{cells}")
    data = load_dataset(made)
    assert data.names == ("a.csv",)
    assert word in data.left_out
    with pytest.raises(InputError, match=word):
        data.select(["b.csv"])


def test_what_is_declared_as_it_is_taken_is_used(tmp_path):
    header = "file,flow,control,start,step_strain,temperature_C"
    made = folder(tmp_path / "melt", header, "a.csv,shear,rate,rest,,25", "b.csv,,,,,")
    data = load_dataset(made)
    assert data.names == ("a.csv", "b.csv")
    assert not data.set_aside
    assert data.left_out == ""


def test_a_steady_start_is_used_where_the_study_says_from_which_rate(tmp_path):
    made = folder(tmp_path / "blood", "file,start,before", "a.csv,steady,5")
    assert load_dataset(made, rate_before="before").names == ("a.csv",)


def test_a_rate_under_imposed_stress_counts_as_measured(tmp_path):
    made = folder(tmp_path / "gel", "file,control", "a.csv,stress", "b.csv,rate")
    data = load_dataset(made)
    assert [run.rate_is_measured for run in data] == [True, False]


@pytest.mark.parametrize(
    ("header", "cell", "wanted"),
    [
        ("file,flow", "elongation", "shear, uniaxial, planar, biaxial"),
        ("file,control", "torque", "rate, stress"),
        ("file,start", "cold", "rest, periodic, steady"),
        ("file,step_strain", "3 %", "Write a number"),
    ],
)
def test_an_unknown_value_is_said_with_those_that_are_known(tmp_path, header, cell, wanted):
    made = folder(tmp_path / "melt", header, f"a.csv,{cell}")
    with pytest.raises(InputError, match="line 2") as error:
        load_dataset(made)
    assert wanted in str(error.value)
    assert repr(cell) in str(error.value)


def test_a_folder_of_extension_alone_is_refused_with_the_reason(tmp_path):
    made = folder(tmp_path / "melt", "file,flow", "a.csv,biaxial")
    with pytest.raises(InputError, match="biaxial extension"):
        load_dataset(made)


@pytest.mark.measured
def test_the_shear_runs_of_a_melt_are_read_beside_its_extensions(measured_data):
    data = load_dataset(measured_data / "ldpe150r")
    assert len(data) == 7
    assert len(data.set_aside) == 6
