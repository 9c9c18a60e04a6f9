"""Pictures are drawn by settings of their own, whatever lies in the working directory."""

import os
import subprocess
import sys

import matplotlib as mpl
import pytest

from discover.report.mathtext import formula
from discover.report.plots.style import figure, picture

DRAW = """
from discover.report.plots import keep_out_of_the_working_directory
keep_out_of_the_working_directory()
from discover.report.mathtext import formula
from discover.report.plots.style import figure, picture
with figure(1, 1) as (drawing, axes):
    axes[0, 0].plot([1, 2, 3], label="a")
    axes[0, 0].legend()
    print(picture(drawing, "a", "b").svg)
print(formula(r"\\lambda\\dot\\gamma", "f"))
"""
LOUD = "lines.linewidth: 13\naxes.facecolor: red\nfont.size: 30\ntext.usetex: True\n"


def drawn():
    with figure(1, 1) as (drawing, axes):
        axes[0, 0].plot([1, 2, 3], label="a")
        axes[0, 0].legend()
        svg = picture(drawing, "a", "b").svg
    return svg, formula(r"\lambda\dot\gamma", "f")


def test_what_a_session_asked_matplotlib_for_is_not_on_a_page_and_stays_as_it_was():
    calm = drawn()
    asked = {"lines.linewidth": 13.0, "font.size": 30.0, "xtick.major.size": 20.0}
    with mpl.rc_context(asked):
        assert drawn() == calm
        assert {name: mpl.rcParams[name] for name in asked} == asked


@pytest.mark.parametrize("kind", ["loud", "broken", "pipe"])
def test_a_matplotlibrc_in_the_working_directory_changes_no_picture(tmp_path, kind):
    (tmp_path / "calm").mkdir()
    (tmp_path / "odd").mkdir()
    file = tmp_path / "odd" / "matplotlibrc"
    if kind == "pipe":
        os.mkfifo(file)
    else:
        file.write_bytes(LOUD.encode() if kind == "loud" else b"font.size: \xff\xfe\n")
    calm, odd = (
        subprocess.run(
            [sys.executable, "-P", "-c", DRAW],
            cwd=tmp_path / name,
            capture_output=True,
            timeout=60,
            check=True,
        ).stdout
        for name in ("calm", "odd")
    )
    assert len(calm) > 1000
    assert odd == calm
