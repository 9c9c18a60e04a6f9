"""Bad days of data folders: whatever a file holds, one clear message, never a traceback.

``tests/cli/test_malformed_inputs.py`` does the same to all that the command line reads.
"""

import os

import numpy as np
import pytest
from command_line import invoke
from harm import SANE
from made_exports import write_files

from discover.dataset import check_folder, load_dataset
from discover.errors import InputError
from discover.study import fingerprint, read_study
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model

FOLDER = SANE["FOLDER"]
RUN = FOLDER["a.csv"]
LAOS = "time_ms,strain,stress_kPa\n" + "".join(
    f"{i},{np.sin(0.3 * i):.6f},{np.cos(0.3 * i - 0.3):.6f}\n" for i in range(24)
)
FILES = FOLDER | {
    "b.csv": LAOS,
    "study.toml": """[data]
folder = "."
fit = ["a.csv"]
held_out = ["b.csv"]
clock_factor = "factor"
[model]
law = "giesekus"
modulus_Pa = "fit"
relaxation_time_s = 1.0
parameters = { alpha = 0.3 }
known_relaxation = true
[loop]
max_effects = 3
strain = [0.02, 25]
noise = 0.01
[compare]
learners = ["tensor_sindy", "tbnn_ude"]
library = { degree = 1, closed_forms = ["exp"] }
test = "paper"
seed = 0
high_deborah = [1.5]
""",
}


def write(root, changes=None):
    return write_files(root, {**FILES, **(changes or {})})


def use(root) -> str | None:
    """Do all that a command does before it simulates; return the message, if there is one."""
    try:
        study = read_study(root / "study.toml")
        fingerprint(study, "task", 0)
        data = load_study_data(study)
        declared_model(study, data.dataset)
    except InputError as error:
        return str(error)
    return None


