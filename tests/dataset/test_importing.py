"""Text exports of rheometers become data folders, number for number."""

import math

import numpy as np
import pytest
from made_exports import EXACT, exported, imported, lines, run

from discover.dataset import load_dataset
from discover.dataset.importing.text_export import blocks_of_rows
from discover.dataset.importing.text_rows import read_rows
from discover.errors import InputError

TIMES = np.geomspace(0.01, 30.0, 40)
RATE = 0.7
STRESS = 120.0 * (1 - np.exp(-TIMES)) + 3.0 * TIMES * np.exp(-TIMES)
NORMAL = 50.0 * (1 - np.exp(-TIMES) * (1 + TIMES))


def trios(path, comma=False):
    rows = [
        "Filename\tC:\\data\\melt 1.tri", "Instrument serial number\t5343-0123",
        "Geometry name\t25 mm cone, 2°", "", "[step]", "Conditioning - 1",
        "Step time\tTemperature", "s\t°C", "0.0\t25.0", "1.0\t25.1", "",
        "[step]", "Peak hold - 2",
        "Step time\tTime\tShear rate\tStress\tN1\tStatus", "min\ts\t1/min\tkPa\tPa\t",
    ]  # fmt: skip
    columns = TIMES / 60, TIMES + 99, RATE * 60, STRESS / 1000, NORMAL
    text = "\r\n".join([*rows, *(f"{row}\tok" for row in lines(*columns))])
    if comma:
        head, body = text.split("Peak hold", 1)
        text = head.replace("0.0\t25.0", "0,0\t25,0").replace("1.0\t25.1", "1,0\t25,1")
        text += "Peak hold" + body.replace(".", ",")
    path.write_bytes(text.encode("cp1252"))
    return path


def rheocompass(path):
    rows = [
        "Project:\tmelt", "Test:\tstart-up", "Result:\tstart-up 1",
        f"Interval and data points:\t1\t{len(TIMES)}",
        "Interval data:\tPoint No.\tTime\tInterval Time\tShear Rate\tShear Strain\tShear Stress"
        "\tStatus",
        "\t\t\t\t\t\t\t", "\t\t[s]\t[ms]\t[1/s]\t[%]\t[mPa]\t",
    ]  # fmt: skip
    points = lines(TIMES + 5, TIMES * 1e3, RATE, RATE * TIMES * 100, STRESS * 1e3)
    rows += [f"\t{i}\t{point}\tWMa,TruStrain™" for i, point in enumerate(points, start=1)]
    rows.insert(-33, f"\t7\t\t\t{RATE!r}\t\t\tinvalid")  # as the instrument writes such a point
    path.write_bytes("\r\n".join(rows).encode("utf-16"))
    return path


def german(path):
    rows = ["Zeit [s];Schergeschwindigkeit [1/s];Schubspannung [Pa]"]
    rows += lines(TIMES, RATE, STRESS, mark=";", comma=True)
    path.write_bytes(("\ufeff" + "\n".join(rows)).encode())
    return path


def assert_equals_original(run, normal=False, strain=False):
    np.testing.assert_allclose(run.time, TIMES, rtol=EXACT)
    np.testing.assert_allclose(run.rate, RATE, rtol=EXACT)
    np.testing.assert_allclose(run.stress, STRESS, rtol=EXACT)
    if normal:
        np.testing.assert_allclose(run.first_normal_stress_difference, NORMAL, rtol=EXACT)
    if strain:
        np.testing.assert_allclose(run.strain, RATE * TIMES, rtol=EXACT)


@pytest.mark.parametrize("comma", [False, True])
def test_a_trios_export_is_read_number_for_number(tmp_path, comma):
    out, result = run(tmp_path, trios(tmp_path / "melt.txt", comma))
    assert "block 1 Conditioning - 1: not a run" in result.stdout
    (test,) = load_dataset(out)
    assert_equals_original(test, normal=True)
    assert (test.name, test.metadata["source_block"]) == ("melt-2.csv", "Peak hold - 2")


def test_a_rheocompass_export_is_read_and_its_invalid_point_left_out_with_a_word(tmp_path):
    out, result = run(tmp_path, rheocompass(tmp_path / "melt.csv"))
    assert "1 without all these numbers left out" in result.stdout
    assert_equals_original(load_dataset(out)["melt.csv"], strain=True)


