"""Words say which test an export is before its numbers are asked; numbers where no word does."""

import numpy as np
import pytest
from made_exports import LAMBDA, TIMES, G, exported, imported, lines, table

from discover.dataset import check_folder, load_dataset

CREEP = 0.2 + 0.1 * TIMES
RECOVERY = CREEP[-1] - 0.2 * (1 - np.exp(-TIMES))
RATE = 0.1 + 0.4 * np.exp(-2.0 * TIMES)
"""Of a creep whose strain is 0.1 t + 0.2 (1 - exp(-2 t))."""
STARTED = 30.0 * (1 - np.exp(-TIMES / LAMBDA))
RELAXED = 0.1 * G * np.exp(-TIMES / LAMBDA)
UP = np.linspace(5.0, 100.0, 20)
THERE_AND_BACK = np.concatenate([UP, UP[::-1]])
EVERY_3_S = 3.0 * np.arange(1, 41)


def export(tmp_path, columns, *above, code=0, name="a.csv", options=()):
    head = [*above, ",".join(columns)]
    return exported(tmp_path, head, *columns.values(), options=options, code=code, name=name)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_creep_that_is_exported_with_its_rate_is_a_run_at_given_stress(tmp_path, noise):
    scatter = 1.0 + noise * np.random.default_rng(2).standard_normal(30)
    out, result = export(
        tmp_path, {"Time [s]": TIMES, "Stress [Pa]": 50.0, "Shear rate [1/s]": RATE * scatter}
    )
    (test,) = load_dataset(out)
    assert test.protocol.control == "stress"
    assert "integral of the rate" in result.stdout
    strain = 0.1 * TIMES + 0.2 * (1 - np.exp(-2.0 * TIMES))
    # thirty samples over three decades: what lies between them is known to some per cent
    np.testing.assert_allclose(test.recorded, strain, rtol=0.03)


@pytest.mark.parametrize("which", ["rate", "noisy rate", "noisy stress"])
def test_a_flow_at_a_given_rate_whose_stress_is_constant_stays_one(tmp_path, which):
    scatter = np.random.default_rng(5).standard_normal(30)
    rate = 0.5 * (1 + 0.05 * scatter) if which == "noisy rate" else 0.5
    stress = 50.0 * (1 + 0.005 * scatter) if which != "rate" else STARTED
    out, _ = export(tmp_path, {"Time [s]": TIMES, "Stress [Pa]": stress, "Shear rate [1/s]": rate})
    assert load_dataset(out)[0].protocol.control == "rate"


@pytest.mark.parametrize(
    ("moved", "starts", "title"),
    [
        ("strain", 0.0, ["Creep and recovery"]), ("rate", 0.0, ["Creep and recovery"]),
        ("strain", 0.0, []), ("strain", 10.0, []),
    ],
)  # fmt: skip
def test_creep_and_recovery_are_one_run_whatever_their_clock(tmp_path, moved, starts, title):
    strain, rate = np.append(CREEP, RECOVERY), np.append(RATE, -0.2 * np.exp(-TIMES))
    time, stress = np.append(TIMES, starts + TIMES), np.repeat([50.0, 0.0], 30)
    columns = {"Time [s]": time, "Stress [Pa]": stress}
    columns |= {"Strain [-]": strain} if moved == "strain" else {"Shear rate [1/s]": rate}
    test = export(tmp_path, columns, *title).run
    np.testing.assert_allclose(test.time[30:], 10.0 + TIMES, rtol=1e-12)
    assert test.protocol.control == "stress"
    assert np.all(test.stress[30:] == 0.0)
    if moved == "strain":
        np.testing.assert_allclose(test.recorded, strain, rtol=1e-12)
    else:  # it goes back by 0.2 (1 - exp(-t)), and starts at the last strain of the creep
        back = test.recorded[30:] - test.recorded[29]
        np.testing.assert_allclose(back[-1], -0.2, rtol=0.03)