HEADER = "time_s,shear_rate_1_s,stress_Pa\n"
BY_HAND = {
    "units row": (HEADER + "s,1/s,Pa\n0,1,1\n", "row of units"),
    "semicolons": (HEADER.replace(",", ";") + "0;1;1\n", "semicolons"),
    "tabs": (HEADER.replace(",", "\t") + "0\t1\t1\n", "tabs"),
    "decimal commas": (HEADER + '"0,5",1,1\n', "decimal points"),
    "decimal commas unquoted": (HEADER + "0,5,1,0,1,0\n", "decimal points"),
    "no header": ("0,1,1\n1,1,1\n", "begins with numbers on line 1"),
    "header only": (HEADER, "no rows"),
    "duplicate columns": ("time_s,time_s,stress_Pa\n0,1,1\n", "two columns named time_s"),
    "unnamed column": ("time_s,,stress_Pa\n0,1,1\n", "Column 2"),
    "binary": (b"PK\x03\x04\x00\x00" + bytes(range(256)), "zero byte"),
    "latin-1": (HEADER.encode() + b"0,1,1\n1,1,\xb5\n", "line 3 holds the byte 0xb5"),
    "UTF-16": ((HEADER + "0,1,1\n").encode("utf-16"), "UTF-16"),
    "gap": (HEADER + "0,1,1\n1,1,\n2,1,1\n", "line 3 holds nothing"),
    "gigantic": (HEADER + "0,1,1\n1,1,1e300\n", "more than any measurement"),
    "overflow": (HEADER + "0,1,1\n1,1,1e999\n", "beyond what a computer"),
    "blank lines count": (HEADER + "\n\n0,1,1\n\n1,1,x\n", "line 6 holds x"),
    "repeated time": (HEADER + "0,1,1\n1,1,1\n1,1,2\n", "line 4 holds 1 s after 1 s"),
    "falling time": (HEADER + "0,1,1\n2,1,1\n1,1,2\n", "increase strictly"),
    "negative time": (HEADER + "-1,1,1\n2,1,1\n", "start at or after 0"),
    "opposite sign": (HEADER + "0,1,0\n1,1,-1\n2,1,-2\n", "opposite to the shear rate"),
    "unknown unit": ("time_blorp,shear_rate_1_s,stress_Pa\n0,1,1\n", "ends in no unit"),
    "unit of something else": ("time_Pa,shear_rate_1_s,stress_Pa\n0,1,1\n", "not a unit of time"),
    "capitals": ("Time_s,shear_rate_1_s,stress_Pa\n0,1,1\n", "case-sensitive"),
    "brackets": ("time [s],shear_rate_1_s,stress_Pa\n0,1,1\n", "Rename time [s] to time_s"),
    "quote left open": (HEADER + '0,1,"1\n', "Fix the quotes"),
    "one sample of strain": ("time_s,strain,stress_Pa\n0,1,1\n", "1 sample of strain"),
    "empty": ("", "a.csv is empty"),
    "no stress": ("time_s,shear_rate_1_s\n0,1\n", "no column stress_Pa"),
    "no rate": ("time_s,stress_Pa\n0,1\n", "no column shear_rate_1_s"),
    "two stresses": ("time_s,shear_rate_1_s,stress_Pa,stress_kPa\n0,1,1,1\n", "Keep one"),
    "code": (HEADER + "0,1,1\n1,1,__import__('os')\n", "__import__"),
    "more cells": (HEADER + "0,1,1\n1,1,1,1,1\n", "not a comma-separated"),
    "nan": (HEADER + "0,1,1\n1,1,nan\n", "line 3 holds nan"),
}
OTHERS = {
    "runs.csv": [
        ("name\na.csv\n", "no column 'file'"),
        ("file\n", "no rows"),
        ("", "is empty"),
        ("file\n../a.csv\n", "outside the folder"),
        ("file\n/etc/passwd\n", "outside the folder"),
        ("file\na.csv\na.csv\n", "names a.csv twice"),
        ("file,factor\nmissing.csv,2\n", "no file missing.csv"),
    ],
    "flow_curve.csv": [
        ("shear_rate_1_s,stress_Pa\n0,1\n1,2\n", "must be positive; line 2 holds 0"),
        ("shear_rate_1_s\n1\n", "no column stress_Pa"),
    ],
    "creep.csv": [
        ("time_s,compliance_1_Pa\n1,1\n1,2\n3,4\n", "increase strictly"),
        ("time_s,compliance_1_Pa\n1,1\n2,-2\n3,4\n", "must be positive; line 3"),
    ],
    "relaxation.csv": [
        ("time_s,relaxation_modulus_Pa\n", "relaxation.csv has a header but no rows")
    ],
    "amplitude_sweep.csv": [("strain,omega_rad_s,Gp_Pa,Gpp_Pa\n0,1,1,1\n", "must be positive")],
    "lve.csv": [
        ("omega_rad_s,Gp_Pa,Gpp_Pa\n1,-5,5\n", "Gp_Pa in lve.csv must be positive"),
        ("omega_rad_s,Gp_Pa\n1,5\n", "no column Gpp_Pa"),
    ],
}
BROUGHT = [("a.csv", *case) for case in BY_HAND.values()]
BROUGHT += [(name, *case) for name, cases in OTHERS.items() for case in cases]


@pytest.mark.parametrize(("name", "content", "words"), BROUGHT)
def test_what_users_bring_is_refused_with_file_place_and_remedy(tmp_path, name, content, words):
    write(tmp_path, {name: content})
    message = use(tmp_path)
    assert words in message
    assert any(file in message for file in (name, "missing.csv"))
    assert words in invoke("data", "check", tmp_path, code=2).output


@pytest.mark.parametrize(
    "content",
    [
        "\ufeff" + RUN,
        RUN.replace("\n", "\r\n"),
        RUN.replace("\n", "\n\n"),
        RUN.replace(",", " , "),
        RUN.rstrip("\n"),
    ],
    ids=["BOM", "CRLF", "blank lines", "spaces", "no last line end"],
)
def test_harmless_habits_of_editors_change_nothing(tmp_path, content):
    write(tmp_path)
    wanted = load_dataset(tmp_path)["a.csv"]
    write(tmp_path, {"a.csv": content, "study.toml": "\ufeff" + FILES["study.toml"]})
    assert use(tmp_path) is None
    run = load_dataset(tmp_path)["a.csv"]
    np.testing.assert_array_equal(run.stress, wanted.stress)
    np.testing.assert_array_equal(run.time, wanted.time)


