"""Fits of one named law, to start-ups by scipy and closed forms."""

import json
import runpy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from command_line import invoke
from independent import Giesekus, start_up
from independent.folders import maxwell_sweep
from independent.noise import white

import discover as dc

MODULUS, TIME, MOBILITY = 80.0, 1.7, 0.3
NOISE = 0.01


def giesekus_start_up(rate, times):
    return Giesekus(MOBILITY, MODULUS, TIME).respond(start_up(rate), times).sigma12


def data_of(stress_of, rates, seed=0, sweep=None, runs=None):
    generator = np.random.default_rng(seed)
    times = np.linspace(0.05, 8.0, 80)
    frames = []
    for rate in rates:
        table = {"run": f"{rate:g}", "time_s": times, "shear_rate_1_s": rate}
        stress = white(stress_of(rate, times), NOISE, generator)
        frames.append(pd.DataFrame({**table, "stress_Pa": stress}))
    tables = None if sweep is None else {"lve": sweep}
    return dc.from_dataframe(pd.concat(frames), runs, tables)


@pytest.fixture(scope="module")
def data():
    return data_of(giesekus_start_up, (0.5, 1.5, 3.0, 6.0))


@pytest.fixture(scope="module")
def fitted(data):
    return dc.fit("giesekus", data, held_out=["6"])


def test_the_true_constants_lie_in_the_intervals_and_the_misfit_is_the_noise(fitted):
    ends = fitted.conf_int()
    truth = {"modulus_Pa": MODULUS, "relaxation_time_s": TIME, "alpha": MOBILITY}
    # three true constants at 99.9 %: one run of a hundred seeds may fail
    wide = fitted.conf_int(0.999)
    for name, value in truth.items():
        assert wide.loc[name, "low"] < value < wide.loc[name, "high"]
        # 240 samples of 1 % noise: tighter than 5 % for each of three constants
        assert ends.loc[name, "high"] - ends.loc[name, "low"] < 0.05 * value
    assert fitted.fits_to_the_noise
    # the error of a mean over 240 samples of noise is 5 % of it
    assert fitted.error == pytest.approx(NOISE, rel=0.2)
    assert fitted.held_out_error == pytest.approx(NOISE, rel=0.3)


def test_intervals_hold_the_truth_as_often_as_they_say():
    held = []
    for seed in range(12):
        data = data_of(giesekus_start_up, (0.5, 1.5, 3.0), seed)
        start = {"modulus_Pa": 70.0, "relaxation_time_s": 2.0, "alpha": 0.2}
        ends = dc.fit("giesekus", data, start=start).conf_int(0.9)
        for name, value in zip(ends.index, (MODULUS, TIME, MOBILITY), strict=True):
            held.append(ends.loc[name, "low"] < value < ends.loc[name, "high"])
    # 36 of which 90 % should hold; fewer than 26 happens by chance in 1 of 500 such tests
    assert sum(held) >= 26


def test_predictions_follow_their_rows_and_correlations_the_covariance(data, fitted):
    times = np.linspace(0.05, 8.0, 80)
    exact = [giesekus_start_up(rate, times) for rate in (0.5, 1.5, 3.0, 6.0)]
    # constants from 240 samples of 1 % noise: predictions are off by less than 1 %
    np.testing.assert_allclose(fitted.predict(data), np.concatenate(exact), rtol=0.01)
    matrix = fitted.correlation.to_numpy()
    # exact by construction but for rounding
    np.testing.assert_allclose(np.diag(matrix), 1.0, rtol=1e-12)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    assert np.all(np.abs(matrix) <= 1.0 + 1e-12)
    # modulus and time of start-ups trade against each other
    assert fitted.correlation.loc["modulus_Pa", "relaxation_time_s"] < -0.3


