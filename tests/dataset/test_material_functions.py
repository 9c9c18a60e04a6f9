"""What a data set holds beside runs: material functions, sweeps and relaxation spectra."""

import numpy as np
import pytest
from independent import Giesekus, Modes
from independent.sweeps import modulus_of
from made_exports import write_files
from noisy_runs import sweep as sweep_of

from discover.dataset import LinearSweep, load_dataset, relaxation_spectrum
from discover.dataset.checking.folder import check_folder
from discover.dataset.checking.linear_theory import sweep_inertia
from discover.errors import InputError
from discover.laws.multimode import Fluid
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


def test_tables_are_sorted_and_converted_and_linear_ones_kept_at_small_strain(tmp_path):
    run = load_dataset(write_files(tmp_path, SWEEPS)).material_functions["amplitude_sweep"]
    storage, loss = run.records
    np.testing.assert_allclose(run.strain, [0.01, 1.0])
    np.testing.assert_allclose(run.angular_frequency, [2.0, 2.0])
    np.testing.assert_allclose(storage.recorded, [50.0, 30.0])
    np.testing.assert_allclose(loss.recorded, [50.0, 40.0])
    run = load_dataset(write_files(tmp_path, TABLES)).material_functions["flow_curve"]
    np.testing.assert_allclose(run.rate, [0.1, 1.0, 10.0])
    np.testing.assert_allclose(run.stress, [3.0, 20.0, 100.0])
    np.testing.assert_allclose(run.observing("N1").recorded, [0.1, 5.0, 90.0])
    assert run.protocol.control == "steady"
    tables = load_dataset(write_files(tmp_path, TABLES)).material_functions
    creep, relaxation = tables["creep"], tables["relaxation"]
    assert creep.quantity == "strain"
    np.testing.assert_allclose(creep.strain / creep.stress, [0.01, 0.02, 0.11])
    np.testing.assert_allclose(relaxation.stress / relaxation.strain, [90.0, 40.0, 1.0])
    assert max(creep.strain.max(), relaxation.strain.max()) <= 0.01 * (1.0 + 1e-12)


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


def test_a_table_beside_runs_or_a_stress_that_is_not_observed_judges_unless_it_is_fitted(tmp_path):
    folder = write_files(tmp_path, {**TABLES, "runs.csv": "file\na.csv\n", "a.csv": RUN})
    judging = load_study_data(study(folder))
    assert judging.fit.names == ("a.csv",)
    assert set(judging.held_out.names) == set(TABLES)
    fitted = load_study_data(study(folder, flow_curve="fit"))
    assert fitted.fit.names == ("a.csv", "flow_curve.csv")
    assert set(fitted.held_out.names) == {"relaxation.csv", "creep.csv"}
    folder = write_files(tmp_path / "observed", {"flow_curve.csv": TABLES["flow_curve.csv"]})
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


def test_modes_reproduce_a_broad_sweep_may_be_counted_and_need_two_frequencies():
    frequency = np.geomspace(1e-3, 1e3, 61)
    times = np.geomspace(1e-3, 1e3, 7)
    sweep = sweep_of(1e4 * times**-0.3, times, omega=frequency)
    spectrum = relaxation_spectrum(sweep)
    storage, loss = spectrum.moduli(frequency)
    error = np.concatenate([storage / sweep.storage_modulus, loss / sweep.loss_modulus]) - 1
    assert spectrum.relative_error == pytest.approx(np.sqrt(np.mean(error**2)))
    assert spectrum.relative_error < 0.05
    assert np.all(spectrum.modulus > 0)
    one = np.ones(1)
    with pytest.raises(InputError, match="at least 2 frequencies"):
        relaxation_spectrum(LinearSweep(one, one, one))
    sweep = sweep_of(*MATERIALS["melt"], noise=0.01, seed=DRAW)
    assert [len(relaxation_spectrum(sweep, modes=count)) for count in (2, 4)] == [2, 4]
    with pytest.raises(InputError, match="modes must be from 1"):
        relaxation_spectrum(sweep, modes=0)


def test_the_melt_needs_a_dozen_modes_and_misses_its_sweep_by_under_4_percent(measured_data):
    sweep = load_dataset(measured_data / "pi95k-startup").linear_sweep
    spectrum = relaxation_spectrum(sweep)
    assert 10 <= len(spectrum) <= 16
    assert spectrum.relative_error < 0.04


