"""What transducers do to records, on fluids that scipy simulated: each has a gain, and may be read
more often than it has values."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus
from independent.flow import oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument

import discover as dc
from discover.forward import DeclaredModel
from discover.inference.engine import Problem, explain
from discover.loop.runs import split_runs
from discover.loop.task import candidates_of

MODULUS, TIME, MOBILITY, NOISE, SAMPLES = 180.0, 0.7, 0.25, 0.01, 120
FLOWS = {
    "a.csv": (start_up(1.2), 5.0),
    "b.csv": (start_up(3.5), 4.0),
    "c.csv": (oscillation(1.6, 0.8), 12.0),
    "d.csv": (oscillation(3.0, 1.3), 10.0),
}
CANDIDATES = ["giesekus_mobility", "stress_gain", "rate_gain", "normal_force_gain",
              "transducer_lag", "time_delay", "stress_offset"]  # fmt: skip


def noisy(values, lot):
    return values + NOISE * np.sqrt(np.mean(values**2)) * lot.standard_normal(len(values))


def explained(folder, instrument, force=1.0, hold=1, with_force=False):
    """Return the problem of a Giesekus fluid's records, and its posterior.

    `force`: by what N1 is multiplied. `hold`: samples in which each value stands. `with_force`:
    whether N1 is fitted beside the shear stress.
    """
    lot, held, runs = np.random.default_rng(0), np.arange(SAMPLES) // hold * hold, {}
    for name, (flow, end) in FLOWS.items():
        times = np.linspace(0.03, end, SAMPLES)
        run = instrument.record(Giesekus(MOBILITY, MODULUS, TIME), flow, times)
        stress, normal = noisy(run.stress, lot)[held], force * noisy(run.N1, lot)[held]
        runs[name] = replace(run, stress=stress, N1=normal, N2=None)
    data = dc.load_dataset(write_folder(folder / "data", runs, normal_stresses=with_force))
    if with_force:
        also = tuple(run.observing("N1") for run in data.runs)
        data = replace(data, runs=(*data.runs, *also))
    fitted, _, _ = split_runs(data, None, [], None, 400)
    problem = Problem(DeclaredModel.maxwell([MODULUS], [TIME]), candidates_of(CANDIDATES), fitted)
    return problem, explain(problem)


def names_of(posterior):
    assert posterior.verdict != "unexplained"
    assert posterior.explanations[0].probability > 0.5
    return posterior.explanations[0].members[0]


def holds(problem, posterior, effect, value):
    low, high = posterior.interval(problem.model.positions(effect)[0])
    return low <= value <= high


@pytest.mark.parametrize("lag", [0.0, 0.12])
def test_a_value_that_is_read_twice_is_no_lag_and_a_lag_remains_one(tmp_path, lag):
    problem, posterior = explained(tmp_path, Instrument(lag=lag), hold=2)
    assert len(problem.fitted) == len(FLOWS) * SAMPLES // 2  # what is read again says nothing new
    assert names_of(posterior) == ("giesekus_mobility", *(["transducer_lag"] if lag else []))
    assert holds(problem, posterior, "giesekus_mobility", MOBILITY)
    assert not lag or holds(problem, posterior, "transducer_lag", lag)


@pytest.mark.parametrize("of_force", [0.15, pytest.param(-0.12, marks=pytest.mark.slow)])
def test_a_normal_force_that_reads_wrong_is_told_and_the_torque_is_not(tmp_path, of_force):
    problem, posterior = explained(tmp_path, Instrument(), 1.0 + of_force, with_force=True)
    assert names_of(posterior) == ("giesekus_mobility", "normal_force_gain")
    assert holds(problem, posterior, "normal_force_gain", of_force)
    assert holds(problem, posterior, "giesekus_mobility", MOBILITY)


@pytest.mark.parametrize("of_torque", [0.0, 0.12])
def test_a_sound_normal_force_is_not_named_and_a_torque_that_reads_wrong_is(tmp_path, of_torque):
    problem, posterior = explained(tmp_path, Instrument(gain=of_torque), with_force=True)
    assert names_of(posterior) == (
        "giesekus_mobility", *(["stress_gain"] if of_torque else []),
    )  # fmt: skip
    assert not of_torque or holds(problem, posterior, "stress_gain", of_torque)
