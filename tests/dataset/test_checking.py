"""What a check says of a folder, and what it does not say of a good one."""

import json

import numpy as np
import pytest
from command_line import invoke
from independent import Giesekus, UpperConvectedMaxwell
from independent import start_up as flow_at
from made_exports import LAMBDA as RELAXATION_TIME
from made_exports import G as MODULUS
from made_exports import sweep_table, write_runs

from discover.dataset import check_folder, load_dataset
from discover.errors import InputError
from discover.study import parse_study
from discover.study.data import load_study_data
from discover.study.declared_model import declared_model

TIMES = np.concatenate([[0.0], np.geomspace(2e-3, 20.0, 120)])


def start_up(rate=1.0, time=TIMES, **changes):
    """Start-up of an upper-convected Maxwell fluid, with its analytic stresses, but for changes."""
    exact = UpperConvectedMaxwell(MODULUS, RELAXATION_TIME).start_up(rate, time)
    table = {"time_s": time.copy(), "shear_rate_1_s": np.full(len(time), rate)}
    table |= {"stress_Pa": exact.sigma12, "N1_Pa": exact.N1}
    return table | {k: v(table[k]) if callable(v) else v for k, v in changes.items()}


@pytest.fixture
def folder(tmp_path):
    def write(*runs, sweep=True, **files):
        table = sweep_table(30) if sweep is True else sweep
        return write_runs(tmp_path, *runs, sweep=table, **files)

    return write


def subjects(findings, severity="warning"):
    return {finding.subject for finding in findings if finding.severity == severity}


def test_nothing_is_said_of_a_maxwell_fluid_with_its_own_sweep_with_and_without_noise(folder):
    assert check_folder(folder(start_up(0.05), start_up(0.5), start_up(2.0))) == ()
    generator = np.random.default_rng(3)
    runs = []
    for rate in (0.05, 0.5, 2.0):
        table = start_up(rate)
        for name in ("stress_Pa", "N1_Pa"):
            table[name] = table[name] * (1 + 0.01 * generator.standard_normal(len(TIMES)))
        runs.append(table)
    assert check_folder(folder(*runs)) == ()


def spiked():
    return start_up(stress_Pa=lambda stress: stress * np.where(np.arange(121) == 60, 1.5, 1.0))


def floored():
    noise = 0.5 * np.random.default_rng(0).standard_normal(len(TIMES))
    return start_up(0.01, stress_Pa=lambda stress: stress + noise)


DOUBTS = {
    "outliers": (spiked(), "one sample (time 0.192"),
    "sampling": (start_up(time=np.linspace(0.0, 60.0, 20)), "before the stress reaches"),
    "duration": (start_up(time=TIMES / 20), "mean relaxation time is 2 s"),
    "time": (start_up(time=TIMES[1:] + 30.0), "subtract its reading"),
    "rate": (start_up(0.0), "zero throughout"),
    "linear": (start_up(stress_Pa=lambda stress: 2 * stress), "is 2 times what lve.csv"),
    "Cox-Merz": (start_up(0.05, stress_Pa=lambda s: 0.5 * s), "0.5 times the complex viscosity"),
    "strain": (start_up(strain=100 * TIMES), "per cent?"),
    "samples": (start_up(time=TIMES[::20]), "only 7 samples"),
    "N1": (start_up(0.05, N1_Pa=lambda normal: normal - 5.0), "negative, above 2 times"),
    "stress": (floored(), "transducer's floor"),
    "columns": ({k.replace("N1", "n1"): v for k, v in start_up().items()}, "rename it to N1_Pa"),
    # 2 G λ² γ̇² = 2 · 100 · 4 · 0.0025 = 2 Pa
    "N1 of second order": (start_up(0.05, N1_Pa=np.full(121, 50.0)), "between 0 and 2 Pa"),
    "stress of one value": (start_up(stress_Pa=np.full(121, 3.0)), "the same in every sample"),
}


@pytest.mark.parametrize("case", DOUBTS)
def test_each_doubt_is_raised_by_the_fault_it_is_for(folder, case):
    (bad, words), subject = DOUBTS[case], case.partition(" of ")[0]
    findings = check_folder(folder(bad, start_up(0.5)))
    assert subjects(findings, "error") == set()
    mine = [f for f in findings if f.subject == subject and f.severity == "warning"]
    assert any(words in f.text for f in mine), findings
    # the sound run beside it is left alone
    assert {f.file for f in mine} <= {"r0.csv", ""}


def held_record(groups):
    """Return a start-up of 90 samples with 1 % noise, of which groups show one value each."""
    table = start_up(0.5, np.linspace(0.05, 9.0, 90))
    noise = 1.0 + 0.01 * np.random.default_rng(7).standard_normal(90)
    table["stress_Pa"] = (table["stress_Pa"] * noise)[np.repeat(groups, np.diff([*groups, 90]))]
    return table


def test_a_transducer_that_is_read_three_times_for_each_value_is_told(folder):
    findings = check_folder(folder(held_record(np.arange(0, 90, 3)), start_up(0.5)))
    (told,) = [f for f in findings if "looks like a lag" in f.text]
    assert told.file == "r0.csv"
    assert "stands in 3 samples" in told.text