def test_a_yield_stress_is_found_in_creep_from_the_starts_of_the_fit_itself():
    # an elastic Bingham solid in closed form: γ = σ/G, and above τ_y flow at (σ − τ_y)/η besides;
    # rates are so slow (λγ̇ < 0.06) that normal stresses, which Saramito's has, are below the noise
    modulus, viscosity, yield_stress, times = 1000.0, 20.0, 50.0, np.linspace(0.02, 10.0, 60)
    lot, frames = np.random.default_rng(4), []
    for stress in (20.0, 40.0, 70.0, 100.0):
        strain = stress / modulus + max(stress - yield_stress, 0.0) / viscosity * times
        table = {"run": f"{stress:g}", "time_s": times, "stress_Pa": stress}
        frames.append(pd.DataFrame(table | {"strain": white(strain, NOISE, lot)}))
    runs = pd.DataFrame({"run": [one["run"][0] for one in frames], "control": "stress"})
    found = dc.fit("saramito", dc.from_dataframe(pd.concat(frames), runs))
    # the misfit is the noise, to a tenth as of 240 samples; a wrong start ends at 30 %
    assert found.error == pytest.approx(NOISE, rel=0.2)
    told = found.summary()["value"]
    assert told["modulus_Pa"] * told["yield_strain"] == pytest.approx(yield_stress, rel=0.05)


def oldroyd_b(rate, times, viscosity=12.0, modulus=50.0, time=1.2):
    """Closed form of the upper-convected Maxwell start-up beside a solvent."""
    return rate * (modulus * time * (1.0 - np.exp(-times / time)) + viscosity)


def assert_the_solvent_is_found(data):
    found = dc.fit("ucm", data, effects={"solvent_viscosity": "fit"})
    name = next(name for name in found.summary().index if name.startswith("solvent_viscosity"))
    low, high = found.conf_int(0.999).loc[name]
    assert low < 12.0 < high
    assert found.use["solvent_viscosity_Pa_s"] == pytest.approx(12.0, rel=0.1)


def test_a_solvent_is_found_beside_a_mode_and_one_that_is_fitted_is_the_whole_one():
    assert_the_solvent_is_found(data_of(oldroyd_b, (0.3, 1.0)))
    omega = np.geomspace(0.01, 100.0, 25)
    sweep = pd.DataFrame(maxwell_sweep([50.0], [1.2], omega))
    sweep["Gpp_Pa"] += 12.0 * omega
    data = data_of(oldroyd_b, (0.3, 1.0), sweep=sweep)
    assert dc.Fluid.from_sweep(data.linear_sweep).solvent_viscosity == pytest.approx(12.0, rel=0.1)
    assert_the_solvent_is_found(data)  # and not zero, beside the solvent of the sweep


def test_a_wrong_law_a_constant_at_its_end_and_a_fixed_one_are_said(data):
    found = dc.fit("giesekus", data, bounds={"alpha": (0.0, 0.1)})
    assert found.summary().loc["alpha", "at_bound"]
    assert found.text.count("end of its range: alpha") == 1
    found = dc.fit("giesekus", data, fixed={"alpha": 0.25})
    # a simulation needs it as well as those that were fitted
    assert found.use["constants"]["alpha"] == {"value": 0.25, "ci95": None, "unit": "1"}
    assert "α = 0.25" in found.text
    assert list(found.summary().index) == ["modulus_Pa", "relaxation_time_s"]
    wrong = dc.fit("ucm", data, held_out=["6"])
    assert not wrong.fits_to_the_noise
    assert wrong.text.count("systematic") == 1


@pytest.mark.usefixtures("as_users_run_it")
@pytest.mark.parametrize(
    ("law", "options", "said"),
    [
        ("gisekus", {}, "Did you mean 'giesekus'"),
        ("giesekus", {"bounds": {"alfa": (0.0, 1.0)}}, "Did you mean 'alpha'"),
        ("giesekus", {"bounds": {"alpha": (1.0, 0.0)}}, "increasing"),
        ("giesekus", {"start": {"alpha": "0.1"}}, "finite number"),
        ("giesekus", {"start": {"alpha": 0.1}, "fixed": {"alpha": 0.1}}, "Choose one"),
        ("giesekus", {"held_out": "each"}, "close_loop"),
    ],
)
def test_a_wrong_argument_is_refused_with_the_remedy(data, law, options, said):
    with pytest.raises(dc.InputError, match=said):
        dc.fit(law, data, **options)


