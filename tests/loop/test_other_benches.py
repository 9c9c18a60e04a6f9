"""Effects in whose place a bench that is a little off does as well: data by scipy."""

import numpy as np
import pytest
from independent import Giesekus
from independent.flow import oscillation, start_up
from independent.folders import with_noise, write_folder
from independent.instruments import Instrument

import discover as dc
from discover.closed_loop.explanations.other_benches import BENCH

FLOWS = {
    "slow.csv": (start_up(0.5), np.linspace(0.1, 8.0, 80)),
    "fast.csv": (start_up(2.0), np.linspace(0.1, 8.0, 80)),
    "wave.csv": (oscillation(2.0, 1.0), np.linspace(0.1, 12.0, 120)),
    "unseen.csv": (start_up(3.0), np.linspace(0.1, 8.0, 80)),
}
# gains of rate and stress are no candidates, and a bench may have them all the same
EFFECTS = ["giesekus_mobility", "tool_compliance", "transducer_lag"]


def loop_of(folder, **faults):
    """Return the loop over records of a Giesekus fluid of 0.3 with 1 % of noise."""
    instrument = Instrument(**faults)
    runs = {name: instrument.record(Giesekus(0.3, 100.0, 1.0), *own) for name, own in FLOWS.items()}
    data = dc.load_dataset(write_folder(folder, with_noise(runs, 0.01, np.random.default_rng(0))))
    return dc.close_loop(
        data,
        dc.Fluid(dc.make_law("ucm"), 100.0, 1.0),
        held_out=["unseen.csv"],
        effects=EFFECTS,
        max_effects=2,
        explanations=3,
    )


def test_a_clock_that_is_fast_is_no_tool_that_yields(tmp_path):
    # a clock that is 2 % fast is rates 2 % less and times 2 % more than told
    loop = loop_of(tmp_path, clock_slip=0.02)
    named = loop.explanations.inclusion
    assert named["giesekus_mobility"] > 0.8
    assert max([0.0, *(p for name, p in named.items() if name != "giesekus_mobility")]) < 0.5
    beside = next(one for one in loop.explanations.likeliest_first if one.bench)
    assert beside.effects == ("giesekus_mobility",)
    # at small rates a stress that reads less is like a rate that is less
    factor = beside.bench["rates"] + beside.bench["stresses"]
    assert factor == pytest.approx(-0.02, abs=0.008)
    assert beside.bench["relaxation times"] == pytest.approx(0.02, abs=0.008)
    assert all(BENCH in s.aliases for s in loop.stages if s.effect != "giesekus_mobility")
    assert "check gap, calibration and temperature" in loop.remaining["description"]


def test_a_lag_is_no_fault_that_all_runs_share(tmp_path):
    loop = loop_of(tmp_path, lag=0.05)
    lag = next(stage for stage in loop.stages if stage.effect == "transducer_lag")
    assert BENCH not in lag.aliases
    assert loop.explanations.inclusion["transducer_lag"] > 0.8
    assert not any(one.bench for one in loop.explanations.likeliest_first)