def test_names_in_another_language_are_given_by_hand(tmp_path):
    file = german(tmp_path / "a.csv")
    text = file.read_text("utf-8-sig")
    for name, finnish in (("Zeit", "Aika"), ("Schergesch", "Leikkausn"), ("Schubsp", "Leikkausj")):
        text = text.replace(name, finnish)
    file.write_text(text)
    out, refused = run(tmp_path, file, code=2)
    assert "Leikkausjannung" in refused.stderr
    assert "--column" in refused.stderr
    assert not out.exists()
    names = ("time=Aika", "shear_rate=Leikkausnwindigkeit", "stress=Leikkausjannung")
    run(tmp_path, file, *(part for name in names for part in ("--column", name)))
    assert_equals_original(load_dataset(out)["a.csv"])


def test_an_import_is_repeated_from_its_mapping_file_alone(tmp_path):
    file, mapping = german(tmp_path / "a.csv"), tmp_path / "map.toml"
    mapping.write_text(
        '[columns]\ntime = "Zeit"\nshear_rate = "Schergeschwindigkeit"\nstress = "Schubspannung"\n'
    )
    first, _ = run(tmp_path, file, "--mapping", mapping)
    second = tmp_path / "two"
    second.mkdir()
    again, _ = run(second, "--mapping", first / "import.toml")
    for name in ("a.csv", "runs.csv"):
        assert (again / name).read_bytes() == (first / name).read_bytes()
    assert str(tmp_path) not in (first / "import.toml").read_text()  # a folder may be given away
    with file.open("a") as stream:
        stream.write("\n31,0;0,7;120,0")
    _, changed = run(second, "--mapping", first / "import.toml", "--overwrite")
    assert "a.csv has changed" in changed.stdout
    run(second, "--mapping", first / "import.toml", code=2)


