import first_calls
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tensor_library as tl

# Products of up to five tensors of order one: rounding of a few hundred operations in float64
ROUNDING = 1e-11

LIBRARY = tl.build_library(degree=2, closed_forms=("exp", "saturating"))
EVALUATE = jax.jit(LIBRARY.evaluate)


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


def test_a_component_of_stress_is_caught_as_not_objective():
    # negative control of the test above: σ11 times the unit tensor depends on the observer
    k1, k2 = jax.random.split(jax.random.key(0))
    stress, q = symmetric(k1), rotation(k2)

    def frame_dependent(s):
        return s[0, 0] * jnp.eye(3)

    difference = frame_dependent(q @ stress @ q.T) - q @ frame_dependent(stress) @ q.T
    assert float(jnp.max(jnp.abs(difference))) > 1e-2


@settings(max_examples=25, deadline=None)
@given(
    components=st.lists(st.floats(-3, 3), min_size=4, max_size=4),
    shear_rate=st.floats(-5, 5),
)
def test_the_four_component_path_equals_the_full_tensor(components, shear_rate):
    stress = jnp.array(components)
    fast = EVALUATE(stress, tl.rate_of_deformation(jnp.array(shear_rate)))
    full = EVALUATE(
        tl.from_shear(stress), tl.rate_of_deformation(tl.simple_shear(jnp.array(shear_rate)))
    )
    np.testing.assert_allclose(
        jax.vmap(tl.to_shear)(full),
        fast,
        rtol=1e-12,
        atol=1e-12 * float(jnp.max(jnp.abs(full)) + 1),
    )
    assert float(jnp.max(jnp.abs(full[:, 0, 2]))) == 0.0  # 13 and 23 stay dead in simple shear


def test_production_in_shear_equals_the_full_tensor():
    stress = jnp.array([0.7, -0.2, 0.1, 0.4])
    fast = tl.upper_convected_production(stress, jnp.array(1.3))
    full = tl.upper_convected_production(tl.from_shear(stress), tl.simple_shear(jnp.array(1.3)))
    np.testing.assert_allclose(tl.to_shear(full), fast, rtol=1e-14, atol=1e-15)


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


def test_cayley_hamilton_makes_the_cube_of_stress_redundant():
    # σ³ = I₁ σ² − I₂ σ + I₃ 1: the reason why the basis stops at σ²
    s = np.asarray(symmetric(jax.random.key(5)))
    t1, t2, t3, *_ = tl.scalar_invariants(jnp.array(s), jnp.array(s))[jnp.array([0, 1, 3])]
    i2, i3 = 0.5 * (t1**2 - t2), (t1**3 - 3 * t1 * t2 + 2 * t3) / 6
    np.testing.assert_allclose(s @ s @ s, t1 * s @ s - i2 * s + i3 * np.eye(3), atol=1e-13)


@pytest.mark.parametrize("flow", [tl.uniaxial_extension, tl.planar_extension, tl.simple_shear])
def test_flows_keep_the_volume(flow):
    assert float(jnp.trace(flow(jnp.array(0.8)))) == pytest.approx(0.0, abs=1e-15)


def test_shapes_are_checked_while_tests_run():
    # so that every other test also tests the shapes written on public functions
    first_calls.begin_file()
    with pytest.raises(jaxtyping.TypeCheckError):
        tl.trace(jnp.zeros((5, 4)))
