"""Public data sets: fetched by the user's installer, checked by hash, never part of the project."""

import hashlib
import os
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from discover.cli import app
from discover.dataset import fetching, load_dataset
from discover.dataset.fetching import CATALOGUE, download_with_pip

HEADER = "gdot={rate};Mw=94;T=-35;label=made up;WeR={wi_r};WeD={wi_d};\r\n"
NAMES = "time\tIt(t)\tN1\tRate\tTemp\r\ns\tPa\tPa\ts-1\tC\r\n"


def made_up(rate, measured):
    time = np.linspace(0.0, 2.0, 12)
    rows = (
        f" {t:.15E}  {rate * t:.15E}  {t**2:.15E}  {measured:.15E}  {-10 + 0.01 * i:.15E}\t\r\n"
        for i, t in enumerate(time)
    )
    head = HEADER.format(rate=rate, wi_r=rate / 10, wi_d=rate * 10)
    return (head + NAMES + "".join(rows)).encode()


FILES = {
    "data/PI/shear/slow.shear": made_up(0.5, 1.0),
    "data/PI/shear/fast.shear": made_up(2.0, 4.0),
    "data/PI/sweep.tts": b"C1=8;T=-35;\r\n 2 20 30 -9\r\n 1 10 15 -8\r\n 4 40 60 1\r\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with made-up files, and a catalogue that knows its hash."""
    path = tmp_path / "made_up-1.0-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in FILES.items():
            archive.writestr(f"made_up-1.0.data/data/{name}", content)
        archive.writestr("made_up-1.0.dist-info/LICENSE", "the licence")
    known = {"sha256": hashlib.sha256(path.read_bytes()).hexdigest(), "files": tuple(FILES)}
    entry = replace(CATALOGUE["polyisoprene"], package="made-up", version="1.0", **known)
    monkeypatch.setitem(fetching.CATALOGUE, "polyisoprene", entry)
    return path


def invoke(*arguments):
    return CliRunner().invoke(app, ["data", "fetch", *(str(a) for a in arguments)])


def test_a_set_is_fetched_by_the_installer_and_loads(package, tmp_path, monkeypatch):
    def pip(command, **options):
        assert command[1:5] == ["-P", "-m", "pip", "download"]  # no pip.py lying about
        assert command[-1] == "made-up==1.0"
        folder = command[command.index("--dest") + 1]
        package.rename(f"{folder}/{package.name}")
        return subprocess.CompletedProcess(command, 0, "", "")

    monkeypatch.setattr("discover.dataset.fetching.subprocess.run", pip)
    done = invoke("polyisoprene", "--accept-licence", "--out", tmp_path / "pi")
    assert done.exit_code == 0, done.output
    dataset = load_dataset(tmp_path / "pi", clock_factor="time_factor")
    assert dataset.names == ("pi_Tm10_rate1.csv", "pi_Tm10_rate4.csv")
    fast = dataset.runs[1]
    np.testing.assert_allclose(fast.rate, 2.0)
    np.testing.assert_allclose(fast.stress[-1], 4.0)
    sweep = dataset.linear_sweep
    np.testing.assert_array_equal(sweep.angular_frequency, [1.0, 2.0, 4.0])
    assert (tmp_path / "pi" / "LICENSE").read_text() == "the licence"
    assert "Auhl" in (tmp_path / "pi" / "PROVENANCE.md").read_text()
    again = invoke("polyisoprene", "--accept-licence", "--out", tmp_path / "pi")
    assert again.exit_code == 2
    assert "--overwrite" in again.stderr


def test_nothing_is_fetched_before_the_licence_is_accepted(tmp_path, monkeypatch):
    def pip(*_, **__):
        raise AssertionError("asked for")

    monkeypatch.setattr("discover.dataset.fetching.subprocess.run", pip)
    done = invoke("polyisoprene", "--out", tmp_path / "pi")
    assert done.exit_code == 2
    assert "GNU General Public License" in done.stdout
    assert "--accept-licence" in done.stderr
    assert not (tmp_path / "pi").exists()


@pytest.mark.parametrize("case", ["other file", "bomb", "no zip", "absent", "pipe", "folder"])
def test_what_is_not_the_known_package_is_refused_before_it_is_unpacked(package, tmp_path, case):
    other = tmp_path / "other.whl"
    if case == "no zip":
        other.write_text("no archive")
    elif case == "pipe":
        os.mkfifo(other)  # reading it would wait for ever
    elif case == "folder":
        other.mkdir()
    elif case != "absent":
        more = b" " if case == "other file" else bytes(30_000_000)
        with zipfile.ZipFile(other, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in FILES.items():
                archive.writestr(f"made_up-1.0.data/data/{name}", content + more)
    done = invoke("polyisoprene", "--accept-licence", "--from", other, "--out", tmp_path / "pi")
    assert done.exit_code == 2
    if case in ("other file", "bomb", "no zip"):
        assert "is not the wheel of made-up 1.0 that is known (SHA-256 differs)" in done.stderr
    assert list((tmp_path / "pi").iterdir()) == []


def test_an_installer_that_fails_says_what_it_said_last(tmp_path, monkeypatch):
    def pip(command, **options):
        return subprocess.CompletedProcess(command, 1, "", "first\nERROR: no such package\n")

    monkeypatch.setattr("discover.dataset.fetching.subprocess.run", pip)
    with pytest.raises(OSError, match=r"no such package.*--from"):
        download_with_pip("made-up", "1.0", tmp_path)
    assert invoke("polyisoprene", "--accept-licence", "--out", tmp_path / "pi").exit_code == 1


def test_an_unknown_set_is_refused(tmp_path):
    assert "Write polyisoprene" in invoke("nobody", "--out", tmp_path / "x").stderr