@pytest.mark.parametrize("inertia", [0.0, 2e-3, -2e-3])
def test_inertia_left_in_a_sweep_comes_back_with_its_sign(inertia):
    omega = np.geomspace(0.1, 100.0, 25)
    left = sweep_of([40.0, 100.0], [0.1, 1.0], noise=0.01, inertia=inertia, omega=omega)
    found = sweep_inertia(left)
    assert found.inertia == pytest.approx(inertia, abs=4 * found.deviation)
    assert (found.evidence > 6.0) == (inertia != 0.0)
    if inertia != 0.0:
        assert found.deviation < 0.1 * abs(inertia)
        assert found.error_after < 0.3 * found.error_before


def test_the_inertia_left_in_the_gel_sweep_is_a_small_part_of_the_stated_one(measured_data):
    sweep = load_dataset(measured_data / "gel-laos").linear_sweep
    found = sweep_inertia(sweep)
    # inertia of motor and tool in the file's header, strain and stress constants of its plates
    stated = (20.5844e-6 + 1.65747e-6) * 9947180 / 5.714
    assert found.evidence > 6.0
    assert 0.01 * stated < found.inertia < 0.05 * stated


OMEGA = np.geomspace(0.03, 50.0, 17)
MODULI, TIMES = np.array([20.0, 60.0, 120.0]), np.array([10.0, 1.0, 0.1])


@pytest.fixture(scope="module")
def at_a_strain_of_one():
    """G′ + iG″ of three Giesekus modes at a strain of 1, which is not small, by scipy."""
    fluid = Modes(*(Giesekus(0.3, g, t) for g, t in zip(MODULI, TIMES, strict=True)))
    return np.array([modulus_of(fluid, 1.0, omega, 4) for omega in OMEGA])


def noisy(complex_modulus, size, seed):
    lot = np.random.default_rng([seed, 77])
    parts = (complex_modulus.real, complex_modulus.imag)
    return LinearSweep(OMEGA, *(v * (1 + size * lot.standard_normal(len(OMEGA))) for v in parts))


def linear_modulus():
    x = 1j * OMEGA[:, None] * TIMES
    return (x / (1 + x)) @ MODULI


def relative(found, measured):
    """Return G′ and G″ of modes of 1 Pa over those measured."""
    x = 1j * OMEGA[:, None] * found.relaxation_time
    modes = x / (1 + x)
    return np.concatenate([modes.real, modes.imag]) / measured[:, None]


def off_by(found):
    """Return how far moduli are from those of the linear sweep, in standard deviations."""
    exact = linear_modulus()
    design = relative(found, np.concatenate([exact.real, exact.imag]))
    true = np.linalg.lstsq(design, np.ones(len(design)))[0]
    return (found.modulus - true) / np.sqrt(np.diag(found.modulus_covariance))


def independent(sweep, found):
    """Return the variance of moduli with each frequency as an independent one."""
    design = relative(found, np.concatenate([sweep.storage_modulus, sweep.loss_modulus]))
    left = np.sum((design @ found.modulus - 1.0) ** 2) / (len(design) - len(found))
    return left * np.diag(np.linalg.inv(design.T @ design))


def test_intervals_hold_at_a_strain_that_is_not_small_and_noise_widens_none(at_a_strain_of_one):
    for seed in range(3):
        sweep = noisy(at_a_strain_of_one, 0.01, seed)
        found = relaxation_spectrum(sweep)
        assert np.all(np.abs(off_by(found)) < 2.0)
        # half of them are off by more than two if each frequency counts
        alone = independent(sweep, found)
        assert np.all(np.diag(found.modulus_covariance) > 4.0 * alone)
    wider = []
    for seed in range(20):
        sweep = noisy(linear_modulus(), 0.03, seed)
        found = relaxation_spectrum(sweep)
        wider.append(found.modulus_covariance[0, 0] / independent(sweep, found)[0])
    # one in twenty may look like a pattern
    assert np.count_nonzero(np.array(wider) > 1.001) <= 3