def test_labels_stay_labels_and_numbers_become_numbers(tmp_path):
    write(tmp_path, {"runs.csv": "file,a,b,c,d\na.csv,1_2,nan,-1.5e3,\n"})
    metadata = load_dataset(tmp_path)["a.csv"].metadata
    assert [metadata[key] for key in "abcd"] == ["1_2", "nan", -1500.0, ""]


def test_links_out_of_the_folder_are_refused_and_links_within_followed(tmp_path):
    inside, outside = tmp_path / "in", tmp_path / "out"
    inside.mkdir()
    outside.mkdir()
    write(inside)
    (outside / "secret.csv").write_text(RUN)
    (inside / "a.csv").unlink()
    (inside / "a.csv").symlink_to(outside / "secret.csv")
    assert "outside the folder" in str(use(inside))
    (inside / "a.csv").unlink()
    (inside / "real").write_text(RUN)
    (inside / "a.csv").symlink_to("real")
    assert use(inside) is None
    (inside / "a.csv").unlink()
    (inside / "a.csv").symlink_to("a.csv")  # to itself
    assert "a.csv" in str(use(inside))
    (inside / "a.csv").unlink()
    write(inside)
    (inside / "lve.csv").unlink()
    (inside / "lve.csv").symlink_to(outside / "secret.csv")
    assert "lve.csv is a link to outside" in str(use(inside))
    (inside / "lve.csv").unlink()
    (outside / "diary.md").write_text("mine")
    (inside / "PROVENANCE.md").symlink_to(outside / "diary.md")
    assert load_dataset(inside).provenance == ""


def test_folders_pipes_and_forbidden_files_are_refused_without_waiting(tmp_path, monkeypatch):
    write(tmp_path)
    (tmp_path / "a.csv").unlink()
    (tmp_path / "a.csv").mkdir()
    assert "a.csv is a folder" in str(use(tmp_path))
    (tmp_path / "a.csv").rmdir()
    os.mkfifo(tmp_path / "a.csv")  # reading it would wait for ever
    assert "pipe or device" in str(use(tmp_path))
    (tmp_path / "a.csv").unlink()
    write(tmp_path)
    opened = os.open

    def forbidden(path, *more, **how):
        if str(path).startswith(str(tmp_path)):
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *more, **how)

    monkeypatch.setattr(os, "open", forbidden)  # the tests may run as root
    message = str(use(tmp_path))
    assert "Permission denied" in message
    assert "study.toml" in message


def test_a_long_record_is_thinned_with_a_word_and_its_samples_are_the_recorded_ones(tmp_path):
    n = 60_000
    times = np.linspace(0, 100, n)
    generator = np.random.default_rng(0)
    stress = 1 - np.exp(-times) + 3 * times * np.exp(-5 * times)
    noisy = stress + 1e-3 * generator.standard_normal(n)
    rows = [f"{t:.7f},1,{s:.9f}" for t, s in zip(times, noisy, strict=True)]
    write(tmp_path, {"a.csv": HEADER + "\n".join(rows)})
    run = load_dataset(tmp_path)["a.csv"]
    assert 10_000 < len(run) <= 20_000
    assert f"of {n:,} samples" in str(run.metadata["thinned"])
    assert run.time[-1] == pytest.approx(100.0)
    # the overshoot's height and the early decades are kept
    assert np.max(run.stress) == pytest.approx(np.max(noisy), abs=1e-8)
    assert np.sum(run.time < 0.05) > 0.9 * np.sum(times < 0.05)
    # noise is neither smoothed nor selected: its size stays within sampling error, 3 / sqrt(2 n)
    expected = np.interp(run.time, times, stress)
    assert np.std(run.stress - expected) == pytest.approx(1e-3, rel=3 / np.sqrt(2 * len(run)))
    findings = [f for f in check_folder(tmp_path) if f.file == "a.csv"]
    assert any("half evenly in log time" in f.text for f in findings if f.severity == "note")
    assert "thinned" not in load_dataset(tmp_path)["b.csv"].metadata
