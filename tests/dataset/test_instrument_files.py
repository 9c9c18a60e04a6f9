"""Exports of each shape, by formats and by their numbers, come out as the test that they hold."""

import made_exports as ex
import numpy as np
import openpyxl
import pytest
from made_exports import EXACT, LAMBDA, OMEGA, RATES, STRAINS, TIMES, imported, lines, moduli, run

from discover.dataset import load_dataset

TRIOS_SWEEP = (
    "Angular frequency", "Oscillation strain", "Stress", "Storage modulus", "Loss modulus",
)  # fmt: skip


def trios(mark):
    osc = ["[step]", "{}", mark.join(TRIOS_SWEEP), mark.join(("rad/s", "%", "MPa", "MPa", "kPa"))]
    head = [mark.join(pair) for pair in (("Filename", "a.tri"), ("Gap", "1000.0 µm"))]
    rows = [*head, *osc, ""]
    rows[rows.index("{}")] = "Amplitude sweep - 1"
    a, b = ex.softening(STRAINS)
    rows[-1:] = lines(10.0, STRAINS * 100, 0.0, a * 1e-6, b * 1e-3, mark=mark)
    rows += ["", *(line.replace("{}", "Frequency sweep - 2") for line in osc)]
    a, b = moduli(OMEGA)
    rows += lines(OMEGA, 1.0, 0.0, a * 1e-6, b * 1e-3, mark=mark)
    rows += ["", "[step]", "Flow sweep - 3", mark.join(("Stress", "Shear rate", "Step time"))]
    rows += [mark.join(("Pa", "1/s", "min"))]
    return rows + lines(RATES * 3.0, RATES, np.arange(1.0, 12.0), mark=mark)


@pytest.mark.parametrize(("name", "mark"), [("a.txt", "\t"), ("a.csv", ",")])
def test_steps_of_trios_become_the_tables_that_they_are(tmp_path, name, mark):
    out, result = imported(tmp_path, name, trios(mark))
    ex.assert_softening(out / "amplitude_sweep.csv")
    ex.assert_sweep(out / "lve.csv")
    ex.assert_curve(out, 3.0)
    assert not (out / "runs.csv").exists()
    assert "block 1 Amplitude sweep - 1: read as an amplitude sweep" in result.stdout
    again, _ = run(tmp_path, "--mapping", out / "import.toml", "--overwrite")
    ex.assert_softening(again / "amplitude_sweep.csv")


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
    ex.assert_sweep(out / "lve.csv")
    assert "Frequency sweep - 2" in result.stdout


def ares(temperatures):
    rows = ["[Header]", "Run date\t1/2/2023", "[Geometry: Standard]", "Gap\t1.0 mm"]
    for degrees in temperatures:
        rows += ["[Step]", f"Step name\tFrequency sweep ({degrees} °C)", "Number of points\t13"]
        rows += ["Variables\tTemperature\tAngular frequency\tStorage modulus\tLoss modulus"]
        rows += ["Units\t°C\trad/s\tPa\tPa"]
        shifted = moduli(OMEGA, 2.0 ** (-degrees / 10))
        rows += lines(float(degrees), OMEGA, *shifted, before="Data point")
    return rows


def test_sweeps_at_several_temperatures_stay_apart_and_one_can_be_chosen(tmp_path):
    out, result = imported(tmp_path, "a.txt", ares((150, 140, -10)), encoding="cp1252")
    for degrees in (150, 140, -10):
        ex.assert_sweep(out / f"lve_{degrees}C.csv", shift=2.0 ** (-degrees / 10))
    assert not (out / "lve.csv").exists()
    assert "3 temperatures, 150 to -10 °C" in result.stdout
    out, _ = imported(tmp_path, "a.txt", ares((150, 140)), "--temperature", 140, "--overwrite")
    ex.assert_sweep(out / "lve.csv", shift=2.0**-14)


def test_german_rheocompass_with_waveforms_gives_the_sweep_and_the_waves(tmp_path):
    names = ["Intervalldaten:", "Messpkt.", "Deformation", "Kreisfrequenz", "Speichermodul"]
    names += ["Verlustmodul", "Scherdeformation (Rohdaten)", "Schubspannung (Rohdaten)"]
    rows = ["Projekt:\tGel", "Test:\tLAOS 1", "Ergebnis:\tLAOS", "", "\t".join(names), ""]
    rows += ["\t\t[%]\t[rad/s]\t[kPa]\t[Pa]\t[%]\t[Pa]"]
    phase = 2 * np.pi * np.arange(64) / 64
    for i, (g, a, b) in enumerate(zip(STRAINS, *ex.softening(STRAINS), strict=True), start=1):
        point = [str(i), *(repr(float(v)) for v in (100 * g, 10.0, a / 1e3, b)), "", ""]
        rows.append("\t".join(["", *point]).replace(".", ","))
        wave = 100 * g * np.sin(phase), g * (a * np.sin(phase) + b * np.cos(phase))
        rows += lines(*wave, comma=True, before="\t\t\t\t\t")
    out, result = imported(tmp_path, "a.csv", rows, encoding="utf-16")
    ex.assert_softening(out / "amplitude_sweep.csv")
    data = load_dataset(out)
    assert len(data) == len(STRAINS)
    assert [row["start"] for row in (r.metadata for r in data)] == ["periodic"] * 9
    wave = data["a-point-9.csv"]
    np.testing.assert_allclose(wave.strain[:-1], STRAINS[8] * np.sin(phase), atol=1e-14)
    np.testing.assert_allclose(wave.time[-1], 2 * np.pi / 10.0, rtol=EXACT)
    assert "periodic steady state" in result.stdout


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
    ex.assert_curve(out, 3.0)
    ex.assert_sweep(out / "lve.csv")


