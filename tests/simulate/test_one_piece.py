"""Loops over time are one piece of machine code: what they contract is no product of matrices."""

import jax
import jax.numpy as jnp
import numpy as np

from tensor_library.algebra import contracted


def products(function, *arguments) -> int:
    """Return how many matrix products XLA starts by themselves."""
    return jax.jit(function).lower(*arguments).compile().as_text().count(" dot(")


def test_a_contraction_is_that_of_tensordot_without_a_product_of_matrices():
    first, second = jnp.arange(24.0).reshape(2, 3, 4), jnp.arange(20.0).reshape(4, 5)
    np.testing.assert_allclose(
        contracted(first, second), np.tensordot(first, second, axes=1), rtol=1e-15
    )
    assert products(contracted, first, second) == 0
    # the control: there is one where it is written as such
    assert products(lambda a, b: jnp.tensordot(a, b, axes=1), first, second) == 1