RECOVERIES = {
    "word": (
        {"Time [s]": TIMES, "Strain [-]": 1.2 - RECOVERY}, "Recovery after creep", "Stress: 50 Pa"
    ),
    "numbers": ({"Time [s]": TIMES, "Stress [Pa]": 0.0, "Strain [-]": RECOVERY}, "Sample 7"),
}  # fmt: skip


@pytest.mark.parametrize("case", RECOVERIES)
def test_a_recovery_without_its_creep_is_said_and_not_taken_for_creep(tmp_path, case):
    columns, *above = RECOVERIES[case]
    _, result = export(tmp_path, columns, *above, code=2)
    assert "is a recovery" in result.stderr
    assert "give both in one file" in result.stderr


def test_a_recovered_strain_of_reptate_is_a_recovery_and_a_strain_of_creep_is_not(tmp_path):
    rows = ["T=25;stress=10;rec={};", "t strain", *lines(TIMES, 1e-3 * TIMES, mark=" ")]
    rows[0] = rows[0].format(1)
    _, result = imported(tmp_path, "a.creep", rows, code=2)
    assert "is a recovery" in result.stderr
    rows[0] = rows[0].replace("rec=1", "rec=0")
    out, _ = imported(tmp_path, "b.creep", rows)
    assert load_dataset(out)[0].protocol.control == "stress"


@pytest.mark.parametrize("title", ["Stress relaxation", "Versuch: Relaxationsversuch", "応力緩和"])
def test_what_is_called_a_relaxation_is_one_though_its_strain_is_noisy(tmp_path, title):
    strain = 10.0 * (1 + 0.03 * np.random.default_rng(1).standard_normal(30))
    columns = {"Time [s]": TIMES, "Strain [%]": strain, "Shear stress [Pa]": RELAXED}
    test = export(tmp_path, columns, title, "Sample: 7").run
    # the median of 30 samples with 3 % of noise has a standard error of 0.7 %
    np.testing.assert_allclose(float(test.metadata["step_strain"]), 0.1, rtol=0.02)


AT_A_RATE = {"Time [s]": TIMES, "Shear rate [1/s]": 0.3, "Shear stress [Pa]": STARTED}
CONTRADICTIONS = {
    "Test type: Relaxation": (AT_A_RATE, "the strain is not held"),
    "Creep test": (AT_A_RATE, "the rate is held"),
    "Start-up of shear": (
        {"Time [s]": TIMES, "Stress [Pa]": 50.0, "Shear rate [1/s]": RATE}, "the stress is held"
    ),
}  # fmt: skip


@pytest.mark.parametrize("title", CONTRADICTIONS)
def test_words_and_numbers_that_exclude_each_other_are_one_message(tmp_path, title):
    columns, words = CONTRADICTIONS[title]
    out, result = export(tmp_path, columns, title, code=2)
    assert words in result.stderr
    assert "--test" in result.stderr
    assert not out.exists()
    # the user decides; and a file's name decides nothing that its numbers exclude
    kind = "creep" if "Start" in title else "run"
    out, _ = export(tmp_path, columns, title, options=["--test", kind])
    out, _ = export(tmp_path, columns, name="relaxation.csv", options=["--overwrite"])
    assert len(load_dataset(out)) == 1


@pytest.mark.parametrize("title", ["Relaxation time: 2 s", "Sample: creep-resistant blend",
                                   "Relaxation, creep and start-up of a melt",
                                   "Laboratory of extensional rheometry"])  # fmt: skip
def test_words_that_name_no_test_or_several_leave_numbers_and_columns_to_speak(tmp_path, title):
    test = export(tmp_path, AT_A_RATE, title).run
    assert (test.protocol.control, test.flow) == ("rate", "shear")


WAVE = np.linspace(0.0, 20.0, 300)
CLOCKED = {
    "start-up": AT_A_RATE,
    "oscillation": {
        "Time [s]": WAVE, "Shear rate [1/s]": np.cos(WAVE), "Shear stress [Pa]": np.sin(WAVE + 0.5)
    },
    "start-ups in turn": {
        "Time [s]": np.arange(1.0, 91.0), "Shear rate [1/s]": np.repeat([0.1, 0.5, 2.0], 30),
        "Shear stress [Pa]": np.concatenate([STARTED, 3 * STARTED, 5 * STARTED]),
    },
}  # fmt: skip


