"""What some laws show and others cannot: laws alike in shear, ellipses at fast oscillation."""

import numpy as np
import pytest
from scipy.special import jv

from discover.laws import Fluid, make_law
from discover.protocols import oscillatory_shear
from discover.report.plots.comparison import third_harmonic
from discover.simulate import simulate

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
