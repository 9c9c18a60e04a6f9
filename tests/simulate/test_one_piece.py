"""Loops over time are one piece of machine code: no matrix product stands in them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from discover.dataset.run import Run
from discover.effects import library_effects, named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import imposed_stress, start_up
from tensor_library.algebra import contracted

TIMES = np.linspace(0.1, 2.0, 20)
START_UP = Run("start", TIMES, start_up(2.0), np.full(20, 2.0), np.ones(20))
CREEP = Run(
    "creep",
    TIMES,
    imposed_stress(TIMES, np.full(20, 5.0)),
    np.zeros(20),
    np.full(20, 5.0),
    strain=np.ones(20),
)


def products(function, *arguments) -> int:
    """Return how many matrix products XLA starts by themselves."""
    return jax.jit(function).lower(*arguments).compile().as_text().count(" dot(")


# in creep, which takes four times as long to compile, all of them are slow
@pytest.mark.parametrize(
    ("run", "terms"),
    [
        (START_UP, None),
        pytest.param(CREEP, 2, marks=pytest.mark.slow),
        pytest.param(CREEP, None, marks=pytest.mark.slow),
    ],
    ids=["start", "creep, two terms", "creep"],
)
def test_no_candidate_of_the_loop_brings_a_matrix_product_into_the_steps(run, terms):
    effects = [named_effects()["giesekus_mobility"], *library_effects(0)[:terms]]
    model = AugmentedModel(DeclaredModel.maxwell([100.0, 10.0], [0.1, 1.0]), effects)
    theta, batch = model.zero(), make_batch([run])
    program, (flows,) = model._predictor.program, batch.parts
    used = program.fluid.in_use(theta)
    assert products(program._predict_all, model._predictor._numbers, used, theta, flows) == 0


def test_a_contraction_is_that_of_tensordot_without_a_product_of_matrices():
    first, second = jnp.arange(24.0).reshape(2, 3, 4), jnp.arange(20.0).reshape(4, 5)
    np.testing.assert_allclose(
        contracted(first, second), np.tensordot(first, second, axes=1), rtol=1e-15
    )
    assert products(contracted, first, second) == 0
    # the control: there is one where it is written as such
    assert products(lambda a, b: jnp.tensordot(a, b, axes=1), first, second) == 1
