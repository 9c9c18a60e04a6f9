"""Exports of each shape that instruments write come out as the test that they hold."""

import numpy as np
import openpyxl
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
    assert_sweep,
    imported,
    lines,
    moduli,
    run,
    softening,
    table,
)

from discover.dataset import load_dataset

TRIOS_SWEEP = (
    "Angular frequency",
    "Oscillation strain",
    "Stress",
    "Storage modulus",
    "Loss modulus",
)


def trios(mark):
    """Amplitude sweep, frequency sweep and flow sweep in steps, as TRIOS writes them."""
    osc = ["[step]", "{}", mark.join(TRIOS_SWEEP), mark.join(("rad/s", "%", "MPa", "MPa", "kPa"))]
    head = [mark.join(pair) for pair in (("Filename", "a.tri"), ("Gap", "1000.0 µm"))]
    rows = [*head, *osc, ""]
    rows[rows.index("{}")] = "Amplitude sweep - 1"
    a, b = softening(STRAINS)
    still = np.zeros(9)
    rows[-1:] = lines(still + 10.0, STRAINS * 100, still, a * 1e-6, b * 1e-3, mark=mark)
    rows += ["", *(line.replace("{}", "Frequency sweep - 2") for line in osc)]
    a, b = moduli(OMEGA)
    still = np.zeros(13)
    rows += lines(OMEGA, still + 1.0, still, a * 1e-6, b * 1e-3, mark=mark)
    rows += ["", "[step]", "Flow sweep - 3", mark.join(("Stress", "Shear rate", "Step time"))]
    rows += [mark.join(("Pa", "1/s", "min"))]
    return rows + lines(RATES * 3.0, RATES, np.arange(1.0, 12.0), mark=mark)


@pytest.mark.parametrize(("name", "mark"), [("a.txt", "\t"), ("a.csv", ",")])
def test_steps_of_trios_become_the_tables_that_they_are(tmp_path, name, mark):
    out, result = imported(tmp_path, name, trios(mark))
    assert_softening(out / "amplitude_sweep.csv")
    assert_sweep(out / "lve.csv")
    np.testing.assert_allclose(table(out / "flow_curve.csv")["stress_Pa"], 3.0 * RATES, rtol=EXACT)
    assert not (out / "runs.csv").exists()
    assert "block 1 Amplitude sweep - 1: read as an amplitude sweep" in result.stdout
    again, _ = run(tmp_path, "--mapping", out / "import.toml", "--overwrite")
    assert_softening(again / "amplitude_sweep.csv")


def test_a_spreadsheet_is_read_sheet_by_sheet(tmp_path):
    book = openpyxl.Workbook()
    first, second = book.active, book.create_sheet("Frequency sweep - 2")
    first.title = "Details"
    first.append(["Filename", "a.tri"])
    second.append(["Angular frequency", "Storage modulus", "Loss modulus"])
    second.append(["rad/s", "kPa", "Pa"])
    for w, a, b in zip(OMEGA, *moduli(OMEGA), strict=True):
        second.append([float(w), float(a) / 1e3, float(b)])
    book.save(tmp_path / "a.xlsx")
    out, result = run(tmp_path, tmp_path / "a.xlsx")
    assert_sweep(out / "lve.csv")
    assert "Frequency sweep - 2" in result.stdout


def ares(temperatures):
    rows = ["[Header]", "Run date\t1/2/2023", "[Geometry: Standard]", "Gap\t1.0 mm"]
    for degrees in temperatures:
        rows += ["[Step]", f"Step name\tFrequency sweep ({degrees} °C)", "Number of points\t13"]
        rows += ["Variables\tTemperature\tAngular frequency\tStorage modulus\tLoss modulus"]
        rows += ["Units\t°C\trad/s\tPa\tPa"]
        a, b = moduli(OMEGA, 2.0 ** (-degrees / 10))
        rows += lines(np.full(13, float(degrees)), OMEGA, a, b, before="Data point")
    return rows


def test_sweeps_at_several_temperatures_stay_apart_and_one_can_be_chosen(tmp_path):
    out, result = imported(tmp_path, "a.txt", ares((150, 140, -10)), encoding="cp1252")
    for degrees in (150, 140, -10):
        assert_sweep(out / f"lve_{degrees}C.csv", shift=2.0 ** (-degrees / 10))
    assert not (out / "lve.csv").exists()
    assert "3 temperatures, 150 to -10 °C" in result.stdout
    out, _ = imported(tmp_path, "a.txt", ares((150, 140)), "--temperature", 140, "--overwrite")
    assert_sweep(out / "lve.csv", shift=2.0**-14)


