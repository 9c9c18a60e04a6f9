"""Data folders are read as they stand, or refused with all that is wrong and what was meant."""

import numpy as np
import pytest
from made_exports import write_files

import discover as dc
from discover.dataset import check_folder, load_dataset
from discover.dataset.read_run import differentiate
from discover.errors import InputError, problems_in
from discover.protocols import shear_rates, strains

GOOD = {
    "runs.csv": "file,factor,label\na.csv,2.0,first\nb.csv,4.0,second\n",
    "a.csv": "time_s,shear_rate_1_s,stress_Pa,N1_Pa\n1,0.5,2,0\n2,0.5,4,1\n3,0.5,5,2\n",
    "b.csv": "time_s,shear_rate_1_s,stress_Pa\n0,0,0\n1,1,2\n2,2,3\n",
    "lve.csv": "omega_rad_s,Gp_Pa,Gpp_Pa\n10,50,5\n1,25,25\n",
}


@pytest.fixture
def folder(tmp_path):
    def write(**changes):
        files = GOOD | {k.replace("__", "."): v for k, v in changes.items()}
        return write_files(tmp_path, {k: v for k, v in files.items() if v is not None})

    return write


def test_a_constant_rate_is_a_start_up_a_varying_one_is_followed_and_the_sweep_is_sorted(folder):
    data = load_dataset(folder(), clock_factor="factor")
    steady, varying = data["a.csv"], data["b.csv"]
    assert steady.clock_factor == 2.0
    assert steady.metadata["label"] == "first"
    # the flow starts at t = 0 although the first sample is at 1 s
    assert strains(steady.protocol, np.ones(1)) == pytest.approx([0.5])
    assert shear_rates(varying.protocol, np.array([1.5])) == pytest.approx([1.5])
    np.testing.assert_array_equal(steady.first_normal_stress_difference, [0.0, 1.0, 2.0])
    assert varying.first_normal_stress_difference is None
    sweep = load_dataset(folder()).linear_sweep
    np.testing.assert_array_equal(sweep.angular_frequency, [1.0, 10.0])
    np.testing.assert_array_equal(sweep.storage_modulus, [25.0, 50.0])


def test_units_in_column_names_are_converted(folder):
    data = load_dataset(
        folder(
            a__csv="time_ms,shear_rate_1_min,stress_kPa,strain_percent\n0,60,0,0\n100,60,0.5,10\n",
            lve__csv="omega_Hz,Gp_kPa,Gpp_dyn_cm2\n1,1,10\n",
        )
    )
    run = data["a.csv"]
    np.testing.assert_allclose(run.time, [0.0, 0.1])
    np.testing.assert_allclose(run.rate, 1.0)
    np.testing.assert_allclose(run.stress, [0.0, 500.0])
    np.testing.assert_allclose(run.strain, [0.0, 0.1])
    np.testing.assert_allclose(data.linear_sweep.angular_frequency, 2 * np.pi)
    np.testing.assert_allclose(data.linear_sweep.loss_modulus, 1.0)  # 10 dyn/cm2 = 1 Pa


def test_a_rate_derived_from_strain_is_said_and_measured_or_as_the_caller_says(folder):
    time = np.linspace(0, 6, 400)
    rows = "\n".join(f"{t:.8f},{np.sin(t):.10f},1" for t in time)
    run = load_dataset(folder(a__csv="time_s,strain,stress_Pa\n" + rows))["a.csv"]
    # a cubic over 15 samples of 15 ms: truncation error below 1e-4 at the ends
    np.testing.assert_allclose(run.rate, np.cos(time), atol=1e-4)
    assert "derived from strain" in str(run.metadata["shear_rate_source"])
    rows = "\n".join(f"{t},{0.5 * t},1" for t in range(8))
    made = folder(b__csv="time_s,strain,stress_Pa\n" + rows)
    data = load_dataset(made)
    assert not data["a.csv"].rate_is_measured
    assert data["b.csv"].rate_is_measured
    assert load_dataset(made, rate_is_measured=True)["a.csv"].rate_is_measured
    text = "time_s,shear_rate_1_s,stress_Pa,strain_since_first_sample\n0,1,0,7\n1,1,1,8\n"
    assert load_dataset(folder(a__csv=text))["a.csv"].strain is None


def test_a_sample_remembers_the_strain_of_earlier_runs(folder):
    index = "file,start\na.csv,20\nb.csv,10\n"
    data = load_dataset(folder(runs__csv=index), sequence="start")
    assert data["b.csv"].strain_before == 0.0
    # a rate that rises from 0 to 2 in 2 s
    assert data["a.csv"].strain_before == pytest.approx(2.0)
    assert load_dataset(folder(runs__csv=index))["a.csv"].strain_before == 0.0