@pytest.mark.parametrize("kind", CLOCKED)
def test_what_has_a_unit_of_time_is_the_time_and_without_one_none_is_steady(tmp_path, kind):
    columns = dict(CLOCKED[kind])
    time = columns.pop("Time [s]")
    out, _ = export(tmp_path, {"Clock of the motor [ms]": 1e3 * time, **columns})
    assert not (out / "flow_curve.csv").exists()
    np.testing.assert_allclose(load_dataset(out)[0].time, time, rtol=1e-12)
    _, result = export(tmp_path, {"klok": time, **columns}, name="b.csv", code=2)
    assert '--column time="klok"' in result.stderr
    _, result = export(tmp_path, columns, name="c.csv", code=2)
    assert "Export it with its time" in result.stderr


TENSIONS = {
    "word": (("# Test = Extensional rheometry",), "Strain rate [1/s]", "Stress [Pa]"),
    "rate": ((), "Extension rate [1/s]", "Stress [Pa]"),
    "stress": ((), "Rate [1/s]", "Tensile stress [Pa]"),
}


@pytest.mark.parametrize("case", TENSIONS)
def test_tension_is_no_shear_whichever_of_its_words_says_so(tmp_path, case):
    above, rate, stress = TENSIONS[case]
    test = export(tmp_path, {"Time [s]": TIMES, rate: 0.3, stress: STARTED}, *above).run
    assert test.flow == "uniaxial"
    np.testing.assert_allclose(test.rate, 0.3)


@pytest.mark.parametrize("shift", [0.0, np.pi / 2, 2.0])
@pytest.mark.parametrize("ends", [True, False])
def test_one_cycle_is_a_cycle_with_its_end_point_and_without(tmp_path, shift, ends):
    phase = 2 * np.pi * np.arange(65 if ends else 64) / 64
    columns = {
        "Time [s]": phase, "Strain [-]": np.sin(phase + shift),
        "Shear rate [1/s]": np.cos(phase + shift),
        "Shear stress [Pa]": 50 * np.sin(phase + shift + 0.6) + 5 * np.sin(3 * (phase + shift)),
    }  # fmt: skip
    test = export(tmp_path, columns).run
    assert test.metadata["start"] == "periodic"
    # the period is that of the strain, to what straight lines between 64 samples leave open
    np.testing.assert_allclose(-float(test.protocol.cycle[0]), 2 * np.pi, rtol=1e-3)


def test_half_a_cycle_is_none(tmp_path):
    phase = np.linspace(0.0, 0.7 * 2 * np.pi, 64)
    columns = {"Time [s]": phase, "Shear rate [1/s]": np.cos(phase)}
    out, _ = export(tmp_path, {**columns, "Shear stress [Pa]": 50 * np.sin(phase)})
    assert "start" not in load_dataset(out)[0].metadata


def loop(apart, noise=0.0):
    stress = 12 * THERE_AND_BACK**0.4 * np.where(np.arange(40) < 20, 1.0, 1.0 - apart)
    stress *= 1 + noise * np.random.default_rng(3).standard_normal(40)
    return {"Shear rate [1/s]": THERE_AND_BACK, "Shear stress [Pa]": stress}


@pytest.mark.parametrize("apart", [0.3, 0.6])
def test_a_loop_is_no_flow_curve_but_a_run_where_its_time_stands(tmp_path, apart):
    _, result = export(tmp_path, loop(apart, 0.02), code=2)
    assert "no flow curve of steady states" in result.stderr
    assert "Export it with its time" in result.stderr
    made = export(tmp_path, {"Time [s]": EVERY_3_S, **loop(apart, 0.02)}, name="b.csv")
    np.testing.assert_allclose(made.run.rate, THERE_AND_BACK)
    assert not [f for f in check_folder(made.folder) if f.subject == "outliers"]


