"""An import reads what a measurement can be, and writes over nothing that it read."""

import io
import os
import zipfile

import numpy as np
import openpyxl
import pytest
from command_line import invoke
from made_exports import EXACT, OMEGA, TIMES, assert_sweep, exported, imported, lines, moduli, run

from discover.dataset import load_dataset

SHEET = (
    '<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">{}</worksheet>'
)
SWEEP = ["omega (rad/s),G' (Pa),G'' (Pa)", *lines(OMEGA, *moduli(OMEGA), mark=",")]
START = ["Time [s],Shear rate [1/s],Stress [Pa]"]
START += lines(TIMES, 0.5, TIMES, mark=",")


def workbook(path, far=None, sheet=None):
    """Write a sweep as a workbook, with a far cell, or another text of its sheet."""
    book = openpyxl.Workbook()
    for row in SWEEP:
        book.active.append([float(c) if c[0].isdigit() else c for c in row.split(",")])
    if far is not None:
        book.active[far] = 1.0
    made = io.BytesIO()
    book.save(made)
    with zipfile.ZipFile(made) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for part in old.infolist():
            text = old.read(part)
            if sheet is not None and "worksheets/" in part.filename:
                text = sheet(text.decode()).encode()
            new.writestr(part.filename, text)


HARMLESS = {
    "a cell far below": {"far": "A1048576"},
    "a cell far to the right": {"far": "XFD1048576"},
    "a claimed size": {"sheet": lambda text: text.replace('"A1:C14"', '"A1:XFD1048576"')},
}


@pytest.mark.parametrize("case", HARMLESS)
def test_how_far_a_sheet_seems_to_go_costs_nothing(tmp_path, case):
    workbook(tmp_path / "a.xlsx", **HARMLESS[case])
    out, _ = run(tmp_path, tmp_path / "a.xlsx")
    assert_sweep(out / "lve.csv")


BOMBS = {
    "unpacks to 120 MB": lambda text: text.replace(
        "<sheetData>", f"<!--{'x' * 120_000_000}--><sheetData>"
    ),
    "or 1048576 rows": lambda text: SHEET.format(
        '<sheetData><row r="900000000000"><c r="A900000000000"><v>1</v></c></row></sheetData>'
    ),
}


@pytest.mark.parametrize("words", BOMBS)
def test_workbooks_larger_than_a_measurement_or_encrypted_are_refused(tmp_path, words):
    workbook(tmp_path / "a.xlsx", sheet=BOMBS[words])
    assert (tmp_path / "a.xlsx").stat().st_size < 1e6
    _, result = run(tmp_path, tmp_path / "a.xlsx", code=2)
    assert words in result.stderr
    (tmp_path / "a.xlsx").write_bytes(b"\xd0\xcf\x11\xe0 encrypted")
    _, result = run(tmp_path, tmp_path / "a.xlsx", code=2)
    assert "no .xlsx workbook, or one with a password" in result.stderr


def test_text_without_an_end_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    for file in (tmp_path / "pipe.csv", "/dev/zero"):
        _, result = run(tmp_path, file, code=2)
        assert "pipe or device" in result.stderr
    with (tmp_path / "large.csv").open("wb") as stream:
        stream.truncate(5_000_000_000)  # a hole: no byte of it is on the disk
    _, result = run(tmp_path, tmp_path / "large.csv", code=2)
    assert "has 5000 MB; the limit is 100 MB" in result.stderr
    (tmp_path / "wide.csv").write_text(",".join(["x"] * 5000) + "\n" + "1,2,3\n" * 3000)
    _, result = run(tmp_path, tmp_path / "wide.csv", code=2)
    assert "5000 columns and 3000 rows" in result.stderr


def test_one_of_twelve_files_that_cannot_be_read_is_named_and_the_others_are_read(tmp_path):
    files = [tmp_path / f"run{i:02d}.csv" for i in range(12)]
    for file in files:
        file.write_text("\n".join(START))
    files[4].write_bytes(b"\x00\x01\x02")
    out, result = run(tmp_path, *files)
    assert len(load_dataset(out)) == 11
    assert "not read: run04.csv is not text" in result.stderr
    assert "run04" not in (out / "import.toml").read_text()
    for file in files:
        file.write_bytes(b"\x00\x01\x02")
    _, result = run(tmp_path, *files, "--overwrite", code=2)
    assert "None of the 12 files can be read" in result.stderr


def test_runs_of_one_name_get_names_of_their_own(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "melt.csv").write_text("\n".join(START))
    out, _ = run(tmp_path, tmp_path / "a" / "melt.csv", tmp_path / "b" / "melt.csv")
    assert set(load_dataset(out).names) == {"melt.csv", "melt_2.csv"}


