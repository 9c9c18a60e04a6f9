"""The page on a data folder: every test drawn, what it was taken for, a study that runs."""

import re
import tomllib

import numpy as np
import pytest
from command_line import invoke
from independent.folders import maxwell_sweep, write_table

from discover.cli.import_options import write_import_page
from discover.dataset import load_dataset
from discover.dataset.checking.folder import check_folder
from discover.report.data import data_page, first_study
from discover.study import parse_study
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model

OMEGA = np.geomspace(0.1, 100.0, 12)


def sweeps(folder):
    """Write a linear sweep, an amplitude sweep ten times too large, and a flow curve."""
    write_table(folder / "lve.csv", maxwell_sweep([100.0], [1.0], OMEGA))
    six = np.full(6, 500.0)
    columns = {"strain": np.geomspace(0.01, 1.0, 6), "omega_rad_s": np.ones(6)}
    columns |= {"Gp_Pa": six, "Gpp_Pa": six}
    write_table(folder / "amplitude_sweep.csv", columns)
    write_table(folder / "flow_curve.csv", {"shear_rate_1_s": OMEGA, "stress_Pa": 10.0 * OMEGA})
    return folder


def runs(folder):
    """Write three start-ups, one of whose names would be markup."""
    time = np.geomspace(0.01, 10.0, 30)
    names = ["slow.csv", "<b>fast.csv", "middle.csv"]
    for name, rate in zip(names, (0.1, 5.0, 1.0), strict=True):
        columns = {"time_s": time, "shear_rate_1_s": np.full(30, rate)}
        stress = 100.0 * rate * (1.0 - np.exp(-time))
        write_table(folder / name, columns | {"stress_Pa": stress})
    (folder / "runs.csv").write_text("file\n" + "\n".join(names) + "\n")
    return folder


def page_of(folder):
    return data_page(load_dataset(folder), check_folder(folder), str(folder))


def drawn(page):
    return re.findall(r'<figure id="(\w+)"', page)


@pytest.fixture
def show(tmp_path):
    """Return what shows a folder of sweeps, and where the page is to lie."""
    (tmp_path / "melt").mkdir()
    sweeps(tmp_path / "melt")
    out = tmp_path / "seen"
    return lambda **how: invoke("data", "show", tmp_path / "melt", "--out", out, **how), out


def test_every_test_is_drawn_and_named_and_markup_in_a_name_is_text(tmp_path):
    page = page_of(runs(sweeps(tmp_path)))
    assert drawn(page) == ["runs", "linear_sweep", "amplitude_sweep", "flow_curve"]
    for kind in ("start-up", "frequency sweep", "amplitude sweep", "flow curve"):
        assert f'<td class="text">{kind}</td>' in page
    assert "<b>fast" not in page
    assert not re.search(r'(src|href)="(?!#)', page)


def test_only_what_is_there_is_drawn_and_what_the_check_doubts_is_said(tmp_path):
    page = page_of(sweeps(tmp_path))
    assert drawn(page) == ["linear_sweep", "amplitude_sweep", "flow_curve"]
    # √2 · 500 Pa where the linear sweep has √2 · 50 Pa
    assert "is 10 times that of lve.csv" in page
    assert "nothing doubtful" not in page
    (tmp_path / "runs").mkdir()
    assert drawn(page_of(runs(tmp_path / "runs"))) == ["runs"]


@pytest.mark.parametrize("write", [sweeps, runs, lambda folder: runs(sweeps(folder))])
def test_the_study_to_start_from_loads_with_its_model(tmp_path, write):
    folder = write(tmp_path)
    text = first_study(load_dataset(folder), str(folder))
    study = parse_study(tomllib.loads(text))
    data = load_study_data(study)
    assert declared_model(study, data.dataset).modulus.size
    if (folder / "runs.csv").exists():
        # the fastest is the one that judges
        assert "<b>fast.csv" in data.held_out.names
    else:
        assert len(data.fit) == 3


def test_the_command_writes_page_and_study_says_where_and_keeps_what_is_somebody_s(tmp_path, show):
    (look, out), folder = show, tmp_path / "melt"
    shown = look(code=0)
    assert "amplitude sweep" in shown.output
    assert str(folder) in (out / "study.toml").read_text()
    assert not [path for path in folder.iterdir() if path.suffix != ".csv"]
    assert look().output == shown.output  # of its own it makes new ones
    assert sorted(path.name for path in out.iterdir()) == ["data.html", "study.toml"]
    (out / "study.toml").write_text("changed by hand")
    said = look(code=0)
    assert said.output.replace("\n", " ").count("is kept") == 1
    assert (out / "study.toml").read_text() == "changed by hand"

    (out / "data.html").write_text("written by hand")
    look(code=2)
    assert (out / "data.html").read_text() == "written by hand"


def test_an_import_ends_in_a_page_and_keeps_a_study_changed_by_hand(tmp_path):
    export = tmp_path / "export.csv"
    write_table(export, maxwell_sweep([100.0], [1.0], OMEGA))
    out = tmp_path / "melt"
    words = ["data", "import", export, "--out", out]
    said = invoke(*words, code=0)
    page = (out / "data.html").read_text()
    assert drawn(page) == ["linear_sweep"]
    # what the block was taken for, and why, as the command itself says
    assert "frequency sweep" in said.output
    assert "frequency sweep" in page
    load_study_data(parse_study(tomllib.loads((out / "study.toml").read_text())))
    assert not check_folder(str(out)).of("error")

    (out / "study.toml").write_text("changed by hand")
    (out / "data.html").unlink()
    invoke(*words, "--overwrite", "--no-page", code=0)
    assert not (out / "data.html").exists()
    invoke(*words, "--overwrite", code=0)
    assert (out / "data.html").exists()
    assert (out / "study.toml").read_text() == "changed by hand"


def test_a_folder_that_cannot_be_loaded_has_no_page(tmp_path):
    (tmp_path / "runs.csv").write_text("file\nlost.csv\n")
    findings = check_folder(str(tmp_path))
    assert findings.of("error")
    assert write_import_page(tmp_path, findings, []) is None
    assert [path.name for path in tmp_path.iterdir()] == ["runs.csv"]