def test_modes_too_few_leave_more_than_the_best_number_would():
    frequency = np.geomspace(1e-3, 1e3, 61)
    times = 1.3 * np.geomspace(1e-3, 1e3, 41) ** 0.97
    found = relaxation_spectrum(sweep_of(1e4 * times**-0.3, times, omega=frequency), modes=4)
    assert len(found) == 4
    assert found.best_error < 0.1 * found.relative_error


DRAW = (0, 62)
MATERIALS = {
    "Oldroyd-B": ([50.0], [0.7], 0.4, 0.0),
    "Boger": ([2.0], [1.5], 5.0, 0.0),
    "Kelvin-Voigt": ([], [], 3.0, 40.0),
    "Zener": ([300.0], [0.2], 0.0, 80.0),
    "two modes": ([1200.0, 6000.0], [1.5, 0.08], 25.0, 0.0),
    "melt": ([20.0, 60.0, 120.0], [10.0, 1.0, 0.1], 0.0, 0.0),
}


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("name", MATERIALS)
def test_modes_solvent_and_elastic_constant_come_back_to_the_noise(name, noise):
    modulus, time, solvent, elastic = MATERIALS[name]
    sweep = sweep_of(*MATERIALS[name], noise=noise, seed=DRAW)
    found = relaxation_spectrum(sweep)
    # 62 values scatter by a tenth; a constant is a mode that errs by less than sweeps repeat to
    assert found.relative_error < max(1.3 * noise, 3e-4)
    # of six constants of 1 % noise the worst is told to some 3 %
    near = {"rtol": 6.0 * noise + 1e-3}
    n = len(modulus)
    assert len(found) == n + (elastic > 0.0)
    order = np.argsort(time)
    np.testing.assert_allclose(found.modulus[:n], np.asarray(modulus)[order], **near)
    np.testing.assert_allclose(found.relaxation_time[:n], np.asarray(time)[order], **near)
    np.testing.assert_allclose(
        [found.solvent_viscosity, found.elastic_modulus], [solvent, elastic], **near
    )
    assert bool(found.solid) == (elastic > 0.0)
    inertia = sweep_inertia(sweep)
    assert inertia.error_before < 0.02 or inertia.evidence < 6.0


@pytest.mark.parametrize("name", ["Oldroyd-B", "Zener"])
def test_inertia_is_still_found_beside_a_solvent_or_an_elastic_constant(name):
    sweep = sweep_of(*MATERIALS[name], noise=0.01, seed=DRAW, inertia=2e-3)
    found = sweep_inertia(sweep)
    assert found.evidence > 6.0
    # a mode faster than the sweep rises with the square of the frequency too, so it is told roughly
    assert found.inertia == pytest.approx(2e-3, rel=0.3)


def test_a_declared_solvent_is_not_found_again_and_a_fluid_of_a_solid_says_so():
    sweep = sweep_of(*MATERIALS["two modes"], noise=0.01, seed=DRAW)
    held = relaxation_spectrum(sweep, solvent_viscosity=25.0)
    assert held.solvent_viscosity == 25.0
    assert len(held) == 2
    none = relaxation_spectrum(sweep, solvent_viscosity=0.0)
    assert none.solvent_viscosity == 0.0
    assert none.relative_error < 0.02  # faster modes stand for it
    assert none.relaxation_time[0] < 0.01
    sweep = sweep_of(*MATERIALS["Kelvin-Voigt"], noise=0.01, seed=DRAW)
    with pytest.warns(UserWarning, match="solid down to 0.1 rad/s"):
        fluid = Fluid.from_sweep(sweep)
    x = 1j * sweep.angular_frequency[:, None] * np.asarray(fluid.relaxation_time)
    moduli = (x / (1 + x)) @ np.asarray(fluid.modulus)
    loss = moduli.imag + float(fluid.solvent_viscosity) * sweep.angular_frequency
    assert np.max(np.abs(moduli.real / sweep.storage_modulus - 1.0)) < 0.04
    assert np.max(np.abs(loss / sweep.loss_modulus - 1.0)) < 0.04


def test_one_in_a_hundred_fluids_at_most_is_taken_for_a_solid():
    fluids = (
        sweep_of([300.0, 20.0], [0.2, 3.0], noise=0.02, seed=(seed, 62)) for seed in range(40)
    )
    assert sum(bool(relaxation_spectrum(fluid).solid) for fluid in fluids) <= 1