def test_smoothing_reduces_noise_and_keeps_a_cubic_on_uneven_samples():
    generator = np.random.default_rng(0)
    time = np.cumsum(generator.uniform(0.5, 1.5, 200)) * 1e-2
    cubic = 1 + 2 * time - time**2 + time**3
    slope = 2 - 2 * time + 3 * time**2
    np.testing.assert_allclose(differentiate(time, cubic), slope, rtol=1e-9)
    noisy = cubic + 1e-3 * generator.standard_normal(200)
    rough = np.sqrt(np.mean((np.gradient(noisy, time) - slope)[8:-8] ** 2))
    smooth = np.sqrt(np.mean((differentiate(time, noisy) - slope)[8:-8] ** 2))
    assert smooth < 0.5 * rough


def test_every_bad_clock_factor_is_told_at_once(folder):
    index = "file,factor\na.csv,0\nb.csv,2\nc.csv,-1\nd.csv,\ne.csv,x\n"
    root = folder(runs__csv=index)
    words = r"must hold positive numbers; line 2 holds 0\..* \(Lines 4, 5 and 6 too\.\)"
    with pytest.raises(InputError, match=words):
        load_dataset(root, clock_factor="factor")
    with pytest.raises(InputError, match="only file, factor"):
        load_dataset(root, clock_factor="other")


def test_a_relative_folder_is_found_through_the_variable(folder, monkeypatch):
    root = folder()
    monkeypatch.setenv("DISCOVER_DATA", str(root.parent))
    assert load_dataset(root.name).names == ("a.csv", "b.csv")
    with pytest.raises(InputError, match="no data folder 'nowhere'"):
        load_dataset("nowhere")


def test_the_measured_folders_load(measured_data):
    melt = load_dataset(measured_data / "pi95k-startup", clock_factor="time_factor")
    assert len(melt) == 11
    assert melt["pi_Tm23_rate1.csv"].clock_factor == pytest.approx(14.771)
    assert melt["pi_Tm10_rate0p01.csv"].time[0] > 0
    gel = load_dataset(measured_data / "gel-laos")
    assert "derived" in str(gel.runs[0].metadata["shear_rate_source"])
    blood = load_dataset(measured_data / "blood-steps")
    assert blood.linear_sweep is None
    assert len(blood) == 6
    for name in ("pi95k-startup", "gel-laos", "blood-steps"):
        assert not [f for f in check_folder(measured_data / name) if f.severity == "error"]


SOUND = "time_s,shear_rate_1_s,stress_Pa\n0,1,2\n1,1,3\n2,1,4\n"


def folder_of(tmp_path, **files):
    return write_files(tmp_path / "melt", {f"{name}.csv": text for name, text in files.items()})


def test_every_file_and_every_column_is_told_of(tmp_path):
    root = folder_of(
        tmp_path,
        runs="file\na.csv\nb.csv\nc.csv\n",
        a="time_s,shear_rate_1_s,stres_Pa\n0,1,2\n1,y,2\n1,1,3\n",
        b="time_s,shear_rate_1_s,stress_Pa\n0,1,2\n1,1\n2,1,3\n3,1\n4,1,3\n",
        c=SOUND,
        lve="omega_rad_s,Gp_Pa,Gpp_Pa\n1,2,x\n2,-3,4\n",
    )
    with pytest.raises(dc.InputError) as error:
        dc.load_dataset(root)
    problems = problems_in(str(error.value))
    said = ("Is stres_Pa meant", "holds y", "increase strictly", "(Line 5 too.)", "holds x")
    for words in said:
        assert sum(words in one for one in problems) == 1, words
    assert len(problems) == len(said)
    assert not any("c.csv" in one for one in problems)
    assert len([one for one in dc.check_folder(root) if one.severity == "error"]) == len(said)


def test_what_is_misspelled_gets_a_guess(tmp_path):
    root = folder_of(tmp_path, runs="file\nfast.csv\nslwo.csv\n", fast=SOUND, slow=SOUND)
    with pytest.raises(dc.InputError, match=r"Did you mean 'slow\.csv'"):
        dc.load_dataset(root)
    with pytest.raises(dc.InputError, match="Did you mean 'melt'"):
        dc.load_dataset(tmp_path / "mlet")
    (root / "runs.csv").write_text("file\nfast.csv\nslow.csv\n")
    with pytest.raises(dc.InputError, match=r"Did you mean 'fast\.csv'"):
        dc.load_dataset(root).select(["Fast"])
