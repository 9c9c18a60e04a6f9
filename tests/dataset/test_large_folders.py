"""Folders of more than anybody measures are checked in a time that one waits."""

import numpy as np

from discover.dataset import check_folder
from discover.dataset.checking.runs import doubts_among_runs
from discover.dataset.run import Run
from discover.dataset.tables import table
from discover.protocols.protocol import start_up


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
