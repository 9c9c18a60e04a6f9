"""Folders of more than anybody measures are checked in a time that one waits."""

import numpy as np
import pytest

from discover.dataset import check_folder, load_dataset
from discover.dataset.checking.runs import doubts_among_runs
from discover.dataset.run import Run
from discover.dataset.tables import table
from discover.protocols.protocol import start_up


def write_sweep(folder, n):
    omega = np.geomspace(1e-3, 1e3, n)
    rows = (
        f"{w!r},{100 * w * w / (1 + w * w)!r},{100 * w / (1 + w * w)!r}" for w in omega.tolist()
    )
    (folder / "runs.csv").write_text("file\na.csv\n")
    (folder / "a.csv").write_text("time_s,shear_rate_1_s,stress_Pa\n0.1,1,9\n0.2,1,17\n0.3,1,25\n")
    (folder / "lve.csv").write_text("\n".join(["omega_rad_s,Gp_Pa,Gpp_Pa", *rows]))
    return omega


def test_a_sweep_of_twenty_thousand_rows_is_thinned_and_said(tmp_path):
    omega = write_sweep(tmp_path, 20_000)
    data = load_dataset(tmp_path)
    assert data.linear_sweep is not None
    kept = data.linear_sweep.angular_frequency
    assert len(kept) <= 400
    assert set(kept.tolist()) <= set(omega.tolist())  # as recorded, none made up
    assert (kept[0], kept[-1]) == (omega[0], omega[-1])
    assert np.max(np.diff(np.log(kept))) < 0.05
    said = [str(finding) for finding in check_folder(tmp_path)]
    assert any("of 20,000 frequencies" in text for text in said)
    assert "of 20,000 frequencies" in data.thinned


def test_a_sweep_of_a_common_length_is_kept_whole(tmp_path):
    omega = write_sweep(tmp_path, 60)
    data = load_dataset(tmp_path)
    assert data.linear_sweep is not None
    np.testing.assert_array_equal(data.linear_sweep.angular_frequency, omega)
    assert data.thinned == ""
    assert not [f for f in check_folder(tmp_path) if "frequencies" in str(f)]


def test_a_check_reads_the_samples_of_each_run_once(tmp_path, monkeypatch):
    time = np.linspace(0.1, 5.0, 12)
    for name in ("a.csv", "b.csv"):
        lines = [f"{t:.6g},0.5,{50 * -np.expm1(-t):.6g}" for t in time]
        (tmp_path / name).write_text("\n".join(["time_s,shear_rate_1_s,stress_Pa", *lines]))
    (tmp_path / "runs.csv").write_text("file\na.csv\nb.csv\n")
    read = []
    whole = table.read_bytes

    def counted(path, *args, **kwargs):
        read.append(path.name)
        return whole(path, *args, **kwargs)

    monkeypatch.setattr(table, "read_bytes", counted)
    assert not check_folder(tmp_path).of("error")
    assert read.count("a.csv") == read.count("b.csv") == 1


def test_each_run_is_looked_at_once_however_many_there_are(monkeypatch):
    looks = 0

    def half_time(run):
        nonlocal looks
        looks += 1
        return 1.0

    monkeypatch.setattr("discover.dataset.checking.runs._half_time", half_time)
    time = np.linspace(0.1, 5.0, 12)
    runs = [
        Run(f"r{i}.csv", time, start_up(0.1), np.full(12, 0.1), 10 * -np.expm1(-time))
        for i in range(40)
    ]
    assert list(doubts_among_runs(runs)) == []
    assert looks == len(runs)


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_one_run_of_many_in_another_unit_is_still_found(factor):
    time = np.linspace(0.1, 5.0, 12)
    rise, gains = 100 * -np.expm1(-time), np.where(np.arange(8) == 3, factor, 1.0)
    runs = [
        Run(f"r{i}.csv", time, start_up(rate), np.full(12, rate), rise * rate * gains[i])
        for i, rate in enumerate(np.geomspace(0.1, 1.0, 8).tolist())
    ]
    assert {finding.file for finding in doubts_among_runs(runs)} == {"r3.csv"}
