"""What transducers and plates do to records, on fluids that scipy simulated.

Each transducer has a gain, and may be read more often than it has values. Between plates the
apparent stress of an export is 2M/(πR³) = 4 ∫ x² σ(x γ̇) dx [Bird, Armstrong & Hassager 1987,
eq. 10.2-15]: that of a Newtonian fluid of the same torque, summed here over twelve radii.
"""

from dataclasses import replace

import numpy as np
import pytest
from explained import explain
from hostile_benches import PlatePlate
from independent import Giesekus, PhanThienTanner
from independent.flow import oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from independent.noise import white
from vectors import vector_of

import discover as dc
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.inference import Problem
from discover.loop.runs import split_runs
from discover.loop.task import candidates_of

MODULUS, TIME, MOBILITY, NOISE, SAMPLES = 180.0, 0.7, 0.25, 0.01, 120
GIESEKUS = Giesekus(MOBILITY, MODULUS, TIME)
FLOWS = {
    "a.csv": (start_up(1.2), 5.0),
    "b.csv": (start_up(3.5), 4.0),
    "c.csv": (oscillation(1.6, 0.8), 12.0),
    "d.csv": (oscillation(3.0, 1.3), 10.0),
}
CANDIDATES = ["giesekus_mobility", "stress_gain", "rate_gain", "normal_force_gain",
              "transducer_lag", "time_delay", "stress_offset"]  # fmt: skip


def explained_of(folder, record, candidates, with_force=False):
    """Return the problem of what is recorded of each flow at some times, and its posterior.

    `with_force`: whether N1 is fitted beside the shear stress.
    """
    runs = {n: record(flow, np.linspace(0.03, end, SAMPLES)) for n, (flow, end) in FLOWS.items()}
    data = dc.load_dataset(write_folder(folder / "data", runs, normal_stresses=with_force))
    if with_force:
        also = tuple(run.observing("N1") for run in data.runs)
        data = replace(data, runs=(*data.runs, *also))
    fitted, _, _ = split_runs(data, None, [], None, 400)
    problem = Problem(DeclaredModel.maxwell([MODULUS], [TIME]), candidates_of(candidates), fitted)
    return problem, explain(problem)


def explained(folder, instrument, force=1.0, hold=1, with_force=False):
    """Return the problem of a Giesekus fluid's records, and its posterior.

    `force`: by what N1 is multiplied. `hold`: samples in which each value stands.
    """
    lot, held = np.random.default_rng(0), np.arange(SAMPLES) // hold * hold

    def record(flow, times):
        run = instrument.record(GIESEKUS, flow, times)
        stress, normal = (white(one, NOISE, lot)[held] for one in (run.stress, run.N1))
        return replace(run, stress=stress, N1=force * normal, N2=None)

    return explained_of(folder, record, CANDIDATES, with_force)


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


FLUIDS = {
    "giesekus_mobility": (GIESEKUS, MOBILITY),
    "ptt_linear": (PhanThienTanner(0.15, modulus=MODULUS, relaxation_time=TIME), 0.15),
}
BESIDE_PLATES = [
    "giesekus_mobility", "ptt_linear", "ptt_exponential", "non_affine_motion", "parallel_plates",
    "stress_gain", "rate_gain", "transducer_lag", "time_delay", "wall_slip", "thixotropy",
]  # fmt: skip


def of_plates(fluid, flow, times):
    """Return what an instrument with plates calls the stress, without noise."""
    return PlatePlate(fluid, points=12).respond(flow, times).sigma12


@pytest.mark.parametrize(
    ("flow", "protocol"),
    [(start_up(4.0), dc.start_up(4.0)), (oscillation(3.0, 1.2), dc.oscillatory_shear(3.0, 1.2))],
)
def test_torque_is_that_of_twelve_radii(flow, protocol):
    times = np.linspace(0.05, 6.0, 60)
    expected = of_plates(GIESEKUS, flow, times)
    rate = np.array([flow.rate(t) for t in times])
    run = dc.Run("plates", times, protocol, rate, expected)
    effects = [make_effect(n) for n in ("giesekus_mobility", "parallel_plates", "stress_offset")]
    model = AugmentedModel(DeclaredModel.maxwell([MODULUS], [TIME]), effects)
    theta = vector_of(model, giesekus_mobility=MOBILITY, parallel_plates=1.0)
    batch = make_batch([run])
    found = model.predict(theta, batch)[0, : len(times)]
    # Radau's rule with four nodes, of a stress over the rate that falls to a third
    assert np.max(np.abs(found - expected)) < 2e-3 * np.max(np.abs(expected))
    theta[model.positions("stress_offset")[0]] = 5.0
    # a zero of the transducer is one of the torque, whatever the radii
    assert model.predict(theta, batch)[0, : len(times)] == pytest.approx(found + 5.0, abs=1e-9)


@pytest.mark.parametrize("plates", [True, False])
@pytest.mark.parametrize("name", FLUIDS)
def test_plates_without_correction_are_told_and_not_of_a_cone(tmp_path, name, plates):
    (fluid, value), lot = FLUIDS[name], np.random.default_rng(5)

    def record(flow, times):
        run = Instrument().record(fluid, flow, times)
        stress = of_plates(fluid, flow, times) if plates else run.stress
        return replace(run, stress=white(stress, NOISE, lot), N1=None, N2=None)

    problem, posterior = explained_of(tmp_path, record, BESIDE_PLATES)
    if not plates:
        assert posterior.explanations[0].members[0] == (name,)
        return
    assert posterior.verdict != "unexplained"
    assert {name, "parallel_plates"} in map(set, posterior.explanations[0].members)
    assert posterior.explanations[0].probability > 0.5
    assert holds(problem, posterior, name, value)
    assert holds(problem, posterior, "parallel_plates", 1.0)
