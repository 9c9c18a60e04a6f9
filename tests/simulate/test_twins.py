"""What some laws show and others cannot: laws alike in shear, ellipses at fast oscillation."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.special import jv

import tensor_library as tl
from discover.laws import Fluid, JohnsonSegalman, LibraryExpansion, make_law
from discover.protocols import oscillatory_shear, start_up, step_rates
from discover.report.plots.comparison.oscillations import third_harmonic
from discover.simulate import simulate

HISTORIES = {
    "oscillation": oscillatory_shear(2.0, 0.7),
    "start-up": start_up(3.0),
    "reversal": step_rates([0.0, 1.0, 2.2], [2.0, -3.0, 0.5]),
}


@pytest.mark.parametrize(
    "flow",
    [
        pytest.param(flow, id=name, marks=[pytest.mark.slow] if name == "reversal" else [])
        for name, flow in HISTORIES.items()
    ],
)
@pytest.mark.parametrize("slip", [0.2, 0.6])
def test_johnson_segalman_has_a_twin_with_the_same_stress_and_n1_but_no_n2(slip, flow):
    times = np.linspace(0, 6, 31)
    library = tl.build_library(tensors=["gammadot"], degree=1, invariants=["tr(sigma)"])
    coefficients = (
        jnp.zeros(2).at[library.names.index("tr(sigma)*gammadot")].set(slip * (1 - slip / 2))
    )
    twin = LibraryExpansion(coefficients, jnp.zeros(0), library)
    a = simulate(Fluid.dimensionless(JohnsonSegalman(slip)), flow, times)
    b = simulate(Fluid.dimensionless(twin), flow, times)
    # 1e-6: the integration tolerance of 1e-8 a step, grown over six relaxation times
    np.testing.assert_allclose(a.shear_stress, b.shear_stress, atol=1e-6)
    np.testing.assert_allclose(
        a.first_normal_stress_difference, b.first_normal_stress_difference, atol=5e-6
    )
    np.testing.assert_allclose(
        a.second_normal_stress_difference, -slip / 2 * a.first_normal_stress_difference, atol=5e-6
    )
    np.testing.assert_allclose(b.second_normal_stress_difference, 0.0, atol=1e-10)
    assert np.max(np.abs(a.second_normal_stress_difference)) > 0.05


def test_a_term_that_touches_33_only_is_invisible_to_shear_stress():
    # tr(γ̇²) I − 2 γ̇² has a single non-zero entry in shear, the 33
    library = tl.TermLibrary(
        (tl.parse_term("tr(gammadot.gammadot)*I"), tl.parse_term("gammadot.gammadot"))
    )
    invisible = LibraryExpansion(jnp.array([0.1, -0.2]), jnp.zeros(0), library)
    times = np.linspace(0, 6, 13)
    flow = HISTORIES["oscillation"]
    with_term = simulate(Fluid.dimensionless(invisible), flow, times)
    without = simulate(Fluid.dimensionless(JohnsonSegalman(0.0)), flow, times)
    np.testing.assert_allclose(with_term.shear_stress, without.shear_stress, atol=1e-7)
    assert np.max(np.abs(with_term.components[:, 2])) > 0.1


DEBORAH = 50.0


def late_third_harmonic(law, strain):
    """I₃/I₁ in one cycle after ten relaxation times."""
    period = 2.0 * np.pi / DEBORAH
    start = np.ceil(10.0 / period) * period
    times = np.concatenate([[0.0], start + period * np.arange(65) / 64.0])
    stress = simulate(Fluid(law, 1.0, 1.0), oscillatory_shear(strain * DEBORAH, DEBORAH), times)
    return third_harmonic(stress.shear_stress[1:])


@pytest.mark.parametrize("strain", [1.0, 3.0, 6.0])
def test_johnson_segalman_is_no_ellipse_at_large_strain(strain):
    """σ12 = G sin(aγ)/a, a² = ξ(2 − ξ), has harmonics J₁(aγ₀), J₃(aγ₀)."""
    limit = 0.8 * strain
    wanted = abs(jv(3, limit) / jv(1, limit))
    found = late_third_harmonic(make_law("johnson_segalman", {"xi": 0.4}), strain)
    assert found == pytest.approx(wanted, rel=0.02)


def test_giesekus_is_an_ellipse_at_any_strain():
    # scipy alone gives 0.7 % at a strain of 6 and De = 50
    assert late_third_harmonic(make_law("giesekus", {"alpha": 0.2}), 6.0) < 0.01