@pytest.mark.parametrize("name", ["start.csv", "lve.csv"])
@pytest.mark.parametrize("further", [[], ["--overwrite"]])
def test_an_import_does_not_write_over_the_export_that_it_reads(tmp_path, name, further):
    path = tmp_path / name
    path.write_text("\n".join(SWEEP if name == "lve.csv" else START))
    before = path.read_bytes()
    done = invoke("data", "import", path, "--out", tmp_path, "--no-page", *further, code=2)
    assert "--out" in done.stderr
    assert path.read_bytes() == before
    assert {one.name for one in tmp_path.iterdir()} == {name}


TEMPERATURES = {
    "title": ("a{}.csv", "Result:,Sweep at {} °C", ("20", "60")),
    "line alone": ("a{}.csv", "Sweep at {} K", ("293.15", "333.15")),
    "header": ("x{}.csv", "Temperature [K]: {}", ("293.15", "333.15")),
    "name": ("melt_{}C.csv", "PS", ("20", "60")),
    "name in kelvin": ("melt-{}K.csv", "PS", ("293.15", "333.15")),
}


@pytest.mark.parametrize("case", TEMPERATURES)
def test_the_temperature_of_a_file_is_read_where_people_write_it(tmp_path, case):
    name, title, degrees = TEMPERATURES[case]
    files = []
    for at, shift in zip(degrees, (1.0, 0.1), strict=True):
        files.append(tmp_path / name.format(at))
        text = [title.format(at), SWEEP[0], *lines(OMEGA, *moduli(OMEGA, shift), mark=",")]
        files[-1].write_text("\n".join(text), encoding="utf-8")
    out, _ = run(tmp_path, *files)
    assert_sweep(out / "lve_20C.csv")
    assert_sweep(out / "lve_60C.csv", shift=0.1)


def test_a_temperature_is_given_for_each_file_or_block_and_a_mapping_keeps_it(tmp_path):
    for name, shift in (("a", 1.0), ("b", 0.1)):
        text = [SWEEP[0], *lines(OMEGA, *moduli(OMEGA, shift), mark=",")]
        (tmp_path / f"{name}.csv").write_text("\n".join(text))
    files = tmp_path / "a.csv", tmp_path / "b.csv"
    out, result = run(tmp_path, *files)
    assert "Nothing says its temperature" in result.stdout
    options = "--temperature", "a.csv=20", "--temperature", "b.csv:1=333.15K", "--overwrite"
    out, _ = run(tmp_path, *files, *options)
    assert_sweep(out / "lve_60C.csv", shift=0.1)
    again = tmp_path / "again"
    mapping = "--mapping", out / "import.toml"
    invoke("data", "import", *mapping, "--no-page", "--out", again, code=0)
    assert_sweep(again / "lve_20C.csv")
    assert_sweep(again / "lve_60C.csv", shift=0.1)


def test_what_may_be_a_molar_mass_or_a_ramp_is_no_temperature(tmp_path):
    for name in ("PI95K-start.csv", "ramp_20C_to_60C.csv", "v2C.csv"):
        out, _ = imported(tmp_path, name, START, "--overwrite")
        assert "temperature_C" not in (out / "runs.csv").read_text()


@pytest.mark.parametrize("line", ["Temperature: 1e999 °C", "T = -300 °C"])
def test_a_temperature_that_cannot_be_is_named_and_not_used(tmp_path, line):
    out, result = imported(tmp_path, "a.csv", [line, *START])
    assert result.stdout.count("is not a temperature") == 1
    assert "--temperature a.csv=25" in result.stdout
    assert "temperature_C" not in (out / "runs.csv").read_text()
    head, *rows = START
    made = [f"{head},Temperature [°C]", *(f"{row},9999" for row in rows)]
    _, result = imported(tmp_path, "a.csv", made, "--overwrite")
    assert "9999 is not a temperature" in result.stdout
    _, result = imported(tmp_path, "a.csv", START, "--temperature", "a.csv=-300", code=2)
    assert "-273.15" in result.stderr


def test_a_number_of_the_header_that_is_none_is_named(tmp_path):
    head = "Time [s],Stress [Pa]"
    _, result = exported(tmp_path, ["Shear rate: 1e999 1/s", head], TIMES, TIMES, code=2)
    assert "Shear rate 1e999, more than a number can be" in result.stderr
    made = exported(tmp_path, ["Shear rate: 0.5 1/s", head], TIMES, TIMES)
    np.testing.assert_allclose(made.run.stress, TIMES, rtol=EXACT)