def test_the_command_writes_page_json_and_equation(data, tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    for run in data.runs:
        table = {"time_s": run.time, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
        pd.DataFrame(table).to_csv(folder / f"{run.name}.csv", index=False)
    (folder / "runs.csv").write_text("file\n" + "".join(f"{r.name}.csv\n" for r in data.runs))
    out = tmp_path / "out"
    invoke("fit", "giesekus", folder, "--held-out", "6.csv", "--out", out, code=0)
    written = json.loads((out / "fit.json").read_text())
    keys = {"law", "constants", "modes", "solvent_viscosity_Pa_s", "range", "expected_error"}
    assert keys <= set(written["use"])
    assert written["use"]["constants"]["alpha"]["value"] == pytest.approx(MOBILITY, rel=0.05)
    assert "Fits within the noise of" in (out / "report.html").read_text()
    assert (out / "equations.tex").exists()
    assert (out / "figures" / "runs.svg").exists()
    invoke("export", out, "--out", tmp_path / "law.py", code=0)
    assert "Fits within the noise of" in (tmp_path / "law.py").read_text("utf-8")
    law = runpy.run_path(str(tmp_path / "law.py"))
    times = np.geomspace(0.1, 6.0, 9)
    stress = law["simulate_shear"](lambda t: 6.0, times)[0]
    wanted = giesekus_start_up(6.0, times)
    # 1 % of noise leaves the constants open by some per cent (above)
    assert np.max(np.abs(stress - wanted)) < 0.03 * np.max(wanted)


def test_a_fit_has_the_answer_of_the_other_commands(fitted):
    use = fitted.use
    # start-ups of 0.5, 1.5 and 3 were fitted, that of 6 was held out
    assert use["range"]["rate_1_s"] == [0.5, 3.0]
    # twice as fast as any that was fitted; 1 % of noise is in its error, and is subtracted
    beyond = use["expected_error_beyond"]["sigma12"]
    assert beyond**2 + fitted.noise**2 == pytest.approx(fitted.held_out_error**2)
    assert use["expected_error"]["N2"] is None
    assert fitted.adequate
    assert fitted.answer.headline.startswith("Giesekus, α = 0.3")
    assert any("Fits within the noise of" in note for note in fitted.answer.equation.notes)


@pytest.mark.parametrize(("measured_at", "said"), [((25.0, 25.2), 25.0), ((25.0, 40.0), None)])
def test_constants_are_those_of_the_temperature_of_the_runs(measured_at, said):
    runs = pd.DataFrame({"file": ["0.5", "2"], "temperature_C": measured_at})
    found = dc.fit("giesekus", data_of(giesekus_start_up, (0.5, 2.0), runs=runs))
    assert found.use["temperature_C"] == said
    assert ("at 25 °C" in found.text) is (said is not None)


def test_n1_that_runs_recorded_and_the_fit_did_not_see_is_compared(data):
    def with_n1(run, factor):
        normal = Giesekus(MOBILITY, MODULUS, TIME).respond(start_up(run.rate[0]), run.time).N1
        return replace(run, first_normal_stress_difference=factor * normal)

    for factor, missed in ((1.0, 0.0), (0.8, 0.25)):
        runs = tuple(with_n1(run, factor) for run in data)
        found = dc.fit("giesekus", dc.Dataset("both", runs))
        # a law that misses by (1 − f)/f of the record; α by 2 % of N1
        assert found.use["expected_error"]["N1"] == pytest.approx(missed, abs=0.02)
