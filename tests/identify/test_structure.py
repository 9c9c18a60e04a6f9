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


@pytest.fixture(scope="module")
def structure(runs):
    return analyse_structure(runs, LIBRARY)


def at(structure, fragment):
    return next(law for law in structure.laws if fragment in law.name)


@pytest.mark.slow
def test_n1_follows_from_the_assumed_derivative_and_with_slip_n2_from_neither(structure):
    law = at(structure, "known part")
    assert law.line()["N1"] == "undetermined"
    assert "convected derivative" in law.text
    assert "not from the data" in law.text
    # σ11 alone: it enters no equation that σ12 feels
    supports = [set(d.coefficients) for d in law.exact if d.changes["N1"] > 1e-6]
    assert supports
    law = at(structure, "slip")
    assert law.line()["N2"] == "undetermined"
    assert law.N2_with_N1 == "undetermined"
    assert "Measuring N1 as well would not change this" in law.text
    tangents = [set(d.coefficients) for d in law.exact]
    # d/dξ of the twins: (σγ̇ + γ̇σ)/2 against (1 − ξ) tr(σ) γ̇ ... both unseen to first order
    assert {SLIP, "tr(sigma)*gammadot"} in tangents
    curved = next(d for d in law.exact if set(d.coefficients) == {SLIP, "tr(sigma)*gammadot"})
    assert curved.at_any_size is False  # c = ξ(1 − ξ/2) is a curve


@pytest.mark.slow
def test_the_tangent_of_the_twins_has_the_slope_of_their_formula(runs):
    structure = analyse_structure(
        runs, LIBRARY, nominal={"twin": LawTerms({"tr(sigma)*gammadot": 0.32})}
    )
    law = at(structure, "twin")
    # both single-term twins have the coefficient 0.32: their difference is unseen at any size
    pair = next(d for d in law.exact if "tr(sigma.gammadot)*I" in d.coefficients)
    assert pair.changes["sigma12"] < 1e-10


def test_quadratic_relaxation_determines_n1_but_not_n2_and_unseen_directions_are_counted(structure):
    # negative control for N1
    law = at(structure, "quadratic")
    assert law.line()["N1"] == "determined"
    assert law.line()["N2"] == "undetermined"
    assert all(d.changes["N1"] < 1e-8 for d in law.exact)
    for law in structure.laws[:3]:
        assert all(d.changes["sigma12"] < 1e-10 for d in law.exact)  # rounding
        assert all(d.changes["sigma12"] > 1e-10 for d in law.weak)
        pairs = [set(d.coefficients) for d in law.exact if d.at_any_size]
        assert {"gammadot.gammadot", "tr(gammadot.gammadot)*I"} in pairs
    content = json.loads(json.dumps(structure.to_json(), allow_nan=False))
    assert content["n_terms"] == len(LIBRARY)
    assert str(len(structure.laws[0].exact)) in content["text"]


def test_measured_normal_stresses_are_not_called_undetermined(runs):
    ones = np.ones_like(runs[0].time)
    both = {"first_normal_stress_difference": ones, "second_normal_stress_difference": ones}
    with_both = [replace(run, **both) for run in runs]
    structure = analyse_structure(with_both, LIBRARY, nominal={}, use_normal_stresses=True)
    assert [q.verdict for q in structure.laws[0].quantities] == ["measured", "measured"]
