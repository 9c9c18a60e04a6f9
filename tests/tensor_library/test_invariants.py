"""Which of Smith's ten invariants are here, and what the missing one would add."""

import jax.numpy as jnp
import numpy as np

from tensor_library.algebra import INVARIANT_NAMES, scalar_invariants


def missing(stress, rate):
    """tr σ²γ̇²."""
    return np.trace(stress @ stress @ rate @ rate)


def from_the_others(stress, rate):
    """tr σ²γ̇² in simple shear, from the invariants of the library."""
    found = scalar_invariants(jnp.asarray(stress), jnp.asarray(rate))
    known = dict(zip(INVARIANT_NAMES, map(float, found), strict=True))
    k = 0.5 * known["tr(gammadot.gammadot)"]
    below = k * known["tr(sigma)"] - known["tr(sigma.gammadot.gammadot)"]
    return (k**2 * known["tr(sigma.sigma)"] - below**2) / k


def test_in_simple_shear_the_missing_invariant_follows_from_the_others():
    generator = np.random.default_rng(2)
    rate = np.zeros((3, 3))
    rate[0, 1] = rate[1, 0] = 1.7
    s11, s22, s33, s12 = generator.normal(size=4)
    stress = np.array([[s11, s12, 0.0], [s12, s22, 0.0], [0.0, 0.0, s33]])
    np.testing.assert_allclose(from_the_others(stress, rate), missing(stress, rate), rtol=1e-12)
    # negative control: in a flow that is no simple shear it does not
    general = generator.normal(size=(3, 3))
    general = general + general.T
    rate = np.diag([1.0, 0.5, -1.5])
    assert abs(from_the_others(general, rate) / missing(general, rate) - 1.0) > 0.1


def test_the_stress_along_the_vorticity_is_in_three_invariants_of_shear_only():
    rate = jnp.zeros((3, 3)).at[0, 1].set(1.3).at[1, 0].set(1.3)
    stress = jnp.array([[0.7, 0.4, 0.0], [0.4, -0.2, 0.0], [0.0, 0.0, 0.3]])
    change = scalar_invariants(stress.at[2, 2].set(0.9), rate) - scalar_invariants(stress, rate)
    feel = {name for name, c in zip(INVARIANT_NAMES, change, strict=True) if abs(c) > 1e-12}
    assert feel == {"tr(sigma)", "tr(sigma.sigma)", "tr(sigma.sigma.sigma)"}
