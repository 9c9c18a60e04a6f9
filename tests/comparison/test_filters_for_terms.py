"""A small term in whose place a filter of the instrument does as well: data by scipy."""

import numpy as np
import pytest
from discover.comparison.judging.other_causes.filters_for_terms import (
    filter_for_terms,
    holding_filters,
)
from discover.comparison.outcomes.flows import Flow, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import bands_of_predictions
from independent import Giesekus, PhanThienTanner, oscillation, start_up
from scipy.integrate import cumulative_trapezoid

from discover.laws.expansion import law_of_terms
from discover.laws.multimode import Fluid
from discover.laws.registry import make_law
from discover.learners.results.recovered_term import RecoveredTerm
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as protocol
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow": (start_up(0.5), protocol(0.5), GROWTH),
    "fast": (start_up(2.0), protocol(2.0), GROWTH),
    "wave": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
}
MODULUS = 100.0
EMPTY = (np.zeros(0), np.zeros(0))


def fluid_of(names, values):
    law = law_of_terms(LawTerms(dict(zip(names, map(float, values), strict=True))), True)
    return Fluid(law, np.array([MODULUS]), np.array([1.0]))


def told(material, width):
    """Records with 1 % of noise, each a mean over a width in s about its time."""
    lot, found = np.random.default_rng(0), {}
    for name, (flow, _, times) in FLOWS.items():
        fine = np.linspace(0.0, times[-1] + 0.5, 5001)
        stress = np.append(0.0, material.respond(flow, fine[1:]).sigma12)
        mean = np.interp(times, fine, stress)
        if width:
            total = np.append(0.0, cumulative_trapezoid(stress, fine))
            low, high = np.maximum(times - width / 2, 0.0), times + width / 2
            mean = (np.interp(high, fine, total) - np.interp(low, fine, total)) / (high - low)
        size = 0.01 * np.sqrt(np.mean(mean**2))
        found[name] = mean + size * lot.standard_normal(len(mean))
    return found


def fitted(material, width, names, start):
    """Return flows and the outcome of a law of these terms fitted to the records."""
    records = told(material, width)
    flows = [
        Flow(name, "training", own, times, np.asarray(flow.rate(times), float),
             {"sigma12": records[name]}, records[name])
        for name, (flow, own, times) in FLOWS.items()
    ]  # fmt: skip
    weight = np.concatenate(
        [np.full(len(f.times), 100.0 / np.sqrt(np.mean(f.measured**2))) for f in flows]
    )

    def stress(values):
        return np.concatenate([predict(fluid_of(names, values), f)["sigma12"] for f in flows])

    values, measured = np.array(start), np.concatenate([f.measured for f in flows])
    for _ in range(3):
        at = stress(values)
        slopes = np.array([(stress(values + d) - at) / 1e-4 for d in 1e-4 * np.eye(len(values))])
        inverse = np.linalg.inv((slopes * weight**2) @ slopes.T)
        values = values + inverse @ (slopes * weight**2) @ (measured - at)
    half = 1.96 * np.sqrt(np.diag(inverse))
    terms = tuple(
        RecoveredTerm(name, float(v), ci95=(float(v - h), float(v + h)))
        for name, v, h in zip(names, values, half, strict=True)
    )
    predictions = {f.key: predict(fluid_of(names, values), f) for f in flows}
    return flows, LearnerOutcome("tensor_sindy", terms, 1.0, EMPTY, predictions=predictions)


@pytest.fixture(scope="module")
def model():
    return DeclaredModel(
        make_law("ucm", {}), "ucm", {}, np.array([MODULUS]), np.array([1.0]), (), None
    )


def test_a_mean_over_two_samples_does_as_well_as_a_small_term(model):
    names = ["sigma.sigma", "tr(gammadot.gammadot)*gammadot"]
    flows, chosen = fitted(Giesekus(0.3, MODULUS, 1.0), 0.3, names, [0.3, 0.0])
    assert chosen.terms[1].ci95[0] > 0.0  # not there, and an interval without zero
    bands = {}
    for flow in flows:
        three = np.stack([chosen.predictions[flow.key][q] for q in ("sigma12", "N1", "N2")], -1)
        bands[flow.key] = bands_of_predictions(three[None, None], [1], [flow.times])[0]
    outcomes, wider, said = holding_filters({"tensor_sindy": chosen}, bands, chosen, model, flows)
    square, other = outcomes["tensor_sindy"].terms
    assert other.ci95[0] <= 0.0
    assert square.ci95[0] < 0.3 < square.ci95[1]
    assert "tr(gammadot.gammadot)*gammadot may be no term of the fluid" in said[0]
    assert all(np.max(wider[key].rivals_high - wider[key].rivals_low) > 0.0 for key in wider)


def test_two_terms_that_are_there_are_no_filter(model):
    fluid = PhanThienTanner(0.3, "linear", 0.01, modulus=MODULUS, relaxation_time=1.0)
    names = ["tr(sigma)*sigma", "sigma.gammadot+gammadot.sigma"]
    flows, chosen = fitted(fluid, 0.0, names, [0.3, 0.0])
    low, high = chosen.terms[1].ci95
    assert 0.0 < low < 0.005 < high  # ξ/2: as small a term as noise lets it be
    assert filter_for_terms(chosen, model, flows) is None
