"""What a comparison says of a flow curve, fitted or held out: records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, PhanThienTanner, start_up

import discover as dc
from discover.protocols.control import steady_rates
from discover.report.predictions import comparison_predictions

MODULUS, MOBILITY, NOISE = 100.0, 0.3, 0.01
RATES = np.geomspace(0.1, 20.0, 40)
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0)


def curve(material, rates=RATES):
    """Where start-ups of a material end, with noise in proportion."""
    ends = [material.respond(start_up(rate), np.array([0.0, 20.0, 40.0])) for rate in rates]
    stress = np.array([end.sigma12[-1] for end in ends])
    off = 1.0 + NOISE * np.random.default_rng(0).standard_normal(rates.size)
    counted = np.arange(1.0, rates.size + 1.0)
    return dc.Run("flow_curve.csv", counted, steady_rates(rates), rates, MODULUS * stress * off)


def start(material, rate):
    times = np.linspace(0.05, 6.0, 60)
    stress = MODULUS * material.respond(start_up(rate), times).sigma12
    generator = np.random.default_rng(int(rate))  # noise that runs share would be a pattern
    noise = NOISE * np.sqrt(np.mean(stress**2)) * generator.standard_normal(60)
    return dc.Run(f"at_{rate:g}", times, dc.start_up(rate), np.full(60, rate), stress + noise)


def compared(runs, **options):
    data = dc.Dataset("planted", tuple(runs))
    return dc.compare(data, BASE, learners=["tensor_sindy"], library={"degree": 0}, **options)


@pytest.mark.slow
def test_a_flow_curve_alone_gives_a_law_and_leaves_its_second_normal_stress_open():
    found = compared([curve(Giesekus(MOBILITY))])
    assert found.verdict == "explained"
    terms = {term.term: term for term in found.outcomes["tensor_sindy"].terms}
    low, high = terms["sigma.sigma"].ci95
    assert low <= MOBILITY <= high
    # N1 follows where the law is in the library; N2 has twins in it that give the same curve
    assert "N2" in found.undetermined
    table = comparison_predictions(found)
    sparse = table[(table["source"] == "tensor_sindy") & (table["quantity"] == "sigma12")]
    np.testing.assert_allclose(sparse["rate_1_s"], RATES)
    assert sparse["strain"].isna().all()  # a steady state does not know it
    # each sample is missed by its noise, over two decades of stress
    missed = sparse["value"].to_numpy() / sparse["measured"].to_numpy() - 1.0
    assert np.sqrt(np.mean(missed**2)) == pytest.approx(NOISE, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("held_out", ["its own", "another's"])
def test_a_flow_curve_held_out_refutes_what_two_start_ups_allow(held_out):
    material = Giesekus(MOBILITY)
    own = held_out == "its own"
    # the control is the curve of the material that was learned
    judge = curve(material if own else PhanThienTanner(0.2))
    runs = [start(material, 1.0), start(material, 4.0), judge]
    found = compared(runs, held_out=[judge.name])
    assert found.verdict == ("explained" if own else "unexplained")
