"""What the loop says of amplitude sweeps and of the linear sweep, on data by scipy."""

import numpy as np
import pytest
from independent.folders import maxwell_sweep, write_table
from independent.sweeps import giesekus_modulus

import discover as dc
from discover.report.predictions import loop_predictions
from discover.study import parse_study
from discover.study.data import load_study_data

MODULUS, TIME, NOISE, FREQUENCY = 100.0, 1.0, 0.01, 2.0
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "stress_gain", "stress_offset"]
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
STRAINS = np.geomspace(0.05, 10.0, 24)


def sweep_folder(folder, mobility):
    if mobility:
        exact = [giesekus_modulus(mobility, MODULUS, TIME, s, FREQUENCY) for s in STRAINS]
    else:
        x = FREQUENCY * TIME
        exact = [MODULUS * (x**2 + 1j * x) / (1.0 + x**2)] * len(STRAINS)
    noise = NOISE * np.random.default_rng(0).standard_normal((2, len(STRAINS)))
    columns = {
        "strain": STRAINS,
        "omega_rad_s": np.full(len(STRAINS), FREQUENCY),
        "Gp_Pa": np.real(exact) * (1.0 + noise[0]),
        "Gpp_Pa": np.imag(exact) * (1.0 + noise[1]),
    }
    write_table(folder / "amplitude_sweep.csv", columns)
    return folder


@pytest.mark.slow
def test_a_mobility_is_found_in_an_amplitude_sweep_alone_and_holds_in_the_linear_limit(tmp_path):
    folder, omega = sweep_folder(tmp_path, 0.3), np.geomspace(0.1, 10.0, 24)
    write_table(folder / "lve.csv", maxwell_sweep([MODULUS], [TIME], omega))
    keys = {"amplitude_sweep": "fit", "lve": "judge"}
    data = load_study_data(parse_study({"data": {"folder": str(folder), **keys}}))
    loop = dc.close_loop(data.fit, BASE, held_out=data.held_out, effects=EFFECTS)
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low <= 0.3 <= high
    # a mobility of 0 is far outside, and the noise alone is left
    assert low > 0.2
    assert loop.error_after.fit == pytest.approx(NOISE, rel=0.3)
    assert {record.name: record.held_out for record in loop.records} == {
        "amplitude_sweep.csv (storage_modulus)": False,
        "amplitude_sweep.csv (loss_modulus)": False,
        "lve.csv (storage_modulus)": True,
        "lve.csv (loss_modulus)": True,
    }
    # the linear sweep is exact, and is predicted at a strain of 0.01; the gain of the transducer,
    # fitted along, is told to the noise over the root of 48 values, of which two deviations
    assert loop.error_after.held_out < 2.0 * NOISE / np.sqrt(48)
    table = loop_predictions(loop)
    assert set(table["quantity"]) == {"storage_modulus", "loss_modulus"}
    sweep = table[table["run"] == "lve.csv (loss_modulus)"]
    # amplitudes: their quotient is the frequency
    np.testing.assert_allclose(sweep["rate_1_s"][:24] / sweep["strain"][:24], omega, rtol=1e-6)
    page = loop.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "strain amplitude" in page
    assert "frequency (rad/s)" in page
    assert "time (s)" not in page


@pytest.mark.slow
def test_nothing_is_found_in_the_amplitude_sweep_of_the_declared_fluid(tmp_path):
    data = dc.load_dataset(sweep_folder(tmp_path, 0.0)).with_material_functions()
    loop = dc.close_loop(data, BASE, effects=EFFECTS)
    assert loop.verdict == "no_effect_needed"
