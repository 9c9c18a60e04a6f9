import jax
import jax.numpy as jnp
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import tensor_library as tl
from tensor_library.algebra import INVARIANT_NAMES, scalar_invariants

# Products of up to five tensors of order one: rounding of a few hundred operations in float64
ROUNDING = 1e-11

LIBRARY = tl.build_library(degree=2, closed_forms=("exp", "saturating"))
EVALUATE = jax.jit(LIBRARY.evaluate)


SHEAR = jnp.eye(3)[0][:, None] * jnp.eye(3)[1]
"""The velocity gradient of simple shear at a rate of one."""


def whole(components):
    """Return the tensor of 11, 22, 33, 12."""
    a11, a22, a33, a12 = components
    return jnp.array([[a11, a12, 0.0], [a12, a22, 0.0], [0.0, 0.0, a33]])


def symmetric(key):
    a = jax.random.normal(key, (3, 3))
    return 0.5 * (a + a.T)


def rotation(key):
    q, r = jnp.linalg.qr(jax.random.normal(key, (3, 3)))
    q = q * jnp.sign(jnp.diag(r))
    return q * jnp.linalg.det(q)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**31 - 1))
def test_every_library_term_rotates_with_the_observer(seed):
    k1, k2, k3 = jax.random.split(jax.random.key(seed), 3)
    stress, rate, q = symmetric(k1), symmetric(k2), rotation(k3)
    rate = rate - jnp.trace(rate) / 3 * jnp.eye(3)
    turned = EVALUATE(q @ stress @ q.T, q @ rate @ q.T)
    expected = jnp.einsum("ij,njk,lk->nil", q, EVALUATE(stress, rate), q)
    scale = 1.0 + float(jnp.max(jnp.abs(expected)))
    assert float(jnp.max(jnp.abs(turned - expected))) < ROUNDING * scale


@settings(max_examples=25, deadline=None)
@given(components=st.lists(st.floats(-3, 3), min_size=4, max_size=4), shear_rate=st.floats(-5, 5))
def test_the_four_component_path_equals_the_full_tensor(components, shear_rate):
    stress = jnp.array(components)
    fast = EVALUATE(stress, tl.rate_of_deformation(jnp.array(shear_rate)))
    full = EVALUATE(whole(stress), tl.rate_of_deformation(shear_rate * SHEAR))
    size = float(jnp.max(jnp.abs(full)) + 1)
    # 13 and 23 stay dead in simple shear
    np.testing.assert_allclose(full, jax.vmap(whole)(fast), rtol=1e-12, atol=1e-12 * size)


def test_production_in_shear_is_the_full_tensors_and_the_cube_of_stress_redundant():
    stress = jnp.array([0.7, -0.2, 0.1, 0.4])
    fast = tl.upper_convected_production(stress, jnp.array(1.3))
    full = tl.upper_convected_production(whole(stress), 1.3 * SHEAR)
    np.testing.assert_allclose(full, whole(fast), rtol=1e-14, atol=1e-15)
    # σ³ = I₁ σ² − I₂ σ + I₃ 1: the reason why the basis stops at σ²
    s = np.asarray(symmetric(jax.random.key(5)))
    t1, t2, t3, *_ = tl.scalar_invariants(jnp.array(s), jnp.array(s))[jnp.array([0, 1, 3])]
    i2, i3 = 0.5 * (t1**2 - t2), (t1**3 - 3 * t1 * t2 + 2 * t3) / 6
    np.testing.assert_allclose(s @ s @ s, t1 * s @ s - i2 * s + i3 * np.eye(3), atol=1e-13)


def test_basis_and_invariants_match_matrix_products_written_out():
    k1, k2 = jax.random.split(jax.random.key(3))
    s, g = np.asarray(symmetric(k1)), np.asarray(symmetric(k2))
    basis = [
        np.eye(3), s, g, s @ s, g @ g, s @ g + g @ s, s @ s @ g + g @ s @ s, s @ g @ g + g @ g @ s,
    ]  # fmt: skip
    invariants = [
        np.trace(m) for m in (s, s @ s, g @ g, s @ s @ s, g @ g @ g, s @ s @ g, s @ g @ g, s @ g)
    ]
    np.testing.assert_allclose(tl.integrity_basis(jnp.array(s), jnp.array(g)), basis, atol=1e-14)
    np.testing.assert_allclose(
        tl.scalar_invariants(jnp.array(s), jnp.array(g)), invariants, atol=1e-13
    )


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


def test_in_simple_shear_the_missing_invariant_follows_and_three_hold_the_vorticity():
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
    rate = jnp.zeros((3, 3)).at[0, 1].set(1.3).at[1, 0].set(1.3)
    stress = jnp.array([[0.7, 0.4, 0.0], [0.4, -0.2, 0.0], [0.0, 0.0, 0.3]])
    change = scalar_invariants(stress.at[2, 2].set(0.9), rate) - scalar_invariants(stress, rate)
    feel = {name for name, c in zip(INVARIANT_NAMES, change, strict=True) if abs(c) > 1e-12}
    assert feel == {"tr(sigma)", "tr(sigma.sigma)", "tr(sigma.sigma.sigma)"}