def test_segments_of_rheowin_are_told_apart_by_their_number(tmp_path):
    rows = ["Company;Institute", "Date;1.2.2020 / 10:00", ";t in s;GP in 1/s;Tau in Pa;T in °C"]
    start = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
    for n, (t, s) in enumerate(zip(TIMES.tolist(), start.tolist(), strict=True), start=1):
        rows.append(f"1|{n};{t!r};0.15;{s!r};25.0")
    for n, r in enumerate(RATES.tolist(), start=1):
        rows.append(f"2|{n};{10 * n};{r!r};{3 * r!r};25.0")
    made = imported(tmp_path, "a.csv", rows, encoding="cp1252")
    test = made.run
    np.testing.assert_allclose(test.stress, start, rtol=EXACT)
    np.testing.assert_allclose(test.rate, 0.15)
    ex.assert_curve(made.folder, 3.0)


def test_files_of_reptate_are_what_their_suffix_says(tmp_path):
    x = np.linspace(0.0, 4 * np.pi, 200)
    files = {
        "a.tts": ["Mw=10;T=160;", "w G' G''", "rad/s Pa Pa", *lines(OMEGA, *moduli(OMEGA))],
        # RepTate divides this column by the rate, whatever stands above it
        "b.shear": ["gdot=0.5;T=160;", "time\th", "s\tPa-s", *lines(TIMES, TIMES * 2, 0.0)],
        "c.uext": ["gdot=0.1;T=160", *lines(TIMES, TIMES * 7)],
        "d.laos": ["omega=1.0;gamma=2.0;", "#Time(s)\tStrain(-)\ttau_yx(Pa)",
                   *lines(x, 2 * np.sin(x), 3 * np.sin(x + 0.5))],
        "e.creep": ["T=150;stress=10;", "t\tstrain", "s\t-", *lines(TIMES, TIMES * 0.1)],
    }  # fmt: skip
    for name, rows in files.items():
        (tmp_path / name).write_text("\n".join(rows))
    out, _ = run(tmp_path, *(tmp_path / name for name in files))
    ex.assert_sweep(out / "lve.csv")
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


def test_a_rate_that_alternates_is_not_taken_for_a_strain_without_a_name(tmp_path):
    time = np.linspace(0.0, 12.0, 300)
    stress = np.cos(time) + np.sin(time) - np.exp(-time)  # from rest, Maxwell, De = 1
    test = ex.exported(tmp_path, "time_s,shear_rate_1_s,stress_Pa", time, np.cos(time), stress).run
    np.testing.assert_allclose(test.rate, np.cos(time), rtol=EXACT)
    assert "start" not in test.metadata


def test_a_clock_that_goes_on_from_interval_to_interval_starts_anew_with_each(tmp_path):
    head = "Interval data:\tPoint No.\tTime\tShear Rate\tShear Stress", "\t\t[s]\t[1/s]\t[Pa]"
    start, rows = 30.0 * (1 - np.exp(-TIMES / LAMBDA)), []
    for begin in (0.0, 10.0):
        counted = enumerate(lines(begin + TIMES, 0.5 * (1 + begin), start), start=1)
        rows += ["", *head, *(f"\t{i}\t{row}" for i, row in counted)]
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
    test = ex.exported(tmp_path, "time_s,stress_Pa,strain", time, np.sin(time), strain).run
    assert test.protocol.control == "stress"
    assert ("start" in test.metadata) is not at_rest


def test_an_amplitude_sweep_without_a_frequency_says_where_to_write_it(tmp_path):
    head, columns = "strain_percent,Gp_Pa,Gpp_Pa", (100 * STRAINS, *ex.softening(STRAINS))
    out, result = ex.exported(tmp_path, head, *columns)
    assert "amplitude_sweep_rad_s" in result.stdout
    told = ex.table(out / "amplitude_sweep.csv")
    np.testing.assert_allclose(told["strain"], STRAINS, rtol=EXACT)
    ex.exported(tmp_path, ["Frequency [rad/s]: 10", head], *columns, options=["--overwrite"])
    ex.assert_softening(out / "amplitude_sweep.csv")


