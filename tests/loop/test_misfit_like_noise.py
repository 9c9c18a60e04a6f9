"""A smooth misfit that passes for noise of a high correlation is none: records by scipy."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import correlated, white

import discover as dc
from discover.statistics.lack_of_fit import what_is_left

FLOWS = {
    "up.csv": (start_up(1.0), 6.0),
    "fast_up.csv": (start_up(3.0), 5.0),
    "wide.csv": (oscillation(3.0, 0.5), 14.0),
}
EFFECTS = ["giesekus_mobility", "stress_gain", "ptt_linear"]


def looped(tmp_path, recorded, effects=EFFECTS):
    """Return what is said of a Giesekus fluid whose stress is recorded so, told a Maxwell fluid."""
    generator = np.random.default_rng(5)
    runs = {}
    for name, (flow, end) in FLOWS.items():
        record = Instrument().record(Giesekus(0.3, 100.0), flow, np.linspace(0.02, end, 60))
        runs[name] = replace(record, stress=recorded(record.stress, generator))
    data = dc.load_dataset(write_folder(tmp_path / "data", runs))
    base = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0)
    return dc.close_loop(data, base, effects=effects, max_effects=2, explanations=1)


def gained(stress, generator):
    return 1.1 * white(stress, 0.01, generator)


@pytest.mark.slow
def test_a_gain_is_found_though_what_a_mobility_leaves_looks_like_noise(tmp_path):
    alone = looped(tmp_path, gained, EFFECTS[:1])
    rows = [r.predicted[-1] - r.measured for r in alone.records]
    left = what_is_left(rows, [r.measured for r in alone.records])
    # four times the noise, and yet no test tells it from noise
    assert left.misfit > 3.0 * 0.01
    assert left.verdict == "explained"
    found = {s.effect: s for s in looped(tmp_path / "both", gained).stages}
    assert set(found) == {"giesekus_mobility", "stress_gain"}
    low, high = found["stress_gain"].parameters["gain_error"].ci95
    assert low < 0.1 < high
    low, high = found["giesekus_mobility"].parameters["alpha"].ci95
    assert low < 0.3 < high


@pytest.mark.slow
def test_noise_of_a_high_correlation_is_no_second_effect(tmp_path):
    result = looped(tmp_path, lambda s, g: correlated(s, 0.02, 0.9, g))
    assert [s.effect for s in result.stages] == ["giesekus_mobility"]
