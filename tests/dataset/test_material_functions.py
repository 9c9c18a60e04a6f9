"""Tables beside the runs, and runs at a given stress, from files written by hand."""

import numpy as np
import pytest
from made_exports import write_files

from discover.dataset import load_dataset
from discover.dataset.checking.folder import check_folder
from discover.errors import InputError
from discover.study import parse_study
from discover.study.data import load_study_data
from discover.study.in_memory import data_in_memory

TABLES = {
    "flow_curve.csv": "shear_rate_1_s,stress_kPa,N1_Pa\n1,0.02,5\n0.1,0.003,0.1\n10,0.1,90\n",
    "relaxation.csv": "time_s,relaxation_modulus_Pa\n0.1,90\n1,40\n10,1\n",
    "creep.csv": "time_s,compliance_1_Pa\n0.1,0.01\n1,0.02\n10,0.11\n",
}
SWEEPS = {
    "amplitude_sweep.csv": "strain_percent,omega_rad_s,Gp_kPa,Gpp_Pa\n100,2,0.03,40\n1,2,0.05,50\n",
    "lve.csv": "omega_rad_s,Gp_Pa,Gpp_Pa\n0.1,1,10\n1,50,50\n10,99,10\n",
}
RUN = "time_s,shear_rate_1_s,stress_Pa\n0.1,1,9\n0.5,1,40\n1,1,63\n2,1,86\n"


def study(folder, **data):
    return parse_study({"data": {"folder": str(folder), **data}})


@pytest.mark.parametrize("name", [*TABLES, *SWEEPS])
def test_a_folder_of_one_table_is_a_data_set_which_is_fitted_of_a_sweep_both_moduli(tmp_path, name):
    folder = write_files(tmp_path, {name: (TABLES | SWEEPS)[name]})
    moduli = (f"{name} (storage_modulus)", f"{name} (loss_modulus)")
    assert len(load_dataset(folder)) == 0
    data = load_study_data(study(folder))
    assert data.fit.names == ((name,) if name in TABLES else moduli)
    assert not len(data.held_out)
    # from Python too
    assert data_in_memory(load_dataset(folder)).fit.names == data.fit.names


def test_an_amplitude_sweep_is_sorted_by_strain_and_converted(tmp_path):
    run = load_dataset(write_files(tmp_path, SWEEPS)).material_functions["amplitude_sweep"]
    storage, loss = run.records
    np.testing.assert_allclose(run.strain, [0.01, 1.0])
    np.testing.assert_allclose(run.angular_frequency, [2.0, 2.0])
    np.testing.assert_allclose(storage.recorded, [50.0, 30.0])
    np.testing.assert_allclose(loss.recorded, [50.0, 40.0])


def test_an_amplitude_sweep_judges_and_the_linear_sweep_gives_modes_unless_asked(tmp_path):
    folder = write_files(tmp_path, {**SWEEPS, "runs.csv": "file\na.csv\n", "a.csv": RUN})
    sweep = [f"amplitude_sweep.csv ({name})" for name in ("storage_modulus", "loss_modulus")]
    linear = [name.replace("amplitude_sweep", "lve") for name in sweep]
    plain = load_study_data(study(folder))
    assert plain.fit.names == ("a.csv",)
    assert list(plain.held_out.names) == sweep
    asked = load_study_data(study(folder, amplitude_sweep="fit", lve="judge"))
    assert list(asked.fit.names) == ["a.csv", *sweep]
    assert list(asked.held_out.names) == linear
    one = load_study_data(study(folder, lve="fit", observe=["sigma12", "loss_modulus"]))
    assert list(one.fit.names) == ["a.csv", linear[1]]
    assert set(one.held_out.names) == {*sweep, linear[0]}


def test_the_check_says_what_each_table_was_taken_for(tmp_path):
    found = check_folder(write_files(tmp_path, {**TABLES, **SWEEPS}))
    said = " ".join(str(finding) for finding in found)
    assert "amplitude_sweep.csv is read as an amplitude sweep" in said
    assert "flow_curve.csv is read as a flow curve" in said
    assert "lve.csv is read as a frequency sweep" in said
    assert "In amplitude_sweep.csv, strain_percent" in said
    assert not found.of("error")