def test_a_radius_a_gap_and_a_rate_of_the_header_are_used(tmp_path):
    start = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
    torque = start * np.pi * 0.0125**3 / 2
    rows = [
        "Radius: 12.5 mm", "Gap [µm]: 800", "Shear rate = 6 1/min", "", "Time [s]\tTorque [mN.m]",
    ]  # fmt: skip
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
        ("Creep - 1", {"Step time": TIMES, "Stress": 50.0, "Strain": rise * 100}),
        ("Recovery - 2", {"Step time": TIMES, "Stress": 1e-4, "Strain": fall * 100}),
    )
    test = imported(tmp_path, "a.txt", made).run
    assert test.protocol.control == "stress"
    np.testing.assert_allclose(test.strain, np.concatenate([rise, fall]), rtol=EXACT)
    np.testing.assert_allclose(test.time[30:], 10.0 + TIMES, rtol=EXACT)
    assert np.all(test.stress[30:] == 0.0)


def test_a_run_in_a_file_that_is_called_as_a_table_is_still_a_run(tmp_path):
    columns = {"Step time": TIMES, "Stress": 50.0, "Strain": 20 + 10 * TIMES}
    out, _ = imported(tmp_path, "creep.txt", steps(("Creep", columns)))
    assert load_dataset(out).names == ("creep-run.csv",)


def test_the_rise_of_a_step_of_strain_is_told_from_what_follows(tmp_path):
    time = np.concatenate([[0.0, 0.01, 0.02], 0.03 + TIMES])
    strain = np.concatenate([[0.0, 33.0, 66.0], np.full(30, 100.0)])
    stress = ex.G * np.concatenate([[0.0, 0.33, 0.66], np.exp(-TIMES / LAMBDA)])
    made = steps(("Stress relaxation", {"Step time": time, "Strain": strain, "Stress": stress}))
    test = imported(tmp_path, "a.txt", made).run
    assert float(test.metadata["step_strain"]) == 1.0
    # the first sample at full strain ends the step
    assert float(test.metadata["step_time_s"]) == 0.04
    np.testing.assert_allclose(test.time, TIMES[1:] - TIMES[0], rtol=1e-12, atol=1e-15)


def test_what_follows_a_steady_flow_starts_from_it(tmp_path):
    fading = np.exp(-TIMES / LAMBDA)
    start = 50.0 * (1 - fading)
    made = steps(
        ("Peak hold - 1", {"Step time": TIMES, "Shear rate": 0.5, "Stress": start}),
        ("Peak hold - 2", {"Step time": TIMES, "Shear rate": 0.0, "Stress": start[-1] * fading}),
        ("Peak hold - 3", {"Step time": TIMES, "Shear rate": 0.0, "Stress": 0.0}),
    )
    out, result = imported(tmp_path, "a.txt", made)
    first, second = load_dataset(out)
    assert (first.rate_before, second.rate_before) == (0.0, 0.5)
    assert "block 3 Peak hold - 3: left out" in result.stdout


@pytest.mark.parametrize(
    ("said", "degrees"),
    [("a time sweep", 25.0), ("a temperature sweep", 25.0 + 2 * np.arange(13.0))],
)
def test_oscillations_that_nothing_is_fitted_to_are_said_not_taken(tmp_path, said, degrees):
    head = ["Time,Angular frequency,Strain,G',G'',Temperature", "s,rad/s,%,Pa,Pa,°C"]
    columns = TIMES[:13], 10.0, 1.0, *moduli(OMEGA), degrees
    out, result = ex.exported(tmp_path, head, *columns, code=2)
    assert said in result.stderr
    assert "--test" in result.stderr
    assert not out.exists()


def test_a_rise_of_the_rate_in_time_is_a_run_where_the_user_says_so(tmp_path):
    head = ["Time,Shear rate,Shear stress", "s,1/s,Pa"]
    columns = np.arange(1.0, 12.0), RATES, RATES
    out, result = ex.exported(tmp_path, head, *columns)
    assert (out / "flow_curve.csv").exists()
    assert "every row has another rate" in result.stdout
    ex.exported(tmp_path, head, *columns, options=("--test", "run", "--overwrite"))
    assert load_dataset(out).names == ("a.csv",)


def test_moduli_follow_from_their_size_and_angle(tmp_path):
    a, b = moduli(OMEGA)
    head = ["Frequency,Complex viscosity,Phase angle", "Hz,Pa.s,°"]
    columns = OMEGA / (2 * np.pi), np.hypot(a, b) / OMEGA, np.degrees(np.arctan2(b, a))
    found = ex.table(ex.exported(tmp_path, head, *columns).folder / "lve.csv")
    # arctan and back costs some roundings of the smaller modulus
    np.testing.assert_allclose(found["Gp_Pa"], a, rtol=1e-10)
    np.testing.assert_allclose(found["Gpp_Pa"], b, rtol=1e-10)
