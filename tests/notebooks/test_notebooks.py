"""The notebooks run from top to bottom, and say what they are meant to show."""

import os
import re
import runpy
from pathlib import Path

import jax
import pytest

NOTEBOOKS = Path(__file__).parents[2] / "notebooks"
NAMES = sorted(path.stem for path in NOTEBOOKS.glob("*.py"))


def executed_text(name, monkeypatch):
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    # what one notebook or another test compiled, the next need not compile again
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", jax.config.jax_compilation_cache_dir or "")
    notebook = jupytext.read(NOTEBOOKS / f"{name}.py")
    client = nbclient.NotebookClient(
        notebook, timeout=240, resources={"metadata": {"path": str(NOTEBOOKS)}}
    )
    client.execute()
    outputs = [o for cell in notebook.cells for o in cell.get("outputs", ())]
    data = [o.get("data", {}) for o in outputs]
    assert any("image/png" in d for d in data)
    shown = [d.get("text/html", d.get("text/plain", "")) for d in data]
    return "".join([o.get("text", "") for o in outputs] + shown)


@pytest.mark.slow
def test_the_comparison_notebook_finds_the_giesekus_term(monkeypatch):
    text = executed_text("compare", monkeypatch)
    assert "<td>sigma.sigma</td>" in text
    assert r"\boldsymbol{\sigma} \cdot \boldsymbol{\sigma}" in text


@pytest.mark.slow
def test_the_loop_notebook_finds_what_was_planted_and_what_a_melt_lacks(monkeypatch):
    text = executed_text("closed_loop", monkeypatch)
    assert "effects_added" in text
    assert "<td>giesekus_mobility</td>" in text
    if os.environ.get("DISCOVER_DATA"):
        # either is the other's alias
        assert re.search(r"<td>(rate_rise_time|transducer_lag)</td>", text.split("laboratory:")[1])
    else:
        assert "Skipped: " in text


@pytest.mark.slow
def test_the_identifiability_notebook_separates_the_twins(monkeypatch):
    text = executed_text("identifiability", monkeypatch)
    assert "tr(sigma)*gammadot" in text
    (apart,) = re.findall(r"N2 differs by (\d+)% of N1", text)
    # N2 = −(ξ/2) N1 of one law with ξ = 0.4, and zero of the other
    assert 19 <= int(apart) <= 21


@pytest.mark.slow
def test_the_model_selection_notebook_loses_the_law_in_the_noise(monkeypatch):
    text = executed_text("model_selection", monkeypatch)
    fates = re.findall(r"<td>(chosen|a rival|ruled out)</td>", text)
    assert fates[:2] == ["chosen", "chosen"]
    assert fates[-1] == "a rival"
    assert "N2 is not determined by σ12" in text


@pytest.mark.slow
def test_the_batch_notebook_goes_on_after_a_stop_and_lists_the_failure(monkeypatch):
    text = executed_text("batch", monkeypatch)
    second = text.split("stopped")[1].split("complete noise_01")[1]
    assert re.search(r"failed   mobility: .*the parameter 'alpha'", second)
    assert "done     noise_50" in second
    assert "<td>giesekus_mobility</td>" in second


@pytest.mark.measured
@pytest.mark.slow
def test_the_measured_notebook_goes_round_the_circle(measured_data, monkeypatch):
    del measured_data  # only whether it is there
    text = executed_text("measured", monkeypatch)
    # the rate comes up late, as the whole set says too (docs/findings.md: 20.8 to 23.5 ms)
    tau = re.search(r"'rate_rise_time': \{'tau': ([\d.]+)\}", text)
    assert 0.018 < float(tau.group(1)) < 0.026
    # no law that was tried explains these runs, and σ12 does not say N2
    assert re.search(r"unexplained \| not determined: .*N2", text)


@pytest.mark.parametrize("name", NAMES)
def test_the_notebook_with_outputs_is_the_source_as_executed(name):
    jupytext = pytest.importorskip("jupytext")
    source = jupytext.read(NOTEBOOKS / f"{name}.py").cells
    executed = jupytext.read(NOTEBOOKS / f"{name}.ipynb").cells
    assert [c.source for c in executed] == [c.source for c in source]
    codes = [c for c in executed if c.cell_type == "code"]
    assert any(c.outputs for c in codes)
    assert not [o for c in codes for o in c.outputs if o.output_type == "error"]
    # one that was run elsewhere does not say where
    said = re.sub(r'"image/png": "[^"]*"', "", (NOTEBOOKS / f"{name}.ipynb").read_text("utf-8"))
    assert not re.findall(r"/(?:home|Users|work|root|tmp)/", said)


def test_the_full_stress_notebook_gets_one_mobility_where_components_are_tied(monkeypatch):
    monkeypatch.setattr("matplotlib.pyplot.show", lambda: None)
    names = runpy.run_path(str(NOTEBOOKS / "full_stress.py"))  # a script too, without a kernel
    place = names["KEPT"].index("sigma.sigma")
    production, *bounded = names["numbers"]
    # 0.3 planted; noise of 0.5 % in 3,600 samples leaves 0.001
    for found in (bounded[place], names["stacked"].coef_[0][place]):
        assert found == pytest.approx(-0.3, abs=0.01)
    assert production == pytest.approx(1.0, abs=0.01)