def test_an_amplitude_sweep_without_a_frequency_is_set_aside_until_one_is_given(tmp_path):
    folder = write_files(tmp_path, {"amplitude_sweep.csv": "strain,Gp_Pa,Gpp_Pa\n0.1,5,4\n1,3,4\n"})
    write_files(folder, {"flow_curve.csv": TABLES["flow_curve.csv"]})
    assert "no column omega_rad_s" in load_dataset(folder).left_out
    with pytest.raises(InputError, match="write amplitude_sweep_rad_s"):
        load_study_data(study(folder, amplitude_sweep="fit"))
    data = load_study_data(study(folder, amplitude_sweep="judge", amplitude_sweep_rad_s=2.0))
    np.testing.assert_allclose(data.dataset.runs[1].angular_frequency, 2.0)


def test_a_strain_in_per_cent_without_its_unit_is_doubted(tmp_path):
    rows = [f"{s},2,50,{40 - 0.1 * s}" for s in (1, 10, 100, 300)]
    text = "\n".join(["strain,omega_rad_s,Gp_Pa,Gpp_Pa", *rows])
    doubts = check_folder(write_files(tmp_path, {"amplitude_sweep.csv": text})).of("warning")
    assert any("strain_percent" in str(doubt) for doubt in doubts)
    text = text.replace("strain,", "strain_percent,")
    doubts = check_folder(write_files(tmp_path, {"amplitude_sweep.csv": text})).of("warning")
    assert not any("strain_percent" in str(doubt) for doubt in doubts)


def test_a_flow_curve_is_sorted_by_rate_and_converted(tmp_path):
    run = load_dataset(write_files(tmp_path, TABLES)).material_functions["flow_curve"]
    np.testing.assert_allclose(run.rate, [0.1, 1.0, 10.0])
    np.testing.assert_allclose(run.stress, [3.0, 20.0, 100.0])
    np.testing.assert_allclose(run.observing("N1").recorded, [0.1, 5.0, 90.0])
    assert run.protocol.control == "steady"


def test_creep_and_relaxation_are_looked_at_where_they_are_linear(tmp_path):
    tables = load_dataset(write_files(tmp_path, TABLES)).material_functions
    creep, relaxation = tables["creep"], tables["relaxation"]
    assert creep.quantity == "strain"
    np.testing.assert_allclose(creep.strain / creep.stress, [0.01, 0.02, 0.11])
    np.testing.assert_allclose(relaxation.stress / relaxation.strain, [90.0, 40.0, 1.0])
    assert max(creep.strain.max(), relaxation.strain.max()) <= 0.01 * (1.0 + 1e-12)


def test_a_table_beside_runs_judges_unless_it_is_fitted(tmp_path):
    folder = write_files(tmp_path, {**TABLES, "runs.csv": "file\na.csv\n", "a.csv": RUN})
    judging = load_study_data(study(folder))
    assert judging.fit.names == ("a.csv",)
    assert set(judging.held_out.names) == set(TABLES)
    fitted = load_study_data(study(folder, flow_curve="fit"))
    assert fitted.fit.names == ("a.csv", "flow_curve.csv")
    assert set(fitted.held_out.names) == {"relaxation.csv", "creep.csv"}


def test_what_is_recorded_and_not_observed_judges(tmp_path):
    folder = write_files(tmp_path, {"flow_curve.csv": TABLES["flow_curve.csv"]})
    data = load_study_data(study(folder, flow_curve="fit", observe=["N1"]))
    assert data.fit.names == ("flow_curve.csv (N1)",)
    assert data.held_out.names == ("flow_curve.csv",)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"creep": "fit"}, "has no creep.csv; it has flow_curve.csv"),
        ({"observe": ["N2"]}, "observe: the data set .* has no quantity 'N2'"),
        ({"flow_curve": "use"}, "flow_curve"),
    ],
)
def test_what_the_data_do_not_hold_is_said(tmp_path, keys, message):
    folder = write_files(tmp_path, {"flow_curve.csv": TABLES["flow_curve.csv"]})
    with pytest.raises(InputError, match=message):
        load_study_data(study(folder, **keys))


def test_a_run_at_a_given_stress_has_its_strain_as_what_is_observed(tmp_path):
    files = {
        "runs.csv": "file,control\ncreep.csv,stress\n",
        "creep.csv": "time_s,stress_Pa,strain\n0.1,5,0.01\n1,5,0.02\n10,5,0.11\n20,5,0.2\n",
    }
    run = load_dataset(write_files(tmp_path, files))["creep.csv"]
    assert run.quantity == "strain"
    np.testing.assert_allclose(run.recorded, [0.01, 0.02, 0.11, 0.2])
    assert load_dataset(tmp_path).table().loc[0, "flow"] == "creep"