def test_german_rheocompass_with_waveforms_gives_the_sweep_and_the_waves(tmp_path):
    names = ["Intervalldaten:", "Messpkt.", "Deformation", "Kreisfrequenz", "Speichermodul"]
    names += ["Verlustmodul", "Scherdeformation (Rohdaten)", "Schubspannung (Rohdaten)"]
    rows = ["Projekt:\tGel", "Test:\tLAOS 1", "Ergebnis:\tLAOS", "", "\t".join(names), ""]
    rows += ["\t\t[%]\t[rad/s]\t[kPa]\t[Pa]\t[%]\t[Pa]"]
    phase = 2 * np.pi * np.arange(64) / 64
    for i, (g, a, b) in enumerate(zip(STRAINS, *softening(STRAINS), strict=True), start=1):
        point = [str(i), *(repr(float(v)) for v in (100 * g, 10.0, a / 1e3, b)), "", ""]
        rows.append("\t".join(["", *point]).replace(".", ","))
        wave = 100 * g * np.sin(phase), g * (a * np.sin(phase) + b * np.cos(phase))
        rows += lines(*wave, comma=True, before="\t\t\t\t\t")
    out, result = imported(tmp_path, "a.csv", rows, encoding="utf-16")
    assert_softening(out / "amplitude_sweep.csv")
    data = load_dataset(out)
    assert len(data) == len(STRAINS)
    assert [row["start"] for row in (r.metadata for r in data)] == ["periodic"] * 9
    wave = data["a-point-9.csv"]
    np.testing.assert_allclose(wave.strain[:-1], STRAINS[8] * np.sin(phase), atol=1e-14)
    np.testing.assert_allclose(wave.time[-1], 2 * np.pi / 10.0, rtol=EXACT)
    assert "periodic steady state" in result.stdout


def test_french_names_are_known(tmp_path):
    names = ["Interval données:", "Point No.", "Intervalle Temps", "Déformation de Cisaillement"]
    names += ["Contrainte de Cisaillement", "Température"]
    rows = ["\t".join(names), "", "\t\t[s]\t[%]\t[mPa]\t[°C]"]
    decay = G * np.exp(-TIMES / LAMBDA)
    columns = TIMES, np.full(30, 5.0), 50.0 * decay, np.full(30, 25.0)
    for i, row in enumerate(lines(*columns, comma=True), start=1):
        rows.append(f"\t{i}\t{row}")
    out, result = imported(tmp_path, "a.csv", rows, encoding="utf-16")
    (test,) = load_dataset(out)
    assert float(test.metadata["step_strain"]) == 0.05
    assert test.metadata["temperature_C"] == 25.0
    np.testing.assert_allclose(test.stress, 0.05 * decay, rtol=EXACT)
    assert "relaxation after a step of strain" in result.stdout


def test_actions_of_rspace_are_told_apart_by_their_name_in_the_first_column(tmp_path):
    head = "Action Name;Time (action)(s);Shear stress(Pa);Shear rate(s-¹);Complex shear strain(%);"
    head += "Frequency(Hz);Shear modulus (elastic component)(Pa);"
    head += "Shear modulus (viscous component)(Pa);Temperature(°C)"
    rows = [head]
    for r, t in zip(RATES.tolist(), np.arange(11.0), strict=True):
        rows.append(f"Table of shear rates;{t!r};{3 * r!r};{r!r};;;;;25.0".replace(".", ","))
    for w, a, b in zip((OMEGA / (2 * np.pi)).tolist(), *(m.tolist() for m in moduli(OMEGA)),
                       strict=True):  # fmt: skip
        rows.append(f"Frequency table;1.0;;;1.0;{w!r};{a!r};{b!r};25.0".replace(".", ","))
    out, _ = imported(tmp_path, "a.csv", rows)
    np.testing.assert_allclose(table(out / "flow_curve.csv")["stress_Pa"], 3 * RATES, rtol=EXACT)
    assert_sweep(out / "lve.csv")


