"""The paper's recipe: Adam, one series added at a time, a penalty on every weight.

[Rodrigues, Thompson, Oliveira & Ausas, "Finding the underlying viscoelastic constitutive equation
via universal differential equations and differentiable physics"]
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.problem import TrainingProblem

PaperProgress = Callable[[int, int, float], None]

_CHUNK = 50
"""Iterations between two looks at the clock; each chunk is one compiled scan."""

_INITIAL_OUTPUT = 0.01
"""Factor on the last layer's initial weights. A network of full size at the start makes some
trajectories run away; the paper does not say how its network started."""


@dataclass(frozen=True)
class PaperRecipe:
    """Settings of the paper."""

    width: int = 32  # neurons in each of two hidden layers
    learning_rate: float = 1e-3  # of Adam, with decay rates 0.9 and 0.999
    penalty: float = 0.01  # factor κ on the sum of absolute weights
    iterations_per_series: int = 900  # iterations for each series added; 8 × 900 = 7,200 in all


def make_network(key: PRNGKeyArray, width: int, linear_relaxation: bool) -> TensorBasisNetwork:
    """Return the network at the start of training."""
    law = TensorBasisNetwork.initialise(key, width, 2, linear_relaxation)
    network: Any = law.network
    last = network.layers[-1]  # its bias is there: the network is made with one
    return eqx.tree_at(
        lambda tree: (tree.network.layers[-1].weight, tree.network.layers[-1].bias),
        law,
        (_INITIAL_OUTPUT * last.weight, jnp.zeros_like(last.bias)),
    )


def _with_series(problem: TrainingProblem, active: Bool[Array, " runs"]) -> TrainingProblem:
    """Return the problem with the other series at rest, where they cannot run away."""
    quiet = problem.flows.faster(active.astype(float))
    return eqx.tree_at(lambda p: p.flows, problem, quiet)


def paper_loss(
    network: eqx.nn.MLP,
    law: TensorBasisNetwork,
    problem: TrainingProblem,
    active: Bool[Array, " runs"],
    penalty: float | Float[Array, ""],
) -> Float[Array, ""]:
    """Return the sum over active series of the mean squared error, plus κ Σ|θ|.

    The sum, not the mean, over series reproduces the paper's numbers.
    """
    law = eqx.tree_at(lambda tree: tree.network, law, network)
    errors = _with_series(problem, active).mean_squared_errors(law)
    weights = jax.tree.leaves(eqx.filter(network, eqx.is_inexact_array))
    return jnp.sum(jnp.where(active, errors, 0.0)) + penalty * sum(
        jnp.sum(jnp.abs(w)) for w in weights
    )


def _adam(rate):
    import optax  # half a second, of which no other recipe has any use

    return optax.adam(rate, 0.9, 0.999)


@eqx.filter_jit
def _iterate(network, state, law, problem, active, penalty, rate):
    optimiser = _adam(rate)
    static = eqx.filter(network, eqx.is_inexact_array, inverse=True)

    def body(carry, _):
        dynamic, state = carry
        current = eqx.combine(dynamic, static)
        loss, gradient = eqx.filter_value_and_grad(paper_loss)(
            current, law, problem, active, penalty
        )
        updates, new_state = optimiser.update(gradient, state)
        updated = eqx.apply_updates(dynamic, updates)
        finite = jnp.isfinite(loss) & jnp.all(
            jnp.stack([jnp.all(jnp.isfinite(g)) for g in jax.tree.leaves(gradient)])
        )
        # A trial that runs away is a rejected step: weights and moments stay as they were
        keep = jax.tree.map(lambda new, old: jnp.where(finite, new, old), updated, dynamic)
        kept_state = jax.tree.map(lambda new, old: jnp.where(finite, new, old), new_state, state)
        return (keep, kept_state), loss

    dynamic = eqx.filter(network, eqx.is_inexact_array)
    (dynamic, state), losses = jax.lax.scan(body, (dynamic, state), None, length=_CHUNK)
    return eqx.combine(dynamic, static), state, losses


def train_paper(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    linear_relaxation: bool,
    recipe: PaperRecipe | None,
    progress: PaperProgress | None = None,
    base_law: AbstractConstitutiveLaw | None = None,
) -> tuple[TensorBasisNetwork, Float[np.ndarray, " m"]]:
    """Return a law trained by the paper's recipe, and the loss at every iteration.

    `problem`: the training data; series are added in the order of its runs. `key`: for the initial
    weights. `linear_relaxation`: whether −σ is known. `progress`: called every 50 iterations with
    iteration, total and loss. `base_law`: known law to which the network is added.
    """
    recipe = recipe or PaperRecipe()
    law = make_network(key, recipe.width, linear_relaxation)
    law = eqx.tree_at(lambda tree: tree.base, law, base_law, is_leaf=lambda leaf: leaf is None)
    network = law.network
    state = _adam(recipe.learning_rate).init(eqx.filter(network, eqx.is_inexact_array))
    n_runs = len(problem.flows)
    total = n_runs * recipe.iterations_per_series
    losses: list[np.ndarray] = []
    done = 0
    while done < total:
        series = min(done // recipe.iterations_per_series + 1, n_runs)
        active = jnp.arange(n_runs) < series
        network, state, chunk = _iterate(
            network, state, law, problem, active,
            jnp.asarray(recipe.penalty), jnp.asarray(recipe.learning_rate),
        )  # fmt: skip
        losses.append(np.asarray(chunk))
        done += _CHUNK
        if progress is not None:
            progress(min(done, total), total, float(chunk[-1]))
    return eqx.tree_at(lambda tree: tree.network, law, network), np.concatenate(losses)