@pytest.mark.parametrize("kept", [1.0, 0.6], ids=["every", "by chance"])
def test_values_that_are_new_or_repeat_by_chance_are_not_told_as_held(folder, kept):
    lot = np.random.default_rng(8)
    groups = np.flatnonzero(np.append(True, lot.random(89) < kept))
    rounded = start_up(1.0, np.linspace(0.05, 9.0, 90))
    rounded["stress_Pa"] = np.round(rounded["stress_Pa"], -1)
    ramp = start_up(0.5, np.linspace(0.05, 9.0, 90))
    ramp["stress_Pa"] = 0.1 * np.repeat(np.arange(30), 3)  # evenly through the steps of a converter
    findings = check_folder(folder(held_record(groups), rounded, ramp))
    assert not any("looks like a lag" in f.text for f in findings)


@pytest.mark.parametrize(
    ("column", "factor", "told"),
    [
        ("stress_Pa", 1e-3, "stress in kPa"), ("stress_Pa", 10.0, "stress in dyn/cm2"),
        ("shear_rate_1_s", 60.0, "shear rate in 1/min"), ("time_s", 1e3, "time in ms"),
        ("time_s", 1.0 / 60.0, "time in min"),
    ],
)  # fmt: skip
def test_a_unit_mistaken_in_all_runs_is_named_beside_a_sweep(folder, column, factor, told):
    # coarse start-ups, of which hardly a sample lies at small strain as it is read; 3 % noise is
    # far less than the 15 % within which the right unit must agree
    times, lot = np.linspace(0.05, 10.0, 80), np.random.default_rng(2)
    made = [start_up(rate, times) for rate in (0.3, 0.6, 2.0)]
    for one in made:
        del one["N1_Pa"]
        one["stress_Pa"] = one["stress_Pa"] * (1.0 + 0.03 * lot.standard_normal(80))
    right = check_folder(folder(*made))
    assert "units" not in subjects(right)
    for one in made:
        one[column] = factor * one[column]
    (said,) = [f.text for f in check_folder(folder(*made)) if f.subject == "units"]
    assert told in said
    assert " or a " not in said  # no other unit does


def wave(sign=1.0, strain_sign=1.0):
    """Oscillation of a nearly elastic Maxwell fluid; its work is small beside what it stores."""
    time = np.linspace(0.0, 20.0, 400)
    x = 3.0 * RELAXATION_TIME
    stress = MODULUS * x * (x * np.sin(3.0 * time) + np.cos(3.0 * time)) / (1 + x**2)
    return {
        "time_s": time,
        "shear_rate_1_s": 3.0 * np.cos(3.0 * time),
        "stress_Pa": sign * stress,
        "strain": strain_sign * np.sin(3.0 * time),
    }


def test_a_wrong_sign_in_one_oscillation_is_doubted(folder):
    found = check_folder(folder(wave(), wave(sign=-1.0), wave(strain_sign=-1.0), sweep=False))
    said = {(f.file, f.subject) for f in found if f.subject in ("stress", "strain")}
    assert said == {("r1.csv", "stress"), ("r2.csv", "strain")}
    assert any("wrong sign" in f.text for f in found if f.subject == "strain")


def test_the_normal_stress_of_a_giesekus_fluid_of_one_mode_is_not_doubted(folder):
    # At α = 0.4 and G′/G″ = λγ̇ = 4 it follows Cox and Merz within 2 %, with a quarter of Laun's N1
    rate = 4.0 / RELAXATION_TIME
    exact = Giesekus(0.4, MODULUS, RELAXATION_TIME).respond(flow_at(rate), TIMES[1:])
    run = {
        "time_s": TIMES[1:], "shear_rate_1_s": np.full(120, rate), "stress_Pa": exact.sigma12,
        "N1_Pa": exact.N1,
    }  # fmt: skip
    findings = check_folder(folder(run, sweep=sweep_table(30)))
    assert not any("N1" in f.text for f in findings)


def test_a_normal_stress_that_no_fluid_has_is_neither_fitted_nor_judges(folder):
    sound, bad = start_up(0.05), start_up(0.1, N1_Pa=np.full(len(TIMES), 50.0))
    path = folder(sound, bad)
    seen = load_dataset(path).quantity_by_quantity()
    assert seen.names == ("r0.csv", "r0.csv (N1)", "r1.csv")
    assert "r1.csv (N1) is set aside: it cannot be right early" in seen.left_out
    told = {"folder": str(path), "observe": ["sigma12", "N1"]}
    study = load_study_data(parse_study({"data": told}))
    assert study.fit.names == seen.names
    # data that are so already stay as they are
    assert seen.quantity_by_quantity().names == seen.names
    # the control: where that is all there is, it is said why there is none
    told = {"folder": str(folder(bad)), "observe": ["N1"]}
    with pytest.raises(InputError, match="cannot be right early"):
        load_study_data(parse_study({"data": told}))


