"""Batches that are killed, and batches on a real dask cluster on the loopback interface.

The studies run a stand-in that writes real parts into real result folders, so that what is tested
is the machinery of the batch and not the learners. ``benchmarks/batch_kills.py`` does the same with
real studies and ten kills.
"""

import contextlib
import json
import os
import random
import re
import runpy
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import pytest

from discover.batch import cluster
from discover.batch import run as batch
from discover.errors import InputError
from discover.study.lock import LOCK_FILE

STAND_IN = """
import json, os, time
import numpy as np
from discover.batch import run as batch
from discover.batch.tasks import TaskResult
from discover.study.read import fingerprint, read_study
from discover.study.run_folder import RunFolder

def compare(path, out, seed, overwrite, progress):
    study = read_study(path)
    folder = RunFolder(out, fingerprint(study, "compare", seed), overwrite)
    page, data = folder.path / "report.html", folder.path / "comparison.json"
    if folder.complete and page.is_file() and data.is_file():
        return TaskResult(page, data, "there", True)
    noise = study.data.synthetic.noise
    if noise > 1:
        raise RuntimeError("no law fits <b>this</b>")
    progress("fitting", 0.5)
    numbers = []
    for i in range(6):
        part = folder.load(f"part{i}")
        if part is None:
            time.sleep(float(os.environ.get("SECONDS_A_PART", "0")))
            part = {"x": np.random.default_rng([i, int(1000 * noise)]).normal(size=500).tolist()}
            folder.save(f"part{i}", part)
            with open(os.environ["COUNTS"], "a", errors="replace") as counts:
                counts.write(f"{folder.path.name} {i}\\n")
        numbers.append(part["x"])
    term = {"term": "sigma.sigma", "coefficient": noise}
    errors = {"f": {"sigma12": noise, "N1": None, "N2": None}}
    details = {"selectors": {"chosen": {"bic": ["sigma.sigma"], "stability": []}}}
    learner = {"terms": [term], "errors": errors, "details": details}
    content = {"learners": {"tensor_sindy": learner}, "rivals": [], "undetermined": ["N2"]}
    folder.write("comparison.json", json.dumps({**content, "numbers": numbers}))
    folder.write("report.html", "<p>")
    folder.finish()
    return TaskResult(page, data, "found", False)

batch._TASKS["compare"] = compare
"""
STUDY = '[data]\nsynthetic = {{ law = "giesekus", parameters = {{ alpha = 0.2 }}, noise = {} }}\n'


@pytest.fixture
def studies(tmp_path, monkeypatch):
    """Three studies that work, one that fails; and a stand-in for the learners."""
    paths = [tmp_path / f"{name}.toml" for name in ("one", "two", "three", "fails")]
    for path, noise in zip(paths, (0.01, 0.02, 0.03, 2.0), strict=True):
        path.write_text(STUDY.format(noise))
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    monkeypatch.setenv("COUNTS", str(tmp_path / "counts.txt"))
    (tmp_path / "counts.txt").touch()
    monkeypatch.setattr(batch, "_TASKS", dict(batch._TASKS))
    runpy.run_path(str(tmp_path / "stand_in.py"))
    return paths


def computed(folder):
    """How often each part of each study was computed."""
    return Counter((folder / "counts.txt").read_text().splitlines())


def command(folder, pause=5.0):
    """The command line with the stand-in, to be completed by arguments."""
    code = f"import runpy; runpy.run_path({str(folder / 'stand_in.py')!r})\n"
    code += f"from discover.batch import summary; summary._PAUSE = {pause}\n"
    # whoever started the tests may ignore the signal, as a shell's & does, or block it
    code += "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
    code += "signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})\n"
    return [sys.executable, "-c", code + "from discover.cli import main; main()"]


def results(out):
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.name in ("comparison.json", "table.csv") and path.is_file()
    }


@pytest.fixture
def calm(studies, tmp_path):
    """What the batch gives when nobody disturbs it."""
    batch.run_batch(studies, tmp_path / "calm")
    kept = results(tmp_path / "calm")
    assert len(kept) == 4  # three studies and the table
    (tmp_path / "counts.txt").write_text("")
    return kept


def wait_for(condition, seconds=120.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.01)


