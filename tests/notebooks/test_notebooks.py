"""The notebooks run from top to bottom, and say what they are meant to show."""

from pathlib import Path

import pytest

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"


def executed_text(name):
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    notebook = jupytext.read(NOTEBOOKS / name)
    client = nbclient.NotebookClient(
        notebook, timeout=240, resources={"metadata": {"path": str(NOTEBOOKS)}}
    )
    client.execute()
    outputs = [o for cell in notebook.cells for o in cell.get("outputs", ())]
    assert any("image/png" in o.get("data", {}) for o in outputs)
    return "".join(o.get("text", "") for o in outputs)


def test_the_comparison_notebook_finds_the_giesekus_term():
    assert "sigma.sigma" in executed_text("compare.py")


def test_the_loop_notebook_finds_the_planted_effect():
    text = executed_text("closed_loop.py")
    assert "effects_added" in text
    assert "giesekus_mobility" in text


def test_the_identifiability_notebook_separates_the_twins():
    text = executed_text("identifiability.py")
    assert "tr(sigma)*gammadot" in text
    assert "Measure sigma12 and N2" in text
    assert "slip" in text
    assert "twin: probability 0, refuted" in text
