"""What an experiment can determine before any fit, and what is physically sound."""

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from discover.identify.physics import check_physics
from discover.identify.structure import analyse_structure
from discover.laws import Fluid, Giesekus, JohnsonSegalman, LibraryExpansion, UpperConvectedMaxwell
from discover.protocols import oscillatory_shear
from discover.simulate import synthetic_dataset
from tensor_library import LawTerms, TermLibrary, build_library, parse_term

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


FLOW_CURVE = "flow curve monotonic"
EXTENSION = "steady extension bounded"
TERMS = ("sigma", "sigma.sigma")


def expansion(**coefficients):
    """One structure for every library law here, so that they share programs."""
    library = TermLibrary(tuple(parse_term(name) for name in TERMS))
    values = [coefficients.get(key, 0.0) for key in ("linear", "quadratic")]
    return LibraryExpansion(jnp.array(values), jnp.zeros(0), library)


def report(law, solvent=0.0):
    return check_physics(Fluid(law, 1.0, 1.0, solvent), 2.0)


@pytest.fixture(scope="module")
def maxwell():
    return report(UpperConvectedMaxwell())


@pytest.fixture(scope="module")
def slipping():
    return report(JohnsonSegalman(0.4))


@pytest.mark.slow
def test_maxwell_is_sound_except_in_extension_beyond_half_in_plain_json(maxwell):
    failed = {c.name for c in maxwell.checks if not c.passed}
    assert failed == {EXTENSION}
    # σ11 = 2ε̇/(1 − 2ε̇); the last step is resolved to 1/60 of a grid step of 3 %
    assert maxwell[EXTENSION].value == pytest.approx(0.5, rel=1e-3)
    content = json.loads(json.dumps(maxwell.to_json(), allow_nan=False))
    assert {c["name"] for c in content["checks"]} >= {FLOW_CURVE, EXTENSION}
    assert EXTENSION in content["text"]


@pytest.mark.slow
def test_slip_without_solvent_bands_and_stretches_without_bound_beyond_its_own_rates(slipping):
    # σ12 = γ̇/(1 + ξ(2 − ξ)γ̇²), largest at 1/√0.64 = 1.25; the grid is 4 % fine
    assert slipping[FLOW_CURVE].passed is False
    assert slipping[FLOW_CURVE].value == pytest.approx(1.25, rel=0.04)
    assert "within the rates of training" in slipping[FLOW_CURVE].text
    # 2(1 − ξ)ε̇ = 1
    assert slipping[EXTENSION].value == pytest.approx(1 / 1.2, rel=1e-3)


@pytest.mark.slow
def test_enough_solvent_makes_slip_monotonic_and_linear_terms_and_feedback_are_caught():
    # dσ/dγ̇ is least at −1/8 of the polymer's viscosity
    assert report(JohnsonSegalman(0.4), solvent=0.126)[FLOW_CURVE].passed
    assert report(JohnsonSegalman(0.4), solvent=0.120)[FLOW_CURVE].passed is False
    assert report(expansion(quadratic=0.2))["small-strain limit"].passed
    changed = report(expansion(linear=0.1))["small-strain limit"]
    # 1/(iω + 1.1) against 1/(iω + 1): 0.1/1.1 at vanishing frequency
    assert changed.passed is False
    assert changed.value == pytest.approx(0.1 / 1.1, rel=1e-3)
    # h = −1.5 σ: stress grows by itself
    checks = report(expansion(linear=-1.5))
    assert checks[EXTENSION].passed is False


@pytest.mark.parametrize(("mobility", "monotonic"), [(0.2, True), (0.45, True), (0.6, False)])
def test_giesekus_is_monotonic_up_to_a_mobility_of_one_half(mobility, monotonic):
    checks = report(Giesekus(mobility))
    assert checks[FLOW_CURVE].passed is monotonic
    assert checks[EXTENSION].passed