def test_linear_runs_teach_nothing_and_a_sweep_may_contradict_itself(folder):
    assert any("every run is linear" in f.text for f in check_folder(folder(start_up(0.01))))
    sweep = sweep_table(30)
    sweep["Gp_Pa"] = sweep["Gp_Pa"] * sweep["omega_rad_s"]
    findings = check_folder(folder(start_up(), sweep=sweep))
    assert any("contradict each other" in f.text for f in findings)
    times = np.array([0.1, 1.0, 10.0])
    said = [f.text for f in check_folder(folder(start_up(0.5, times), sweep=False))]
    assert not any("teach nothing" in text for text in said)
    assert any("has only 3 samples" in text for text in said)


def test_a_missing_sweep_a_copy_a_file_left_over_an_unused_clock_and_sparse_cycles_are_told(folder):
    findings = check_folder(folder(start_up(), start_up(), sweep=False, steady__csv="a,b\n1,2\n"))
    assert {"sweep", "runs"} <= subjects(findings)
    assert any("same samples as r0.csv" in f.text for f in findings)
    assert any("steady.csv is not named" in f.text for f in findings)
    root = folder(start_up(), runs__csv="file,time_factor\nr0.csv,3\n")
    assert "clock" in subjects(check_folder(root), "note")
    assert "clock" not in subjects(check_folder(root, "time_factor"), "note")
    assert "clock" in subjects(check_folder(root, "other"), "error")
    for samples, doubted in ((30, True), (300, False)):
        t = np.linspace(0, 20, samples)
        table = {"time_s": t, "shear_rate_1_s": np.cos(2 * t), "stress_Pa": np.cos(2 * t - 0.5)}
        assert ("sampling" in subjects(check_folder(folder(table)))) is doubted


@pytest.mark.parametrize(
    ("index", "told"),
    [
        ("file,temperature_C\nr0.csv,25\nr1.csv,45\n", True),
        ("file,temperature_C_measured\nr0.csv,25\nr1.csv,45\n", True),
        ("file,temperature_C\nr0.csv,25.2\nr1.csv,24.8\n", False),
        ("file,temperature_C\nr0.csv,25\nr1.csv,\n", False),
        ("file,temperature_C,time_factor\nr0.csv,25,1\nr1.csv,45,3\n", False),
    ],
    ids=["two temperatures", "measured", "one", "one told", "shifted"],
)
def test_runs_at_several_temperatures_are_told_unless_their_times_are_shifted(folder, index, told):
    found = check_folder(folder(start_up(), start_up(2.0), runs__csv=index))
    assert ("temperature" in subjects(found)) is told


def test_the_command_exits_with_2_on_errors_only_and_prints_json(folder):
    assert "warning: " in invoke("data", "check", folder(spiked()), code=0).stdout
    report = json.loads(invoke("data", "check", folder(spiked()), "--json").stdout)
    assert report["errors"] == []
    assert report["warnings"][0]["subject"] == "outliers"
    wrong = invoke("data", "check", folder(start_up(stress_Pa=np.negative)), code=2)
    assert "opposite to the shear rate" in wrong.stderr


def test_the_inertia_left_in_the_gel_sweep_is_told_with_the_frequencies_to_use(measured_data):
    told = [f.text for f in check_folder(measured_data / "gel-laos") if "inertia" in f.text]
    assert any("sweep_rad_s = [0.1, 15.85]" in text for text in told)


def test_the_polyisoprene_folder_is_doubted_where_its_literature_doubts_it(measured_data):
    findings = check_folder(measured_data / "pi95k-startup", "time_factor")
    assert subjects(findings, "error") == set()
    normal = {f.file for f in findings if f.subject == "N1"}
    # early in every run, by the lag of its normal force
    assert normal == {run.name for run in load_dataset(measured_data / "pi95k-startup")}
    seen = load_dataset(measured_data / "pi95k-startup").quantity_by_quantity()
    assert not seen.set_aside  # later samples of each are left
    for run in seen:
        assert run.quantity != "N1" or 0.05 < run.time[0] * run.rate[0] < 1.01


def test_runs_at_rest_or_without_stress_are_refused_before_any_fit(folder):
    times = np.arange(1.0, 13.0)
    flow, stress = np.ones(12), 1 - np.exp(-times)

    def made(*runs):
        columns = ("time_s", "shear_rate_1_s", "stress_Pa")
        tables = (dict(zip(columns, (times, *run), strict=True)) for run in runs)
        return folder(*tables, sweep=False)

    model = {"modulus_Pa": "fit", "relaxation_time_s": "fit"}
    study = parse_study({"data": {"folder": str(made((flow, stress)))}, "model": model})
    for rate, force, word in (
        (0 * flow, stress, "shear rate is zero"),
        (1e-300 * flow, stress, "shear rate is zero"),
        (flow, 0 * stress, "stress is zero"),
    ):
        root = made((rate, force), (rate, force))
        with pytest.raises(InputError, match=word):
            load_study_data(study)
        assert any(word in f.text for f in check_folder(root).of("error"))
    # one run at rest beside one that flows says nothing of the constants to start from
    made((flow, stress), (0 * flow, 1e-3 * stress))
    model = declared_model(study, load_study_data(study).dataset)
    assert 0.01 < model.modulus[0] < 100
