"""Checks of physical soundness against what is known analytically."""

import json

import jax.numpy as jnp
import pytest

from discover.identify.physics import check_physics
from discover.laws import Fluid, Giesekus, JohnsonSegalman, LibraryExpansion, UpperConvectedMaxwell
from tensor_library import TermLibrary, parse_term

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
def slip():
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
def test_slip_without_solvent_bands_and_stretches_without_bound_beyond_its_own_rates(slip):
    # σ12 = γ̇/(1 + ξ(2 − ξ)γ̇²), largest at 1/√0.64 = 1.25; the grid is 4 % fine
    assert slip[FLOW_CURVE].passed is False
    assert slip[FLOW_CURVE].value == pytest.approx(1.25, rel=0.04)
    assert "within the rates of training" in slip[FLOW_CURVE].text
    # 2(1 − ξ)ε̇ = 1
    assert slip[EXTENSION].value == pytest.approx(1 / 1.2, rel=1e-3)


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