@pytest.mark.parametrize("time", [{}, {"Time [s]": EVERY_3_S}])
def test_ways_up_and_down_that_differ_by_their_scatter_are_a_flow_curve(tmp_path, time):
    out, result = export(tmp_path, {**time, **loop(0.02, 0.02)})
    assert len(table(out / "flow_curve.csv")["stress_Pa"]) == 40
    assert "the ways up and down in rate are" in result.stdout


def thixotropic(time, rate):
    """Stress of a fluid whose viscosity 3 + 40 s breaks down to s = 1 / (1 + rate / 2)."""
    structure, last, stress = 1.0, 0.0, []
    for now, flow in zip(time, rate, strict=True):
        pace = 0.05 * (1 + flow / 2)
        structure = 0.05 / pace + (structure - 0.05 / pace) * np.exp(-pace * (now - last))
        stress.append((3 + 40 * structure) * flow)
        last = now
    return np.array(stress)


CLOCK = np.arange(1.0, 301.0, 3.0)
STEPS = np.where((CLOCK > 60) & (CLOCK < 120), 100.0, 0.1)
ANSWER = thixotropic(CLOCK, STEPS)


def test_the_steps_of_a_thixotropy_test_are_one_run_and_no_outliers(tmp_path):
    columns = {"Time [s]": CLOCK, "Shear rate [1/s]": STEPS, "Shear stress [Pa]": ANSWER}
    out, result = export(tmp_path, columns)
    assert "goes in steps" in result.stdout
    assert not [f for f in check_folder(out) if f.subject == "outliers"]
    # the control: a knock within an interval is one
    knocked = np.where(CLOCK == 211.0, 3 * ANSWER + 20.0, ANSWER)
    out, _ = export(tmp_path, {**columns, "Shear stress [Pa]": knocked}, options=["--overwrite"])
    assert [f for f in check_folder(out) if f.subject == "outliers"]


def intervals(*parts):
    """Return intervals as RheoCompass exports them, each with its own clock from 3 s on."""
    rows = []
    for number, (rate, stress) in enumerate(parts, start=1):
        rows += [f"Interval and data points:,{number},{len(rate)}"]
        rows += ["Interval data:,Point No.,Time,Shear Rate,Shear Stress", ",,[s],[1/s],[Pa]"]
        clock = 3.0 * np.arange(1, len(rate) + 1)
        rows += [f",{i},{row}" for i, row in enumerate(lines(clock, rate, stress, mark=","), 1)]
        rows += [""]
    return rows


@pytest.mark.parametrize("title", [["Test:,3ITT"], []])
def test_intervals_of_a_thixotropy_test_are_one_run_with_a_word_and_without(tmp_path, title):
    parts = [(STEPS[i], ANSWER[i]) for i in (slice(0, 20), slice(20, 40), slice(40, None))]
    test = imported(tmp_path, "a.csv", title + intervals(*parts)).run
    np.testing.assert_allclose(test.time, CLOCK + 2.0)
    np.testing.assert_allclose(test.rate, STEPS)


def test_a_ramp_up_and_the_ramp_down_after_it_are_one_run_unless_they_agree(tmp_path):
    stress = loop(0.4)["Shear stress [Pa]"]
    out, _ = imported(tmp_path, "a.csv", intervals((UP, stress[:20]), (UP[::-1], stress[20:])))
    np.testing.assert_allclose(load_dataset(out)[0].rate, THERE_AND_BACK)
    stress = loop(0.02)["Shear stress [Pa]"]
    rows = intervals((UP, stress[:20]), (UP[::-1], stress[20:]))
    out, _ = imported(tmp_path, "b.csv", rows, "--overwrite")
    assert (out / "flow_curve.csv").exists()


def test_three_start_ups_of_which_one_is_repeated_stay_three(tmp_path):
    rates = [np.full(30, rate) for rate in (0.1, 1.0, 0.1)]
    out, _ = imported(tmp_path, "a.csv", intervals(*((rate, STARTED * rate[0]) for rate in rates)))
    assert len(load_dataset(out)) == 3