def test_a_table_with_two_columns_of_one_name_is_imported_again_alike(tmp_path):
    rows = ["Shear rate [1/s],Shear rate [1/s],Shear stress [Pa],Torsion,Torsion"]
    rows += [f"{r},{1.01 * r},{90.0 * r**0.6},{r},{r}" for r in (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    first, _ = run(tmp_path, tmp_path / "a.csv")
    before = (first / "flow_curve.csv").read_bytes()
    run(tmp_path, "--mapping", first / "import.toml", "--overwrite")
    assert (first / "flow_curve.csv").read_bytes() == before
    # which of two is meant nothing says where neither is known for a strain
    _, refused = run(tmp_path, tmp_path / "a.csv", "--column", "strain=Torsion", code=2)
    assert "Two columns are named 'Torsion'" in refused.stderr


def test_files_in_different_units_come_back_the_same_when_repeated(tmp_path):
    for name, unit, factor in (("a", "kPa", 1e-3), ("b", "Pa", 1.0)):
        rows = [f"Time [s],Shear rate [1/s],{'Stress' if name == 'a' else 'Shear stress'} [{unit}]"]
        rows += lines(TIMES, RATE, STRESS * factor, mark=",")
        (tmp_path / f"{name}.csv").write_text("\n".join(rows))
    out, _ = run(tmp_path, tmp_path / "a.csv", tmp_path / "b.csv")
    for _ in range(2):
        for test in load_dataset(out):
            assert_equals_original(test)
        run(tmp_path, "--mapping", out / "import.toml", "--overwrite")


@pytest.mark.parametrize("tool", ["cone_plate", "plate_plate"])
def test_torque_and_speed_become_stress_and_rate_by_geometry(tmp_path, tool):
    radius, angle, gap = 12.5e-3, math.radians(2.0), 0.8e-3
    if tool == "cone_plate":
        option, strain = "cone-plate:radius_mm=12.5,angle_deg=2", 1 / angle
        stress = 3 / (2 * math.pi * radius**3)
    else:
        option, strain = "plate_plate:radius_mm=12.5,gap_mm=0.8", radius / gap
        stress = 2 / (math.pi * radius**3)
    head, force = "time (s),Torque (µN.m),Velocity (rpm),Normal force (N)", math.pi * radius**2 / 2
    columns = TIMES, STRESS / stress * 1e6, RATE / strain * 60 / (2 * math.pi), NORMAL * force
    exported(tmp_path, head, *columns, code=2)
    test = exported(tmp_path, head, *columns, options=("--geometry", option)).run
    cone = tool == "cone_plate"
    assert_equals_original(test, normal=cone)
    assert (test.first_normal_stress_difference is not None) is cone


def test_the_clock_may_have_started_before_the_flow(tmp_path):
    options = ("--column", "time=Time", "--start-time", 99)
    out, _ = run(tmp_path, trios(tmp_path / "melt.txt"), *options)
    np.testing.assert_allclose(load_dataset(out)[0].time, TIMES, atol=1e-13 * 99, rtol=0)


BAD = {
    "unknown quantity": (["--column", "viscosity=x"], "viscosity"),
    "no equals sign": (["--column", "stress"], "name=value"),
    "column that is not there": (["--column", "N2=Second"], "'Second'"),
    "unit of something else": (["--unit", "stress=s"], "not a unit of stress"),
    "no encoding of text": (["--encoding", "base64"], "no encoding"),
    "an encoding of domain names": (["--encoding", "idna"], "no encoding"),
    "an encoding that always fails": (["--encoding", "undefined"], "no encoding"),
    "a subnormal radius": (["--geometry", "cone_plate:radius_mm=1e-310,angle_deg=1"], "radius_mm"),
    "a radius in words": (["--geometry", "cone_plate:radius_mm=wide,angle_deg=1"], "a number"),
    "unknown unit": (["--unit", "stress=blorp"], "not known"),
    "half a geometry": (["--geometry", "cone_plate:radius_mm=25"], "needs angle_deg"),
    "no such tool": (["--geometry", "couette:radius_mm=25"], "geometry"),
    "wrong delimiter": (["--delimiter", "pipe"], "layout.delimiter"),
    "no such block": (["--block", "9"], "has 2 blocks"),
    "no such encoding": (["--encoding", "klingon"], "klingon"),
    "header far away": (["--header-row", "5000"], "--header-row"),
}


@pytest.mark.parametrize("case", BAD)
def test_wrong_options_are_one_line_and_write_nothing(tmp_path, case):
    options, words = BAD[case]
    out, result = run(tmp_path, trios(tmp_path / "melt.txt"), *options, code=2)
    assert words in result.stderr
    assert result.stderr.strip().count("\n") == 0
    assert not (out / "runs.csv").exists()


UNHELPED = {
    "torque without a tool": ("Step time,Torque,Velocity\ns,uN.m,rad/s", "--geometry cone_plate"),
    "half a sweep": ("Angular frequency,Storage modulus,Status\nrad/s,Pa,", "known as Gpp"),
    "no names": ("0,0,0", "add a line such as time_s"),
    "a name not known": ("Time,Shear rate,Ausgang\ns,1/s,Pa", "known as stress"),
}


@pytest.mark.parametrize("case", UNHELPED)
def test_an_export_without_a_run_says_what_it_lacks_and_what_to_do(tmp_path, case):
    head, words = UNHELPED[case]
    rows = [f"{i}.5,{i + 1}.25,{i}.75" for i in range(12)]
    _, result = imported(tmp_path, "a.csv", [head, *rows], code=2)
    assert words in result.stderr
    assert "a.csv" in result.stderr


@pytest.mark.parametrize(
    "content", [b"", b"\x00\x01\x02", b"PK\x03\x04", b"a;b\n", b"\xff\xfe", b'"', b"1,2\n3,4\n"]
)
def test_files_that_are_no_exports_are_refused(tmp_path, content):
    (tmp_path / "a.txt").write_bytes(content)
    _, result = run(tmp_path, tmp_path / "a.txt", code=2)
    assert "a.txt" in result.stderr


def test_a_comma_that_may_be_decimal_or_thousands_is_asked_for(tmp_path):
    rows = ["time\tstress\ts", "1,234\t5,678", "2,345\t6,789"]
    _, result = imported(tmp_path, "a.txt", rows, code=2)
    assert "--decimal" in result.stderr
    (block,) = blocks_of_rows(read_rows(tmp_path / "a.txt", decimal=","))
    assert block.cells[0][:2] == ("1.234", "5.678")


def test_a_folder_of_files_is_imported_as_all_of_them(tmp_path):
    (tmp_path / "mine").mkdir()
    for name in ("slow.csv", "fast.csv"):
        rows = "\n".join(f"{t:g},{RATE:g},{x:g}" for t, x in zip(TIMES, STRESS, strict=True))
        (tmp_path / "mine" / name).write_text(f"time_s,shear_rate_1_s,stress_Pa\n{rows}\n")
    (tmp_path / "mine" / ".hidden.csv").write_text("")
    # which is what to do with it
    with pytest.raises(InputError, match=r"has no runs\.csv.*discover data import"):
        load_dataset(tmp_path / "mine")
    out, _ = run(tmp_path, tmp_path / "mine")
    assert set(load_dataset(out).names) == {"slow.csv", "fast.csv"}
