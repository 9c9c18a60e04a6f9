"""Two modes, of which one follows another law: by scipy, told by the right linear spectrum."""

import numpy as np
import pytest
from independent import Giesekus, Modes, PhanThienTanner, start_up
from independent.folders import write_folder
from independent.instruments import Instrument

import discover as dc
from discover.report.loop.certainty import how_sure
from discover.report.plots.by_mode import by_mode_sentence

MODULUS, SLOW, FAST = 60.0, 1.0, 0.2
TIMES = np.linspace(0.1, 8.0, 80)
GIESEKUS = Giesekus(0.3, MODULUS, SLOW)
MIXED = Modes(GIESEKUS, PhanThienTanner(0.3, "linear", modulus=MODULUS, relaxation_time=FAST))
ALIKE = Modes(GIESEKUS, Giesekus(0.3, MODULUS, FAST))


def mobility_by_mode(folder, fluid, rates):
    runs, lot = {}, np.random.default_rng(1)
    for rate in rates:
        run = runs[f"at{rate:g}.csv"] = Instrument().record(fluid, start_up(rate), TIMES)
        size = 0.01 * np.sqrt(np.mean(run.stress**2))
        run.stress[:] += size * lot.standard_normal(len(TIMES))
    base = dc.Fluid(dc.make_law("ucm"), [MODULUS, MODULUS], [SLOW, FAST])
    loop = dc.close_loop(
        dc.load_dataset(write_folder(folder, runs)), base,
        effects=["giesekus_mobility"], max_effects=1, explanations=1,
    )  # fmt: skip
    return loop.by_mode["giesekus_mobility"], how_sure(loop)


def test_a_mode_that_the_flow_hardly_stretches_may_follow_another_law(tmp_path):
    found, sure = mobility_by_mode(tmp_path, MIXED, (0.5, 1.0, 2.0))
    slow, fast = found.modes
    assert slow.ci95[0] < 0.3 < slow.ci95[1]
    assert not slow.other_laws
    assert fast.left_open
    assert "ptt_linear" in fast.other_laws
    for said in (by_mode_sentence("giesekus_mobility", found), sure):
        assert "The law of the mode of 0.2 s is not determined by these data" in said


def test_control_runs_that_stretch_both_modes_tell_the_law_of_each(tmp_path):
    found, sure = mobility_by_mode(tmp_path, ALIKE, (1.0, 5.0, 12.0))
    assert not any(mode.other_laws or mode.left_open for mode in found.modes)
    for said in (by_mode_sentence("giesekus_mobility", found), sure):
        assert "not determined" not in said
