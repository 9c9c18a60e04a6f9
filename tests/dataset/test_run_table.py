"""Runs: what is refused, how they are shown, and which are repeats or copies of one record."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.noise import white

import discover as dc
from discover.dataset import Dataset, Finding, Findings, LinearSweep, Run
from discover.dataset.records.repeats import count_flows, is_copy, repeated_tests, require_no_copies
from discover.dataset.run_table import material_and_temperature, run_line
from discover.errors import InputError
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
    run = Run("a.csv", time, dc.start_up(1.0), np.ones(3), time, 2.0 * time)
    cut = run.window(run.time > 0.5)
    assert len(cut) == 2
    assert cut.protocol is run.protocol
    np.testing.assert_array_equal(cut.first_normal_stress_difference, [2.0, 4.0])


def titled(**metadata):
    pair = np.array([0.0, 1.0])
    return Run("r", pair, dc.start_up(1.0), np.ones(2), np.ones(2), metadata=metadata)


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
def test_titles_name_what_the_table_names_or_else_the_data(rows, otherwise, words):
    runs = [titled(**row) for row in rows]
    assert material_and_temperature(runs, otherwise=otherwise) == words


TIMES = np.linspace(0.05, 8.0, 60)


def record(name, rate=2.0, factor=1.0, noise=0.0, seed=0, times=TIMES, **metadata):
    exact = factor * Giesekus(0.3).respond(start_up(rate), times).sigma12
    stress = white(exact, noise, np.random.default_rng(seed))
    rates = np.full(len(times), rate)
    return dc.Run(name, times, dc.start_up(rate), rates, stress, metadata=metadata)


def test_a_repeated_test_is_told_whatever_its_loading_noise_and_end_and_another_history_is_none():
    other = record("b", factor=0.97, noise=0.02, times=TIMES[:-1] + 0.05)
    runs = [record("a", factor=1.03), other, record("c", 5.0)]
    assert repeated_tests(runs) == (("a", "b"),)
    early = record("b", factor=1.03, times=np.linspace(0.05, 1.0, 20))
    assert repeated_tests([record("a"), early]) == (("a", "b"),)
    # a start-up whose times were told in minutes ends before the wave has left its first rate
    short = replace(record("a"), time=TIMES / 60.0)
    assert repeated_tests([short, waving("wave", TIMES)]) == ()
    assert count_flows([short, waving("wave", TIMES)]) == 2
    first = record("a", n_points=60.0)
    assert repeated_tests([first, record("b", n_points=400.0)]) == (("a", "b"),)
    assert repeated_tests([first, replace(record("b"), strain_before=10.0)]) == ()
    assert repeated_tests([]) == ()


@pytest.mark.parametrize(
    "other",
    [{"rate": 2.1}, {"temperature_C": 170.0}, {"times": TIMES[:5]}, {"gap_mm": 1.0}],
    ids=["rate", "temperature", "few samples", "a condition of one alone"],
)
def test_another_test_is_no_repeat(other):
    first = record("a", temperature_C=160.0)
    second = record("b", **{"temperature_C": 160.0, **other})
    assert repeated_tests([first, second]) == ()


@pytest.mark.parametrize(
    "after",
    [
        lambda size: dc.after_step_strain(dc.start_up(0.0), size, first=TIMES[0]),
        lambda size: dc.after_steady_flow(dc.start_up(0.1), size, end=TIMES[-1]),
    ],
    ids=["step strain", "steady flow"],
)
def test_what_a_protocol_did_before_the_record_makes_another_test(after):
    sizes = enumerate((0.5, 2.0, 5.0, 5.0))
    runs = [replace(record(f"{i}", seed=i), protocol=after(size)) for i, size in sizes]
    assert count_flows(runs) == 3
    assert repeated_tests(runs) == (("2", "3"),)


def test_a_run_knows_the_steady_flow_that_its_protocol_begins_with_and_no_step_of_strain():
    def begun(protocol):
        return replace(record("a", rate=0.1), protocol=protocol).rate_before

    for before in (5.0, -0.02):
        after = dc.after_steady_flow(dc.start_up(0.1), before, end=TIMES[-1])
        assert begun(after) == pytest.approx(before)
    lasting = dc.after_step_strain(dc.start_up(0.0), 0.5, first=TIMES[0], duration=TIMES[0])
    assert (begun(dc.start_up(0.1)), begun(lasting)) == (0.0, 0.0)


def waving(name, times):
    rates = 2.0 * np.cos(times)
    stress = Giesekus(0.3).respond(oscillation(2.0, 1.0), times).sigma12
    return dc.Run(name, times, dc.protocols.oscillatory_shear(2.0, 1.0), rates, stress)


COPIED = np.linspace(0.1, 8.0, 80)


def noisy(seed=0, rate=2.0):
    return record("a.csv", rate, noise=0.01, seed=seed, times=COPIED)


def third(run):
    return run.window(np.arange(len(run)) % 3 == 0)


def test_a_record_is_a_copy_whatever_its_name_digits_and_samples_and_a_second_measurement_none():
    first = noisy()
    assert is_copy(first, replace(first, name="b.csv"))
    four_digits = np.array([float(f"{value:.4g}") for value in first.stress])
    assert is_copy(first, replace(first, name="b.csv", stress=four_digits))
    assert is_copy(first, third(first))
    told_at_another_rate = dc.Run("b.csv", COPIED, dc.start_up(2.2), first.rate * 1.1, first.stress)
    assert is_copy(told_at_another_rate, first)
    assert not is_copy(first, noisy(1))
    assert not is_copy(first, third(noisy(1)))
    assert not is_copy(first, noisy(0, 2.1))
    assert not is_copy(record("a.csv", 2.0), record("b.csv", 2.001))


def test_a_record_that_is_fitted_judges_nothing():
    first, other = noisy(), noisy(1)
    again = replace(first, name="b.csv")
    with pytest.raises(InputError, match=r"held-out run 'b.csv'.*'a.csv'.*proves nothing"):
        require_no_copies([first, other], [again])
    require_no_copies([first], [other])
