"""`compare` and `close-loop` give one answer to one question: records by scipy in one folder."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, multimode_giesekus, oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import white

import discover as dc

MODULUS, MOBILITY = 100.0, 0.3
FLOWS = {
    "up.csv": (start_up(1.0), 6.0),
    "fast_up.csv": (start_up(3.0), 5.0),
    "wide.csv": (oscillation(3.0, 0.5), 14.0),
}
HELD_OUT = {"faster_up.csv": (start_up(5.0), 4.0)}
EFFECTS = ["giesekus_mobility", "stress_gain", "ptt_linear"]


def asked(tmp_path, material, recorded):
    """Return what both say of a material whose stress is recorded so, told a Maxwell fluid."""
    generator = np.random.default_rng(5)
    runs = {}
    for name, (flow, end) in {**FLOWS, **HELD_OUT}.items():
        record = Instrument().record(material, flow, np.linspace(0.02, end, 60))
        runs[name] = replace(record, stress=recorded(record.stress, generator))
    data = dc.load_dataset(write_folder(tmp_path / "data", runs))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0)
    compared = dc.compare(
        data, base, held_out=list(HELD_OUT), learners=["tensor_sindy"], library={"degree": 0}
    )
    looped = dc.close_loop(
        data, base, held_out=list(HELD_OUT), effects=EFFECTS, max_effects=2, explanations=1
    )
    return compared, looped


def noisy(stress, generator):
    return white(stress, 0.01, generator)


@pytest.mark.slow
def test_of_two_modes_told_one_neither_has_an_explanation(tmp_path):
    two = multimode_giesekus([0.1, 0.6], [60.0, 40.0], [1.0, 0.3])
    compared, looped = asked(tmp_path, two, noisy)
    assert (compared.verdict, looped.verdict) == ("unexplained", "unexplained")


@pytest.mark.slow
def test_in_noise_neither_finds_a_signal(tmp_path):
    compared, looped = asked(
        tmp_path, Giesekus(MOBILITY), lambda s, g: 5.0 * g.standard_normal(len(s))
    )
    assert (compared.verdict, looped.verdict) == ("no_signal", "no_signal")
    assert compared.lack_of_fit["tensor_sindy"].verdict == "no_signal"
