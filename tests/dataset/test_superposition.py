"""Tests at several temperatures: known shifts come back, and where there are none that is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from discover.cli import app
from discover.dataset import load_dataset
from discover.dataset.linear.superposition import superpose
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.errors import InputError
from discover.report.data import superposition_words

OMEGA = np.geomspace(0.1, 100.0, 25)
CELSIUS = np.arange(100.0, 200.0, 15.0)
C1, C2, REFERENCE = 7.0, 120.0, 145.0
TIMES = np.geomspace(1e-8, 1e8, 33)
MODULI = 1e5 * TIMES**-0.2 * np.exp(-TIMES / 1e3)  # a broad spectrum that ends


def sweep(shift, vertical=1.0, moduli=MODULI, times=TIMES):
    x = OMEGA[:, None] * shift * times
    storage, loss = (x**2 / (1 + x**2)) @ moduli, (x / (1 + x**2)) @ moduli
    return LinearSweep(OMEGA, vertical * storage, vertical * loss)


def wlf(celsius):
    return 10.0 ** (-C1 * (celsius - REFERENCE) / (C2 + celsius - REFERENCE))


def test_the_constants_of_wlf_come_back_from_sweeps_that_were_made_with_them():
    found = superpose({t: sweep(wlf(t)) for t in CELSIUS})
    assert found.reference == REFERENCE
    assert found.verdict == "superposed"
    # a monotone cubic through eight samples a decade misses by some 1e-4 of a decade
    np.testing.assert_allclose(found.log_shift, np.log10(wlf(CELSIUS)), atol=5e-3)
    law = next(law for law in found.laws if law.name == "WLF")
    np.testing.assert_allclose(list(law.values.values()), (C1, C2), rtol=0.01)
    arrhenius = next(law for law in found.laws if law.name == "Arrhenius")
    assert arrhenius.error > 20.0 * law.error
    said = superposition_words(found)
    assert any("WLF at 145 °C: C1 = 7" in sentence for sentence in said)
    assert any("Arrhenius does not describe the shifts" in sentence for sentence in said)


def test_an_activation_energy_comes_back_and_its_interval_holds_it():
    energy, kelvin = 8e4, CELSIUS + 273.15
    shift = np.exp(energy / 8.314462618 * (1 / kelvin - 1 / (REFERENCE + 273.15)))
    noise = np.exp(np.random.default_rng(3).normal(0.0, 0.01, (len(CELSIUS), 2, len(OMEGA))))
    sweeps = {}
    for t, a, factor in zip(CELSIUS, shift, noise, strict=True):
        exact = sweep(a)
        moduli = exact.storage_modulus * factor[0], exact.loss_modulus * factor[1]
        sweeps[float(t)] = LinearSweep(OMEGA, *moduli)
    found = superpose(sweeps)
    law = next(law for law in found.laws if law.name == "Arrhenius")
    low, high = law.intervals["activation_energy_J_mol"]
    assert low < energy < high
    assert high - low < 0.1 * energy


def test_vertical_shifts_come_back_only_where_they_are_asked_for():
    vertical = (CELSIUS + 273.15) / (REFERENCE + 273.15)
    sweeps = {t: sweep(wlf(t), b) for t, b in zip(CELSIUS, vertical, strict=True)}
    found = superpose(sweeps, vertical=True)
    np.testing.assert_allclose(10.0**found.log_vertical, vertical, rtol=5e-3)
    np.testing.assert_allclose(found.log_shift, np.log10(wlf(CELSIUS)), atol=0.02)
    assert np.all(superpose(sweeps).log_vertical == 0.0)


def two_processes(celsius):
    """Return moduli of two processes of which one does not feel the temperature."""
    a, b = sweep(wlf(celsius)), sweep(1.0, 1.0, np.array([3e5]), np.array([0.1]))
    storage = a.storage_modulus + b.storage_modulus
    return LinearSweep(OMEGA, storage, a.loss_modulus + b.loss_modulus)


def test_where_superposition_fails_it_is_said():
    found = superpose({t: two_processes(t) for t in CELSIUS})
    assert found.verdict == "not_superposed"
    assert len(superposition_words(found)) == 1  # and no law of shifts that mean nothing


def written(path, tables):
    path.mkdir()
    rows = ["file,test,temperature_C"]
    for (kind, celsius), table in tables.items():
        name = f"{kind}_{celsius:g}C.csv"
        table.to_dataframe().to_csv(path / name, index=False)
        rows.append(f"{name},{kind},{celsius:g}")
    (path / "tests.csv").write_text("\n".join(rows) + "\n")
    return path


def invoke(*arguments):
    return CliRunner().invoke(app, ["data", "shift", *map(str, arguments)])


def test_the_moved_sweeps_are_a_new_folder_that_loads(tmp_path):
    made = written(tmp_path / "melt", {("lve", t): sweep(wlf(t)) for t in CELSIUS})
    result = invoke(made, "--out", tmp_path / "master", "--json")
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout)["verdict"] == "superposed"
    master = load_dataset(tmp_path / "master").linear_sweep
    assert master is not None
    assert len(master) == len(CELSIUS) * len(OMEGA)
    exact = sweep(1.0)
    moved = np.interp(OMEGA, master.angular_frequency, master.storage_modulus)
    np.testing.assert_allclose(moved, exact.storage_modulus, rtol=0.02)
    page = (tmp_path / "master" / "report.html").read_text()
    assert all(f'id="{name}"' in page for name in ("overlap", "van_gurp", "shifts"))


def test_what_does_not_superpose_gives_no_sweep_to_fit(tmp_path):
    made = written(tmp_path / "blend", {("lve", t): two_processes(t) for t in CELSIUS[::3]})
    result = invoke(made, "--out", tmp_path / "master")
    assert result.exit_code == 0, result.output
    assert "do not superpose" in result.stdout
    assert not (tmp_path / "master" / "lve.csv").exists()
    assert "<svg" in (tmp_path / "master" / "report.html").read_text()


@pytest.mark.parametrize(
    ("tests", "reference", "said"),
    [({t: sweep(wlf(t)) for t in CELSIUS}, 20.0, r"Take one of 100, 115"),
     ({25.0: sweep(1.0), 100.0: sweep(1e-12)}, None, "share no moduli")],
    ids=["a reference that was not measured", "neighbours without common moduli"],
)  # fmt: skip
def test_what_cannot_be_shifted_is_refused(tests, reference, said):
    with pytest.raises(InputError, match=said):
        superpose(tests, reference)


def noisy(exact, seed, size=0.02):
    error = np.exp(np.random.default_rng(seed).normal(0.0, size, (2, len(OMEGA))))
    return LinearSweep(OMEGA, *(exact.measured * error))


NEAR = np.array([130.0, 138.0, 145.0, 152.0, 160.0])


def test_intervals_of_shifts_hold_the_planted_ones():
    inside = []
    for seed in range(6):
        made = {float(t): noisy(sweep(wlf(t)), (seed, int(t))) for t in NEAR}
        found = superpose(made, REFERENCE)
        assert found.verdict == "superposed"
        off = np.abs(found.log_shift - np.log10(wlf(NEAR)))
        inside += list((off <= 1.96 * found.error[:, 0])[NEAR != REFERENCE])
        # 2 % noise of some 80 moduli, whose logs have slopes of 0.3 and more, and two steps
        assert np.max(found.error[:, 0]) < 0.05
    # of 24 intervals of 95 %, of which those of one set hang together, 5 miss in 1 of 100 cases
    assert np.sum(inside) >= 20


def test_sweeps_that_do_not_overlap_once_moved_are_not_said_to_superpose():
    found = superpose({float(t): sweep(wlf(t)) for t in NEAR}, REFERENCE)
    far = replace(found, log_shift=found.log_shift + 20.0 * np.arange(len(found.celsius)))
    assert found.verdict == "superposed"
    assert far.verdict == "doubtful"
    assert "do not overlap" in superposition_words(far)[0]


def test_vertical_shifts_of_power_laws_are_not_determined():
    def sliding(a, seed):
        moduli = 1e4 * (OMEGA * a) ** 0.5
        return noisy(LinearSweep(OMEGA, moduli, moduli), seed)

    made = {20.0: sliding(1.0, 1), 40.0: sliding(0.1, 2)}
    found = superpose(made, 20.0, True)
    assert found.error[1, 0] > 0.3
    assert any("do not determine the shift factors" in one for one in superposition_words(found))
    # one shift alone they give
    assert superpose(made, 20.0).log_shift[1] == pytest.approx(-1.0, abs=0.05)


def test_a_folder_of_results_is_written_over_only_where_that_is_asked(tmp_path):
    made = written(tmp_path / "melt", {("lve", t): sweep(wlf(t)) for t in NEAR[::2]})
    assert invoke(made, "--out", tmp_path / "master").exit_code == 0
    again = invoke(made, "--out", tmp_path / "master")
    assert again.exit_code == 2
    assert "holds a lve.csv already" in again.output
    few = invoke(made, "--out", tmp_path / "few", "--between", "100", "140")
    assert few.exit_code == 2
    assert "needs sweeps at two temperatures; got 1" in few.output


@pytest.mark.slow
@pytest.mark.measured
def test_polystyrene_superposes(measured_data, tmp_path):
    result = invoke(measured_data / "ps-linear", "--out", tmp_path / "master", "--vertical")
    assert result.exit_code == 0, result.output
    assert "The sweeps superpose" in result.stdout
    assert len(load_dataset(tmp_path / "master").linear_sweep) > 100
