"""What a network is told of its weights, against differences of what it then records."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover.learners.tbnn_ude.session import initial_law
from discover.learners.tbnn_ude.variational import Rebuild, states_and_jacobian, weights_of


def nearly_giesekus(mobility, width=3):
    """Return a network's law whose coefficients are nearly those of a Giesekus fluid."""
    law = initial_law(jax.random.key(0), width, True, jnp.ones(8))
    last = 0.01 * jax.random.normal(jax.random.key(1), law.network.layers[-1].weight.shape)
    return eqx.tree_at(
        lambda tree: (tree.network.layers[-1].weight, tree.constants),
        law,
        (last, jnp.zeros(8).at[3].set(mobility)),
    )


def told_as_differences(problem, law, step, tolerance):
    """Assert that residuals move with all weights as their differences do; return what was found.

    `step`: of the weights along a random direction. `tolerance`: of the largest difference.
    """
    n = len(weights_of(law))  # all of them
    rebuild = Rebuild(law, jnp.arange(n), jnp.ones(n, bool), jnp.ones(n))
    along, jacobian = states_and_jacobian(rebuild.start, rebuild, problem)
    direction = jax.random.normal(jax.random.key(2), rebuild.start.shape)
    moved = (rebuild.start + s * direction for s in (step, -step))
    more, less = (
        problem.records.residual(states_and_jacobian(weights, rebuild, problem)[0].recorded)
        for weights in moved
    )
    expected = (more - less) / (2.0 * step)
    _, columns = problem.records.linearised(along.recorded, jacobian)
    size = tolerance * float(jnp.max(jnp.abs(expected)))
    np.testing.assert_allclose(columns @ direction, expected, atol=size)
    return along