@pytest.mark.slow
def test_a_batch_killed_at_random_ends_with_the_same_bytes(studies, calm, tmp_path, monkeypatch):
    monkeypatch.setenv("SECONDS_A_PART", "0.08")
    generator = random.Random(1)
    out = tmp_path / "out"
    arguments = ["batch", *map(str, studies), "--out", str(out), "--quiet"]
    for _ in range(2):
        process = subprocess.Popen([*command(tmp_path), *arguments])
        wanted = computed(tmp_path).total() + generator.randint(1, 8)
        while computed(tmp_path).total() < wanted:
            assert process.poll() is None
            time.sleep(0.01)
        time.sleep(generator.uniform(0.0, 0.05))
        process.kill()
        assert process.wait() == -signal.SIGKILL
    result = batch.run_batch(studies, out)
    assert results(out) == calm
    assert [study.status for study in result.studies][-1] == "failed"
    assert max(computed(tmp_path).values()) == 1  # what was finished is never done again


def test_what_ended_before_an_interruption_is_on_the_page(studies, calm, tmp_path):
    def stop(label, fraction):
        if label.startswith("2 of 4 ended"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        batch.run_batch([studies[-1], *studies[:-1]], tmp_path / "out", progress=stop)
    table = (tmp_path / "out" / "table.csv").read_text().splitlines()
    assert [line.split(",")[2] for line in table[1:]] == ["failed", "result", "waiting", "waiting"]
    assert "no law fits" in table[1]
    assert [s.status for s in batch.run_batch(studies, tmp_path / "out").studies] == [
        "complete", "done", "done", "failed",
    ]  # fmt: skip


@pytest.mark.slow
def test_ctrl_c_ends_workers_at_once_without_a_word_of_theirs(studies, calm, tmp_path):
    pytest.importorskip("distributed")
    psutil = pytest.importorskip("psutil")
    out = tmp_path / "out"
    settings = {
        "DASK_DISTRIBUTED__WORKER__PRELOAD": repr([str(tmp_path / "stand_in.py")]),
        "SECONDS_A_PART": "3",  # so that the batch is at work when the signal comes
    }
    arguments = ["batch", *map(str, studies[::-1]), "--out", str(out), "--workers", "2"]
    process = subprocess.Popen(
        [*command(tmp_path, pause=0.1), *arguments],
        env=os.environ | settings,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    table = out / "table.csv"
    wait_for(lambda: table.is_file() and "fails,compare,failed" in table.read_text())
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does, workers and all
    said, error = process.communicate(timeout=60)
    assert (said, process.returncode) == ("", 130)
    assert re.fullmatch(".*run the same command again.\n", error)

    def at_work(other):
        with contextlib.suppress(OSError, psutil.Error):
            return os.getpgid(other.pid) == process.pid and other.status() != "zombie"

    wait_for(lambda: not any(map(at_work, psutil.process_iter())), 10)
    assert computed(tmp_path).total() < 18  # it had not ended
    batch.run_batch(studies, out)
    assert results(out) == calm
    assert max(computed(tmp_path).values()) == 1


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_does_nothing_twice(studies, calm, tmp_path, monkeypatch):
    dask = pytest.importorskip("dask")
    pytest.importorskip("distributed")
    out, killed = tmp_path / "out", []
    monkeypatch.setenv("SECONDS_A_PART", "0.08")  # so that there is somebody to kill

    def kill_one():
        wait_for(lambda: computed(tmp_path).total() >= 1)
        while not killed:
            for lock in out.glob(f"*/{LOCK_FILE}"):
                with contextlib.suppress(OSError, ValueError):
                    pid = json.loads(lock.read_text())["pid"]
                    if pid != os.getpid() and not killed:
                        os.kill(pid, signal.SIGKILL)
                        killed.append(pid)
            time.sleep(0.005)

    said = []
    thread = threading.Thread(target=kill_one, daemon=True)
    with dask.config.set({"distributed.worker.preload": [str(tmp_path / "stand_in.py")]}):
        thread.start()
        result = batch.run_batch(
            studies, out, workers=2, progress=lambda text, fraction: said.append(fraction)
        )
    thread.join(10)
    assert killed
    assert [s.status for s in result.studies] == ["done", "done", "done", "failed"]
    assert results(out) == calm
    assert max(computed(tmp_path).values()) == 1
    # four studies that end, and word of three at work in between
    assert said == sorted(said)
    assert {0.125, 1.0} <= set(said)
    assert said[-1] == 1.0


def test_a_scheduler_that_exists_is_used(studies, calm, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1,
        threads_per_worker=2,
        processes=False,
        host="127.0.0.1",
        protocol="tcp://",
        dashboard_address=None,
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://127.0.0.1")
        result = batch.run_batch(studies, tmp_path / "out", scheduler=address)
    assert len(result.failed) == 1
    assert "no law fits" in result.failed[0].text
    assert results(tmp_path / "out") == calm


@pytest.mark.parametrize("workers", [1, 2])
def test_a_name_that_is_no_utf_8_costs_no_study_its_place(studies, tmp_path, monkeypatch, workers):
    distributed = pytest.importorskip("distributed")
    start = distributed.LocalCluster
    in_threads = {"processes": False, "protocol": "tcp://"}
    monkeypatch.setattr(distributed, "LocalCluster", lambda **given: start(**given | in_threads))
    odd = tmp_path / os.fsdecode(b"m\xe9lange.toml")
    odd.write_text(STUDY.format(0.04))
    broken = tmp_path / os.fsdecode(b"\xff.toml")
    broken.write_text("[data")
    out = tmp_path / "out"
    result = batch.run_batch([*studies[:1], odd, broken], out, workers=workers)
    assert [s.status for s in result.studies] == ["done", "done", "failed"]
    assert result.failed[0].input_error
    assert "m\\udce9lange" in (out / "index.html").read_text("utf-8")
    assert len((out / "table.csv").read_text("utf-8").splitlines()) == 4
    assert len(json.loads((out / "batch.json").read_text("utf-8"))["studies"]) == 3


@pytest.mark.parametrize("deaths", [1, 99])
def test_workers_killed_while_they_start_do_not_end_the_batch(
    studies, calm, tmp_path, monkeypatch, caplog, deaths
):
    distributed = pytest.importorskip("distributed")
    starts = []
    workers = distributed.LocalCluster

    def start(**options):
        starts.append(options)
        if len(starts) <= deaths:
            raise RuntimeError("Nanny failed to start.")  # as it does when its worker is killed
        return workers(**options | {"processes": False, "protocol": "tcp://"})

    monkeypatch.setattr(distributed, "LocalCluster", start)
    result = batch.run_batch(studies, tmp_path / "out", workers=2)
    assert [s.status for s in result.studies] == ["done", "done", "done", "failed"]
    assert results(tmp_path / "out") == calm
    assert len(starts) == min(deaths + 1, 3)
    assert ("one after the other" in caplog.text) == (deaths > 2)


def test_nobody_on_the_network_can_reach_the_workers():
    psutil = pytest.importorskip("psutil")
    with cluster._local_client(1):
        processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
        ports = [
            connection.laddr.ip
            for process in processes
            for connection in process.net_connections("tcp")
            if connection.status == psutil.CONN_LISTEN
        ]
    assert len(ports) >= 3  # scheduler, worker, the worker's nanny, their pages
    assert set(ports) == {"127.0.0.1"}


def test_no_more_workers_start_than_there_are_studies(studies, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(batch, "run_on_cluster", lambda run, jobs, n, *rest: asked.append(n))
    batch.run_batch(studies, tmp_path / "out", workers=1000)
    assert asked == [len(studies)]


def test_workers_without_the_same_files_are_told_from_those_that_have_them(tmp_path):
    class Future:
        def exception(self):
            return None

        def result(self):
            return batch.StudyStatus("a", "compare", "done", "found")

    job = ("a.toml", "a", "compare", str(tmp_path / "a"), None, False)
    status = cluster._status_of(Future(), job)
    assert status.status == "failed"
    assert "one file system" in status.text


def test_a_scheduler_that_does_not_answer_is_the_users_mistake(studies, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed")

    def no_answer(address, timeout):
        raise OSError(f"Timed out trying to connect to {address}")

    monkeypatch.setattr(distributed, "Client", no_answer)
    with pytest.raises(InputError, match=r"tcp://127\.0\.0\.1:9"):
        batch.run_batch(studies, tmp_path / "out", scheduler="tcp://127.0.0.1:9")
