"""The pom-pom law, with its structure variable, against closed forms.

In time and in extension: `test_law_accuracy.py`, by scipy on full tensors.
"""

import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.laws import make_law
from discover.protocols import steady_rates

ARMS, RATIO = 4.0, 0.3
CONSTANTS = {"q": ARMS, "stretch_time_ratio": RATIO}
both = pytest.mark.parametrize("name", ["pom_pom", "pom_pom_drag_strain"])


@pytest.mark.parametrize(
    "name", ["pom_pom_drag_strain", pytest.param("pom_pom", marks=pytest.mark.slow)]
)
def test_steady_shear_is_the_closed_form_that_has_a_maximum(name):
    """A is upper-convected Maxwell's: A11 = 1 + 2 Wi², A12 = Wi; McLeish & Larson 1998, eq. 39."""
    # at the fastest the logarithm of tr A used to run away, and a stress of a wrong sign was steady
    rates = np.array([0.1, 0.5, 1.0, 2.0, 5.0, 20.0, 1e3, 1e4, 1e5])
    run = Run("run", np.arange(1.0, 10.0), steady_rates(rates), rates, np.ones(9))
    model = AugmentedModel(DeclaredModel.named(name, CONSTANTS, np.ones(1), np.ones(1)), [])
    found = np.asarray(model.predict(model.zero(), make_batch([run]))[0])
    turned = rates / (3.0 + 2.0 * rates**2)
    np.testing.assert_allclose(found, 3.0 * _stretch(name, rates * turned) ** 2 * turned, rtol=1e-7)
    assert found[-1] < np.max(found)


@both
def test_steady_extension_hardens_to_the_square_of_the_arms(name):
    """Nothing changes at the closed form; that steady states are found: in shear, above."""
    law = make_law(name, CONSTANTS)
    for rate in (0.1, 0.3, 0.45, 20.0):
        along, across = 1.0 / (1.0 - 2.0 * rate), 1.0 / (1.0 + rate)
        turned = (along - across) / (along + 2.0 * across)
        if rate > 0.5:
            # chains are straight, and beyond (1 − 1/q)/θ stretched to their end
            along, across, turned = 1e9, 0.0, 1.0
        stretch = _stretch(name, np.array([rate * turned]))[0]
        shape = np.array([along, across, across, 0.0]) / (along + 2.0 * across)
        stress = 3.0 * stretch**2 * shape - np.array([1.0, 1.0, 1.0, 0.0])
        assert stress[0] - stress[1] == pytest.approx(3.0 * stretch**2 * turned)
        assert rate < 0.5 or stretch == pytest.approx(ARMS)
        state = np.append(stress, np.log((along + 2.0 * across) / 3.0))
        gradient = rate * np.array([1.0, -0.5, -0.5, 0.0])
        change = law.stress_rate(jnp.asarray(state), jnp.asarray(gradient))[:4]
        # sixty bisections, and a share of 1e-9 of A that is not yet straight
        np.testing.assert_allclose(change, 0.0, atol=1e-6 * rate * np.max(np.abs(stress)))


def _stretch(name, drawn):
    """Return the Λ at which (λ/λ_s) e^{ν(Λ−1)} (Λ − 1) = Λ L:S, at most q; bisected."""
    nu = 2.0 / (ARMS - 1.0) if name == "pom_pom_drag_strain" else 0.0
    low, high = np.ones_like(drawn), np.full_like(drawn, ARMS)
    for _ in range(60):
        middle = 0.5 * (low + high)
        grows = drawn > (1.0 - 1.0 / middle) * np.exp(nu * (middle - 1.0)) / RATIO
        low, high = np.where(grows, middle, low), np.where(grows, high, middle)
    return low
