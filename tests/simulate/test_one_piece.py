"""Loops over time are one piece of machine code: no matrix product stands in them."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.forward.flow_batch import lay_out
from discover.forward.fluids import observed_on_grid
from discover.laws import Fluid, make_law
from discover.protocols import imposed_stress, start_up
from tensor_library.algebra import contracted

TIMES = np.linspace(0.1, 2.0, 20)
START_UP = start_up(2.0)
CREEP = imposed_stress(TIMES, np.full(20, 5.0))


def products(function, *arguments) -> int:
    """Return how many matrix products XLA starts by themselves."""
    return function.lower(*arguments).compile().as_text().count(" dot(")


# creep takes four times as long to compile
@pytest.mark.parametrize(
    "protocol", [START_UP, pytest.param(CREEP, marks=pytest.mark.slow)], ids=["start", "creep"]
)
def test_no_law_brings_a_matrix_product_into_the_steps(protocol):
    law = make_law("giesekus", {"alpha": 0.3})
    fluid = Fluid(law, np.array([100.0, 10.0]), np.array([0.1, 1.0]), 1.0)
    flows = lay_out([protocol], [TIMES])

    def observed(fluid, flows):
        return flows.over(partial(observed_on_grid, fluid))

    assert products(eqx.filter_jit(observed), fluid, flows) == 0


def test_a_contraction_is_that_of_tensordot_without_a_product_of_matrices():
    first, second = jnp.arange(24.0).reshape(2, 3, 4), jnp.arange(20.0).reshape(4, 5)
    np.testing.assert_allclose(
        contracted(first, second), np.tensordot(first, second, axes=1), rtol=1e-15
    )
    assert products(jax.jit(contracted), first, second) == 0
    # the control: there is one where it is written as such
    assert products(jax.jit(lambda a, b: jnp.tensordot(a, b, axes=1)), first, second) == 1
