"""What an experiment can determine, before any fit."""

import json
from dataclasses import replace

import numpy as np
import pytest

from discover.identify.structure import analyse_structure
from discover.protocols import oscillatory_shear
from discover.simulate import synthetic_dataset
from tensor_library import LawTerms, build_library, parse_term

SLIP = "sigma.gammadot+gammadot.sigma"
FLOWS = {f"laos_{wi:g}_{de:g}": oscillatory_shear(wi, de) for wi in (1.0, 2.0) for de in (0.5, 1.0)}
ADDED = (
    "tr(sigma)*sigma", "tr(sigma)*gammadot", "tr(sigma.gammadot)*I", "tr(gammadot.gammadot)*I",
    "tr(sigma.gammadot)*gammadot",
)  # fmt: skip
LIBRARY = build_library().extended(map(parse_term, ADDED))


@pytest.fixture(scope="module")
def runs():
    return list(synthetic_dataset("ucm", {}, protocol=FLOWS, n_samples=33, duration=6.0))


def verdicts(found):
    return {one.quantity: one.verdict for one in found.quantities}


@pytest.mark.slow
def test_n1_follows_from_the_assumed_derivative_and_with_slip_n2_from_neither(runs):
    found = analyse_structure(runs, LIBRARY)
    assert verdicts(found)["N1"] == "undetermined"
    assert "convected derivative" in found.text
    assert "not from the data" in found.text
    # σ11 alone: it enters no equation that σ12 feels
    assert any(d.changes["N1"] > 1e-6 for d in found.unseen)
    found = analyse_structure(runs, LIBRARY, LawTerms({SLIP: 0.2}))
    assert verdicts(found)["N2"] == "undetermined"
    assert "Measuring N1 as well would not change this" in found.text
    # d/dξ of the twins: (σγ̇ + γ̇σ)/2 against (1 − ξ) tr(σ) γ̇ ... both unseen to first order
    (curved,) = (d for d in found.unseen if set(d.coefficients) == {SLIP, "tr(sigma)*gammadot"})
    assert curved.at_any_size is False  # c = ξ(1 − ξ/2) is a curve


@pytest.mark.slow
def test_the_tangent_of_the_twins_has_the_slope_of_their_formula(runs):
    found = analyse_structure(runs, LIBRARY, LawTerms({"tr(sigma)*gammadot": 0.32}))
    # both single-term twins have the coefficient 0.32: their difference is unseen at any size
    pair = next(d for d in found.unseen if "tr(sigma.gammadot)*I" in d.coefficients)
    assert pair.changes["sigma12"] < 1e-10


def test_quadratic_relaxation_determines_n1_but_not_n2_and_unseen_directions_are_counted(runs):
    # negative control for N1
    found = analyse_structure(runs, LIBRARY, LawTerms({"sigma.sigma": 0.2}))
    assert verdicts(found) == {"N1": "determined", "N2": "undetermined"}
    assert all(d.changes["N1"] < 1e-8 for d in found.unseen)
    assert all(d.changes["sigma12"] < 1e-10 for d in found.unseen)  # rounding
    pairs = [set(d.coefficients) for d in found.unseen if d.at_any_size]
    assert {"gammadot.gammadot", "tr(gammadot.gammadot)*I"} in pairs
    content = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert content["n_terms"] == len(LIBRARY)
    assert f"{len(found.unseen)} combination" in content["text"]


def test_measured_normal_stresses_are_not_called_undetermined(runs):
    ones = np.ones_like(runs[0].time)
    both = {"first_normal_stress_difference": ones, "second_normal_stress_difference": ones}
    with_both = [replace(run, **both) for run in runs]
    found = analyse_structure(with_both, LIBRARY, use_normal_stresses=True)
    assert verdicts(found) == {"N1": "measured", "N2": "measured"}
