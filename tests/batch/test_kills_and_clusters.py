"""Batches that are killed, batches side by side, and on a real dask cluster on this machine.

The studies run a stand-in that writes real parts into real result folders, so that what is tested
is the machinery of the batch and not the learners.
"""

import contextlib
import json
import os
import random
import re
import runpy
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter

import pytest

from discover.batch import run as batch
from discover.batch import workers
from discover.errors import InputError
from discover.study.atomic import LOCK_FILE

STAND_IN = """
import json, os, time
import numpy as np
from discover.batch import run as batch
from discover.batch.run import TaskResult
from discover.study.data import fingerprint, read_study
from discover.study.run_folder import RunFolder

def compare(path, out, seed, overwrite, progress):
    study = read_study(path)
    folder = RunFolder(out, fingerprint(study, "compare", seed), overwrite)
    page, data = folder.path / "report.html", folder.path / "comparison.json"
    if folder.complete and page.is_file() and data.is_file():
        return TaskResult(page, data, "found", True)
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
    learner = {"terms": [term], "errors": errors, "details": {}}
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
    monkeypatch.setattr(workers, "_COMMAND", worker_with_stand_in(tmp_path))
    runpy.run_path(str(tmp_path / "stand_in.py"))
    return paths


def worker_with_stand_in(folder, first=""):
    """The command line of a worker that runs some code, and the stand-in."""
    code = f"{first}import runpy; runpy.run_path({str(folder / 'stand_in.py')!r})\n"
    return [sys.executable, "-P", "-c", code + "from discover.batch.worker import main; main()"]


def computed(folder):
    return Counter((folder / "counts.txt").read_text().splitlines())


def command(folder, pause=5.0):
    """The command line with the stand-in, to be completed by arguments."""
    code = f"import runpy; runpy.run_path({str(folder / 'stand_in.py')!r})\n"
    code += f"from discover.batch import status, workers; status._PAGE_PAUSE = {pause}\n"
    code += f"workers._COMMAND = {worker_with_stand_in(folder)!r}\n"
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


def at_work(out):
    pids = set()
    for lock in out.glob(f"*/{LOCK_FILE}"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            pids.add(int(lock.read_text().split()[1]))
    return pids


def is_running(pid):
    with contextlib.suppress(OSError):
        os.kill(pid, 0)
        return True
    return False


@pytest.mark.slow
def test_workers_end_with_a_killed_command_and_leave_no_folder_locked(studies, calm, tmp_path):
    out = tmp_path / "out"
    arguments = ["batch", *map(str, studies), "--out", str(out), "--workers", "2", "--quiet"]
    process = subprocess.Popen(
        [*command(tmp_path), *arguments], env=os.environ | {"SECONDS_A_PART": "3"}
    )
    wait_for(lambda: len(at_work(out)) == 2)
    pids = at_work(out)
    process.kill()
    process.wait()
    wait_for(lambda: not any(map(is_running, pids)), 2.5)  # no part of a study is waited for
    batch.run_batch(studies, out)
    assert results(out) == calm


@pytest.mark.slow
def test_ctrl_c_ends_workers_at_once_without_a_word_of_theirs(studies, calm, tmp_path):
    out = tmp_path / "out"
    arguments = ["batch", *map(str, studies[::-1]), "--out", str(out), "--workers", "2"]
    process = subprocess.Popen(
        [*command(tmp_path, pause=0.1), *arguments],
        env=os.environ | {"SECONDS_A_PART": "3"},  # it is at work when the signal comes
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    table = out / "table.csv"
    wait_for(lambda: table.is_file() and "fails,compare,failed" in table.read_text())
    pids = at_work(out)
    assert process.pid not in pids
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does
    said, error = process.communicate(timeout=60)
    assert (said, process.returncode) == ("", 130)
    assert re.fullmatch(".*run the same command again.\n", error)
    wait_for(lambda: not any(map(is_running, pids)), 10)
    assert computed(tmp_path).total() < 18  # it had not ended
    batch.run_batch(studies, out)
    assert results(out) == calm
    assert max(computed(tmp_path).values()) == 1


@pytest.mark.slow
def test_a_killed_worker_loses_nothing_and_does_nothing_twice(studies, calm, tmp_path, monkeypatch):
    out, killed = tmp_path / "out", []
    monkeypatch.setenv("SECONDS_A_PART", "0.08")  # so that there is somebody to kill

    def kill_one():
        wait_for(lambda: computed(tmp_path).total() >= 1)
        while not killed:
            for pid in list(at_work(out) - {os.getpid()})[:1]:
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
            time.sleep(0.005)

    said = []
    thread = threading.Thread(target=kill_one, daemon=True)
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
    options = {"n_workers": 1, "threads_per_worker": 2, "processes": False}
    local = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": None}
    with distributed.LocalCluster(**options, **local) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tcp://127.0.0.1")
        result = batch.run_batch(studies, tmp_path / "out", scheduler=address)
    assert len(result.failed) == 1
    assert "no law fits" in result.failed[0].text
    assert results(tmp_path / "out") == calm


def listening(psutil, process):
    """The ports at which a process and those that it started wait for somebody."""
    found = []
    for one in [process, *process.children(recursive=True)]:
        with contextlib.suppress(psutil.Error):  # it has ended since
            found += [c for c in one.net_connections("inet") if c.status == psutil.CONN_LISTEN]
    return found


def looked_at(studies, out, workers):
    """The result of a batch, the most processes that it had started, and all ports seen open."""
    psutil = pytest.importorskip("psutil")
    counts, ports = [], []

    def look(label, fraction):
        children = psutil.Process().children()
        counts.append(sum(one.status() != psutil.STATUS_ZOMBIE for one in children))
        ports.extend(listening(psutil, psutil.Process()))

    result = batch.run_batch(studies, out, workers=workers, progress=look)
    with socket.create_server(("127.0.0.1", 0)):  # the control: a port would be seen
        assert len(listening(psutil, psutil.Process())) == 1
    return result, max(counts), ports


@pytest.fixture
def strange(tmp_path):
    """A study whose name is no UTF-8, and one that cannot be read."""
    odd, broken = (tmp_path / os.fsdecode(name) for name in (b"m\xe9lange.toml", b"\xff.toml"))
    odd.write_text(STUDY.format(0.04))
    broken.write_text("[data")
    return [odd, broken]


def test_a_name_that_is_no_utf_8_costs_none_and_one_worker_no_process(studies, strange, tmp_path):
    out = tmp_path / "out"
    result, started, ports = looked_at([*studies[:1], *strange], out, 1)
    assert [s.status for s in result.studies] == ["done", "done", "failed"]
    assert result.failed[0].input_error
    assert "m\\udce9lange" in (out / "index.html").read_text("utf-8")
    assert len((out / "table.csv").read_text("utf-8").splitlines()) == 4
    assert len(json.loads((out / "batch.json").read_text("utf-8"))["studies"]) == 3
    assert (started, ports) == (0, [])


def dying_workers(tmp_path, monkeypatch, deaths):
    """Let so many workers be killed while they start."""
    count = tmp_path / "starts.txt"
    count.touch()
    fatal = (
        "import os, signal\n"
        f"stream = open({str(count)!r}, 'a+'); stream.write('x'); stream.flush()\n"
        f"stream.seek(0); len(stream.read()) > {deaths} or os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    monkeypatch.setattr(workers, "_COMMAND", worker_with_stand_in(tmp_path, fatal))


def test_workers_open_no_port_and_may_die_at_start(studies, strange, calm, tmp_path, monkeypatch):
    dying_workers(tmp_path, monkeypatch, 1)
    result, started, ports = looked_at([*studies, *strange], tmp_path / "out", 2)
    assert [s.status for s in result.studies] == ["done"] * 3 + ["failed", "done", "failed"]
    assert [s.input_error for s in result.failed] == [False, True]
    assert (started, ports) == (2, [])
    found, table = results(tmp_path / "out"), calm.pop("table.csv")
    assert calm.items() <= found.items()
    assert set(table.splitlines()) <= set(found["table.csv"].splitlines())


def test_many_workers_killed_while_they_start_are_told(studies, tmp_path, monkeypatch):
    dying_workers(tmp_path, monkeypatch, 99)
    result = batch.run_batch(studies, tmp_path / "out", workers=2)
    assert [s.status for s in result.studies] == ["failed"] * 4
    assert all(s.text.startswith("Several workers died") for s in result.studies)


def test_a_study_that_kills_every_worker_is_given_up_alone(studies, tmp_path, monkeypatch):
    # as soon as it is handed the study, and of the first before the worker has imported anything
    fatal = (
        "import os, signal, sys\n"
        "from itertools import chain\n"
        "from types import SimpleNamespace\n"
        "def jobs(lines):\n"
        "    for job in lines:\n"
        "        b'two' in job and os.kill(os.getpid(), signal.SIGKILL)\n"
        "        yield job\n"
        "given = jobs(sys.stdin.buffer)\n"
        "sys.stdin = SimpleNamespace(buffer=chain([next(given)], given))\n"
    )
    monkeypatch.setattr(workers, "_COMMAND", worker_with_stand_in(tmp_path, fatal))
    result = batch.run_batch(studies[:2], tmp_path / "out", workers=2)
    assert [s.status for s in result.studies] == ["done", "failed"]
    assert result.studies[1].text.startswith("Several workers died")
    assert not result.studies[1].input_error


def test_nothing_that_lies_in_the_working_directory_is_run_by_a_worker(tmp_path, monkeypatch):
    sprung = tmp_path / "sprung"
    for name in ("multiprocessing.py", "jax.py", "pandas.py", "discover.py", "sitecustomize.py"):
        (tmp_path / name).write_text(f"open({str(sprung)!r}, 'w')\nraise SystemExit\n")
    (tmp_path / "a.toml").write_text("[data\n")
    monkeypatch.chdir(tmp_path)
    result = batch.run_batch([tmp_path / "a.toml"], tmp_path / "out", workers=2)
    assert result.studies[0].input_error  # the worker ran, and read the study
    assert not sprung.exists()
    # the control: this is how a child would have been caught
    subprocess.run([sys.executable, "-c", "import pandas"], cwd=tmp_path)
    assert sprung.exists()


def test_no_more_workers_start_than_there_are_studies(studies, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(batch, "run_in_workers", lambda jobs, n, *rest: asked.append(n))
    batch.run_batch(studies, tmp_path / "out", workers=1000)
    assert asked == [len(studies)]


def test_workers_without_the_same_files_are_told_from_those_that_have_them(tmp_path):
    class Future:
        def exception(self):
            return None

        def result(self):
            return batch.StudyStatus("a", "compare", "done", "found")

    job = ("a.toml", "a", "compare", str(tmp_path / "a"), None, False)
    status = workers._status_of(Future(), job)
    assert status.status == "failed"
    assert "one file system" in status.text


@pytest.mark.parametrize(
    ("address", "said"),
    [("tcp://10.0.0.1:8786", ""), ("tls://10.0.0.1:8786", "dask's settings distributed.comm.tls")],
)
def test_a_scheduler_that_does_not_answer_is_told(studies, tmp_path, monkeypatch, address, said):
    distributed = pytest.importorskip("distributed")

    def no_answer(address, timeout):
        raise OSError("Timed out")

    monkeypatch.setattr(distributed, "Client", no_answer)
    with pytest.raises(InputError, match=re.escape(address)) as caught:
        batch.run_batch(studies, tmp_path / "out", scheduler=address)
    assert said in str(caught.value)
