"""Bands of flow curves, sweeps, creep and relaxation hold what scipy planted, at either end."""

import numpy as np
import pytest
from independent import Giesekus
from independent.folders import maxwell_sweep, write_table
from independent.sweeps import giesekus_modulus

import discover as dc
from discover.report.predictions import loop_predictions
from discover.study import parse_study
from discover.study.data import load_study_data

MODULUS, TIME, NOISE, MOBILITY, FREQUENCY = 100.0, 1.0, 0.02, 0.3, 2.0
KINDS = ("flow_curve", "amplitude_sweep", "lve", "creep", "relaxation")
EFFECTS = ["giesekus_mobility", "ptt_linear", "non_affine_motion", "stress_gain", "stress_offset"]
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


def planted(folder, seed):
    """Write every kind of table of one Giesekus fluid, with noise in proportion to each value."""
    generator = np.random.default_rng(seed)

    def noisy(values):
        return np.real(values) * (1.0 + NOISE * generator.standard_normal(len(values)))

    rates, strains = np.geomspace(0.02, 20.0, 30), np.geomspace(0.05, 10.0, 20)
    omega, times = np.geomspace(0.02, 20.0, 25), np.geomspace(0.02, 5.0, 25)
    steady = [Giesekus(MOBILITY, MODULUS, TIME).steady_shear(rate)[0] for rate in rates]
    moduli = [giesekus_modulus(MOBILITY, MODULUS, TIME, s, FREQUENCY) for s in strains]
    linear = maxwell_sweep([MODULUS], [TIME], omega)
    tables = {
        "flow_curve": {"shear_rate_1_s": rates, "stress_Pa": noisy(steady)},
        "amplitude_sweep": {
            "strain": strains,
            "omega_rad_s": np.full(len(strains), FREQUENCY),
            "Gp_Pa": noisy(moduli),
            "Gpp_Pa": noisy(-1j * np.array(moduli)),
        },
        "lve": {key: v if key == "omega_rad_s" else noisy(v) for key, v in linear.items()},
        "creep": {"time_s": times, "compliance_1_Pa": noisy((1.0 + times / TIME) / MODULUS)},
        "relaxation": {
            "time_s": times,
            "relaxation_modulus_Pa": noisy(MODULUS * np.exp(-times / TIME)),
        },
    }
    for kind, columns in tables.items():
        write_table(folder / f"{kind}.csv", columns)
    return folder


def closed(folder, fit, seed=0):
    keys = {kind: "fit" if kind == fit else "judge" for kind in KINDS}
    study = parse_study({"data": {"folder": str(planted(folder, seed)), **keys}})
    data = load_study_data(study)
    return dc.close_loop(data.fit, BASE, held_out=data.held_out, effects=EFFECTS)


@pytest.mark.parametrize("fit", ["flow_curve", "amplitude_sweep"])
@pytest.mark.slow
def test_every_quantity_has_a_band_that_holds_and_is_as_wide_as_the_noise(tmp_path, fit):
    # one run of seed 0 is called structured, as 5 of 100 are, and its band has Student's tails
    loop = closed(tmp_path, fit, seed=1)
    table = loop_predictions(loop)
    found = table[table["source"] == "augmented"]
    assert set(found["run"].str.split(".").str[0]) == set(KINDS)
    assert np.all(np.isfinite(found[["low95", "high95"]]))
    held = (found["low95"] <= found["measured"]) & (found["measured"] <= found["high95"])
    # of some 170 samples 95 % within 4 deviations of a binomial
    assert np.mean(held) >= 0.88
    states = found[found["run"].str.contains("flow_curve|amplitude|lve")]
    width = 0.5 * (states["high95"] - states["low95"]) / states["measured"]
    # noise in proportion: 1.96 of it, wider by what runs that are left out in turn ask for; a noise
    # of one size for all would be 60 times the smallest modulus
    assert width.max() < 3.0 * 1.96 * NOISE
    assert width.min() > 0.6 * 1.96 * NOISE
    page = loop.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "95 % of measurements" in page


@pytest.mark.slow
def test_a_band_of_another_fluid_does_not_hold_its_flow_curve(tmp_path):
    """The control: a law without its mobility has a band too, and the curve leaves it."""
    folder = planted(tmp_path, 0)
    keys = {kind: "fit" if kind == "relaxation" else "judge" for kind in KINDS}
    data = load_study_data(parse_study({"data": {"folder": str(folder), **keys}}))
    options = {"effects": ["stress_gain"], "max_effects": 1, "explanations": 1}
    loop = dc.close_loop(data.fit, BASE, held_out=data.held_out, **options)
    assert loop.verdict == "unexplained"
    assert loop.held_in_band < 0.95
