"""Runs and findings: what is refused, and how notebooks, terminals and titles show them."""

from dataclasses import replace

import numpy as np
import pytest

from discover.dataset import Dataset, Finding, Findings, LinearSweep, Run
from discover.dataset.run_table import material_and_temperature, run_line
from discover.protocols import start_up
from discover.protocols.protocol import measured_rate

TIME = np.linspace(0.0, 10.0, 201)
ONES = np.ones(201)


def run(rate, **more):
    return Run("a.csv", TIME, measured_rate(TIME, rate), rate, 3.0 * ONES, **more)


@pytest.mark.parametrize(
    ("rate", "before", "flow"),
    [
        (2.0 * ONES, 0.0, "start-up"),
        (2.0 * ONES, 1.0, "step of rate"),
        (0.0 * ONES, 1.0, "cessation"),
        (0.0 * ONES, 0.0, "rest"),
        (np.where(TIME < 5.0, 2.0, 1.0), 0.0, "steps of rate"),
        (TIME, 0.0, "varying rate"),
        (2.0 * np.cos(3.0 * TIME), 0.0, "oscillation"),
        (np.cos(3.0 * TIME) + 0.3 * np.cos(9.0 * TIME), 0.0, "oscillation"),
        (np.sign(np.cos(3.0 * TIME)), 0.0, "steps of rate"),
        (1.0 + 2.0 * np.cos(3.0 * TIME), 0.0, "varying rate"),
        (np.random.default_rng(0).normal(size=201), 0.0, "varying rate"),
    ],
)
def test_a_flow_is_called_by_its_name(rate, before, flow):
    line = run_line(run(rate, rate_before=before))
    assert line["flow"] == flow
    assert (line["frequency_rad_s"] is None) is (flow != "oscillation")


def test_amplitude_and_frequency_are_read_off_a_noisy_rate_and_one_sample_has_a_line():
    noise = 0.1 * np.random.default_rng(1).normal(size=201)
    line = run_line(run(6.0 * np.cos(3.0 * TIME + 1.0) + noise))
    assert line["frequency_rad_s"] == pytest.approx(3.0, rel=0.002)
    assert line["strain_amplitude"] == pytest.approx(2.0, rel=0.02)
    assert line["largest_rate_1_s"] == pytest.approx(6.0, rel=0.1)
    assert (line["samples"], line["duration_s"], line["largest_stress_Pa"]) == (201, 10.0, 3.0)
    one = np.ones(1)
    line = run_line(Run("a", 0.0 * one, measured_rate([0.0], [1.0]), one, one))
    assert (line["flow"], line["samples"]) == ("start-up", 1)


def test_a_data_set_shows_its_runs_with_units_and_escapes_their_names():
    wave = replace(run(2.0 * np.cos(TIME)), name="<b>.csv", first_normal_stress_difference=ONES)
    sweep = LinearSweep(np.ones(1), np.ones(1), np.ones(1))
    shown = Dataset("gel", (wave,), sweep, "from <there>")._repr_html_()
    for text in ("a linear sweep of 1 points", "&lt;there&gt;", "&lt;b&gt;.csv", "oscillation"):
        assert text in shown
    for column in ("samples", "duration_s", "largest_rate_1_s", "frequency_rad_s"):
        assert f"<th>{column}</th>" in shown
    assert "<b>" not in shown
    # nothing oscillates: no column for it
    assert "frequency_rad_s" not in Dataset("x", (run(ONES),))._repr_html_()
    assert "N2" not in shown
    assert "measured" in shown
    assert "no linear sweep" in Dataset("x", ())._repr_html_()


def test_findings_show_whole_sentences_and_a_window_cuts_samples_and_keeps_the_flow():
    text = "The column <x> in a.csv " + "is not used, " * 20 + "at all."
    findings = Findings([Finding("warning", "columns", "a.csv", text)])
    shown = findings._repr_html_()
    assert text.replace("<x>", "&lt;x&gt;") in shown
    assert "0 errors, 1 warning, 0 notes." in shown
    assert findings == (findings[0],)
    assert Findings() == ()
    assert Findings()._repr_html_() == "<p>Nothing wrong was found.</p>"
    time = np.array([0.0, 1.0, 2.0])
    run = Run("a.csv", time, start_up(1.0), np.ones(3), time, 2.0 * time)
    cut = run.window(run.time > 0.5)
    assert len(cut) == 2
    assert cut.protocol is run.protocol
    np.testing.assert_array_equal(cut.first_normal_stress_difference, [2.0, 4.0])


def titled(**metadata):
    pair = np.array([0.0, 1.0])
    return Run("r", pair, start_up(1.0), np.ones(2), np.ones(2), metadata=metadata)


WARM = {"temperature_C": 20.0}


@pytest.mark.parametrize(
    ("rows", "otherwise", "words"),
    [
        ([{}], "", ""),
        ([WARM, WARM], "", "20 °C"),
        ([{"sample": "LDPE", **WARM}], "", "LDPE, 20 °C"),
        ([{"temperature_C_measured": t} for t in (-10.005, -23.01)], "", "−23 and −10 °C"),
        ([{"temperature_C": t} for t in (20.0, 40.0, 60.0)], "", "20 to 60 °C"),
        ([{"material": name} for name in ("gel", "gel", "melt")], "", "gel, melt"),
        ([WARM], "melt-7", "melt-7, 20 °C"),
        ([{"sample": "LDPE"}, WARM], "melt-7", "LDPE, 20 °C"),
        ([*({"sample": name} for name in ("a1", "a2", "a3")), WARM], "melt-7", "melt-7, 20 °C"),
    ],
)
def test_titles_name_what_the_table_names_or_the_data_where_it_names_none_or_many(
    rows, otherwise, words
):
    runs = [titled(**row) for row in rows]
    assert material_and_temperature(runs, otherwise=otherwise) == words
