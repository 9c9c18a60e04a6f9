"""Comparisons of measured data: each set ends with exit 0, a whole page and a verdict.

All five sets, whole, are compared by `benchmarks/measured.py`, which asks the same.
"""

import json
from pathlib import Path

import pytest
from measured import what_is_missing
from typer.testing import CliRunner

from discover.cli import app

pytestmark = pytest.mark.measured

SWEEP = 'law = "ucm"\nmodes = "lve"'
ONE_MODE = 'law = "ucm"\nmodulus_Pa = {}\nrelaxation_time_s = {}'

# data set: runs fitted, runs held out, one row kept of so many, other data options, model: one set
# with a spectrum from its sweep, one of a single mode
SETS = {
    "gel-laos": (
        ["gel_laos_1rads_1000Pa.csv", "gel_laos_1rads_4000Pa.csv"],
        ["gel_laos_1rads_3000Pa.csv"],
        50,
        'rate = "measured"',
        f"{SWEEP}\nsweep_rad_s = [0.1, 16.0]",
    ),
    "cpycl-laos": (
        ["cpycl_laos_0.3rads_3.16.csv"],
        [],
        6,
        "",
        ONE_MODE.format(10.0, 1.0),
    ),
}


def stand_in(source: Path, folder: Path, runs, every: int) -> None:
    """Copy some runs with one row of `every`; a run that the study does not name stays away."""
    folder.mkdir()
    lines = (source / "runs.csv").read_text("utf-8").splitlines()
    kept = [lines[0], *(line for line in lines[1:] if line.split(",")[0] in runs)]
    (folder / "runs.csv").write_text("\n".join(kept) + "\n")
    for name in runs:
        rows = (source / name).read_text("utf-8").splitlines()
        (folder / name).write_text("\n".join([rows[0], *rows[1::every]]) + "\n")
    if (source / "lve.csv").is_file():
        (folder / "lve.csv").write_bytes((source / "lve.csv").read_bytes())


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_a_comparison_of_measured_data_ends_with_a_verdict(name, measured_data, tmp_path):
    fit, held_out, every, options, model = SETS[name]
    stand_in(measured_data / name, tmp_path / name, [*fit, *held_out], every)
    study = tmp_path / "study.toml"
    study.write_text(
        f'[data]\nfolder = "{name}"\nheld_out = {held_out}\n{options}\n[model]\n{model}\n'
        '[compare]\nlearners = ["tensor_sindy"]\nlibrary = { degree = 0 }\nmax_terms = 2\n'
        'next = { flows = ["start_up"] }\n'
    )
    out = tmp_path / "out"
    ended = CliRunner().invoke(app, ["compare", str(study), "--out", str(out)])
    assert ended.exit_code == 0, ended.output
    assert not what_is_missing(out)
    content = json.loads((out / "comparison.json").read_text("utf-8"))
    assert content["verdict"].replace("_", " ") in ended.output.lower()
