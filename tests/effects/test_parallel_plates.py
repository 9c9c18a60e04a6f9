"""Torque between parallel plates, averaged by numpy over twelve radii of fluids that scipy solved.

The apparent stress of an export is 2M/(πR³) = 4 ∫ x² σ(x γ̇) dx [Bird, Armstrong & Hassager 1987,
eq. 10.2-15]: that of a Newtonian fluid of the same torque.
"""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus, PhanThienTanner
from independent.flow import Flow, oscillation, start_up
from independent.folders import write_folder
from independent.instruments import Instrument
from vectors import vector_of

import discover as dc
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.inference.engine import Problem, explain
from discover.loop.runs import split_runs
from discover.loop.task import candidates_of

MODULUS, TIME, NOISE, SAMPLES = 140.0, 0.9, 0.01, 100
FLUIDS = {
    "giesekus_mobility": Giesekus(0.3, MODULUS, TIME),
    "ptt_linear": PhanThienTanner(0.15, modulus=MODULUS, relaxation_time=TIME),
}
FLOWS = {
    "a.csv": (start_up(1.0), 6.0),
    "b.csv": (start_up(4.0), 4.0),
    "c.csv": (oscillation(2.0, 1.0), 12.0),
    "d.csv": (oscillation(4.0, 1.5), 8.0),
}
CANDIDATES = [
    "giesekus_mobility", "ptt_linear", "ptt_exponential", "non_affine_motion", "parallel_plates",
    "stress_gain", "rate_gain", "transducer_lag", "time_delay", "wall_slip", "thixotropy",
]  # fmt: skip


def shear_stress(fluid, flow, times, plates):
    """Return what an instrument calls the stress, of a cone or of plates, without noise."""
    if not plates:
        return Instrument().record(fluid, flow, times).stress
    radii, weights = np.polynomial.legendre.leggauss(12)
    total = 0.0
    for x, weight in zip((radii + 1) / 2, weights / 2, strict=True):
        inner = Flow(lambda t, x=x: x * flow.rate(t), lambda t, x=x: x * flow.strain(t), flow.jumps)
        total = total + 4 * weight * x**2 * Instrument().record(fluid, inner, times).stress
    return total


def explained(folder, name, plates):
    lot, runs = np.random.default_rng(5), {}
    for file, (flow, end) in FLOWS.items():
        times = np.linspace(0.04, end, SAMPLES)
        stress = shear_stress(FLUIDS[name], flow, times, plates)
        stress = stress + NOISE * np.sqrt(np.mean(stress**2)) * lot.standard_normal(SAMPLES)
        run = Instrument().record(FLUIDS[name], flow, times)
        runs[file] = replace(run, stress=stress, N1=None, N2=None)
    data = dc.load_dataset(write_folder(folder / "data", runs))
    fitted, _, _ = split_runs(data, None, [], None, 400)
    problem = Problem(DeclaredModel.maxwell([MODULUS], [TIME]), candidates_of(CANDIDATES), fitted)
    return problem, explain(problem)


@pytest.mark.parametrize(
    ("flow", "protocol"),
    [(start_up(4.0), dc.start_up(4.0)), (oscillation(3.0, 1.2), dc.oscillatory_shear(3.0, 1.2))],
)
def test_torque_is_that_of_twelve_radii(flow, protocol):
    times = np.linspace(0.05, 6.0, 60)
    expected = shear_stress(FLUIDS["giesekus_mobility"], flow, times, plates=True)
    rate = np.array([flow.rate(t) for t in times])
    run = dc.Run("plates", times, protocol, rate, expected)
    effects = [make_effect(n) for n in ("giesekus_mobility", "parallel_plates", "stress_offset")]
    model = AugmentedModel(DeclaredModel.maxwell([MODULUS], [TIME]), effects)
    theta = vector_of(model, giesekus_mobility=0.3, parallel_plates=1.0)
    batch = make_batch([run])
    found = model.predict(theta, batch)[0, : len(times)]
    # Radau's rule with four nodes, of a stress over the rate that falls to a third
    assert np.max(np.abs(found - expected)) < 2e-3 * np.max(np.abs(expected))
    theta[model.positions("stress_offset")[0]] = 5.0
    # a zero of the transducer is one of the torque, whatever the radii
    assert model.predict(theta, batch)[0, : len(times)] == pytest.approx(found + 5.0, abs=1e-9)


@pytest.mark.parametrize(("name", "value"), [("giesekus_mobility", 0.3), ("ptt_linear", 0.15)])
def test_plates_without_correction_are_told_and_the_law_is_right(tmp_path, name, value):
    problem, posterior = explained(tmp_path, name, plates=True)
    assert posterior.verdict != "unexplained"
    assert {name, "parallel_plates"} in map(set, posterior.explanations[0].members)
    assert posterior.explanations[0].probability > 0.5
    for effect, truth in ((name, value), ("parallel_plates", 1.0)):
        low, high = posterior.interval(problem.model.positions(effect)[0])
        assert low <= truth <= high


@pytest.mark.parametrize("name", ["giesekus_mobility", "ptt_linear"])
def test_plates_are_not_told_of_a_cone(tmp_path, name):
    _, posterior = explained(tmp_path, name, plates=False)
    assert posterior.explanations[0].members[0] == (name,)