def test_segments_of_rheowin_are_told_apart_by_their_number(tmp_path):
    rows = ["Company;Institute", "Date;1.2.2020 / 10:00", ";t in s;GP in 1/s;Tau in Pa;T in °C"]
    start = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
    for n, (t, s) in enumerate(zip(TIMES.tolist(), start.tolist(), strict=True), start=1):
        rows.append(f"1|{n};{t!r};0.15;{s!r};25.0")
    for n, r in enumerate(RATES.tolist(), start=1):
        rows.append(f"2|{n};{10 * n};{r!r};{3 * r!r};25.0")
    out, _ = imported(tmp_path, "a.csv", rows, encoding="cp1252")
    (test,) = load_dataset(out)
    np.testing.assert_allclose(test.stress, start, rtol=EXACT)
    np.testing.assert_allclose(test.rate, 0.15)
    assert len(table(out / "flow_curve.csv")["stress_Pa"]) == 11


def test_files_of_reptate_are_what_their_suffix_says(tmp_path):
    x = np.linspace(0.0, 4 * np.pi, 200)
    files = {
        "a.tts": ["Mw=10;T=160;", "w G' G''", "rad/s Pa Pa", *lines(OMEGA, *moduli(OMEGA))],
        # RepTate divides this column by the rate, whatever stands above it
        "b.shear": ["gdot=0.5;T=160;", "time\th", "s\tPa-s", *lines(TIMES, TIMES * 2, TIMES * 0)],
        "c.uext": ["gdot=0.1;T=160", *lines(TIMES, TIMES * 7)],
        "d.laos": ["omega=1.0;gamma=2.0;", "#Time(s)\tStrain(-)\ttau_yx(Pa)",
                   *lines(x, 2 * np.sin(x), 3 * np.sin(x + 0.5))],
        "e.creep": ["T=150;stress=10;", "t\tstrain", "s\t-", *lines(TIMES, TIMES * 0.1)],
    }  # fmt: skip
    for name, rows in files.items():
        (tmp_path / name).write_text("\n".join(rows))
    out, _ = run(tmp_path, *(tmp_path / name for name in files))
    assert_sweep(out / "lve.csv")
    data = load_dataset(out)
    np.testing.assert_allclose(data["b.csv"].stress, 2 * TIMES, rtol=EXACT)
    np.testing.assert_allclose(data["b.csv"].rate, 0.5)
    assert data["c.csv"].flow == "uniaxial"
    np.testing.assert_allclose(data["c.csv"].stress, 7 * TIMES, rtol=EXACT)
    assert data["d.csv"].metadata["start"] == "periodic"
    assert data["e.csv"].protocol.control == "stress"
    np.testing.assert_allclose(data["e.csv"].stress, 10.0)


def test_a_shear_file_of_reptate_without_its_rate_is_refused(tmp_path):
    rows = ["T=160;", "t h", *lines(TIMES, TIMES)]
    _, result = imported(tmp_path, "a.shear", rows, code=2)
    assert "Write gdot=" in result.stderr


def test_a_table_without_names_is_refused_and_read_once_it_has_them(tmp_path):
    record = lines(TIMES, 2.0 * TIMES, -np.expm1(-TIMES), mark="  ")
    _, result = imported(tmp_path, "a.txt", record, code=2)
    assert "add a line such as time_s" in result.stderr
    out, _ = imported(tmp_path, "b.txt", ["time_s strain stress_Pa", *record])
    np.testing.assert_allclose(load_dataset(out)["b.csv"].strain, 2.0 * TIMES, rtol=EXACT)


@pytest.mark.measured
def test_real_exports_of_trios_are_what_their_steps_are_called(measured_data, tmp_path):
    folder = measured_data.parent / "instrument-files"
    if not folder.is_dir():
        pytest.skip("the instrument's own files are not here")
    out, _ = run(tmp_path, folder / "multi_technique.txt")
    files = {path.name for path in out.iterdir()}
    assert {"amplitude_sweep.csv", "lve.csv", "multi_technique-3.csv"} <= files
    (ramp,) = load_dataset(out)
    assert ramp.protocol.control == "stress"
    out, _ = run(tmp_path, folder / "creep_experiment.txt", "--overwrite")
    assert load_dataset(out)["creep_experiment.csv"].protocol.control == "stress"
    out, _ = run(tmp_path, folder / "frequency_sweep_tts_ARES.txt", "--overwrite")
    assert len(list(out.glob("lve_*C.csv"))) == 20
