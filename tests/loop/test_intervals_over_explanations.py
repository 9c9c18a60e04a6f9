"""A constant's interval holds whichever explanation is right, on records by scipy."""

import numpy as np
import pytest
from independent import PhanThienTanner, oscillation, start_up

import discover as dc
from discover.closed_loop.explanations.bands.wider_intervals import _ends
from discover.protocols.protocol import shear_rates

MODULUS, GAIN, EPSILON, NOISE = 100.0, 0.14, 0.15, 0.01
FLOWS = {
    "up": (start_up(2.0), 8.0),
    "fast": (start_up(5.0), 6.0),
    "wave": (oscillation(4, 1), 12.0),
}
MATERIAL = PhanThienTanner(EPSILON, "exponential")
PROTOCOLS = {
    "up": dc.start_up(2.0),
    "fast": dc.start_up(5.0),
    "wave": dc.oscillatory_shear(4.0, 1.0),
}


def loop(gain):
    """Close the loop on an exponential PTT fluid whose stress is read too large by a factor."""
    generator = np.random.default_rng(3)
    runs = []
    for name, (flow, end) in FLOWS.items():
        times = np.linspace(0.05, end, 80)
        stress = MODULUS * MATERIAL.respond(flow, times).sigma12
        noise = NOISE * np.sqrt(np.mean(stress**2)) * generator.standard_normal(times.size)
        rates = shear_rates(PROTOCOLS[name], times)
        record = (1.0 + gain) * (stress + noise)
        runs.append(dc.Run(name, times, PROTOCOLS[name], rates, record))
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0)
    effects = ["rate_gain", "stress_gain", "ptt_exponential"]
    return dc.close_loop(dc.Dataset("planted", tuple(runs)), base, effects=effects, max_effects=2)


@pytest.mark.slow
def test_a_constant_holds_whichever_twin_of_the_effect_beside_it_is_right():
    found = loop(GAIN)
    stages = {stage.effect: stage for stage in found.stages}
    epsilon = stages["ptt_exponential"].parameters["epsilon"]
    assert epsilon.ci95[0] <= EPSILON <= epsilon.ci95[1]
    # a rate read too large leaves the same records with another ε: one gain alone would not do
    given = epsilon.ci95_given_effects
    assert epsilon.ci95[1] - epsilon.ci95[0] > 3.0 * (given[1] - given[0])


@pytest.mark.slow
def test_where_one_explanation_is_left_its_interval_stays():
    (stage,) = loop(0.0).stages  # the control
    epsilon = stage.parameters["epsilon"]
    assert stage.effect == "ptt_exponential"
    assert epsilon.ci95[0] <= EPSILON <= epsilon.ci95[1]
    assert epsilon.ci95 == pytest.approx(epsilon.ci95_given_effects, rel=1e-6)


def test_the_ends_are_those_of_draws_from_the_mixture():
    values, weights = np.array([1.0, 1.3]), np.array([0.7, 0.3])
    found = _ends(values, weights, 0.2, 0.1)
    rng = np.random.default_rng(0)
    z = rng.standard_normal(400_000) / 1.959964
    drawn = rng.choice(values, p=weights, size=z.size) + np.where(z < 0.0, 0.2, 0.1) * z
    # 400,000 draws know a percentile to about 1e-3 of the width
    np.testing.assert_allclose(found, np.percentile(drawn, [2.5, 97.5]), atol=2e-3)
