"""Several networks from different initial weights, trained side by side in one program.

The first member searches for the tensors whose coefficients have to vary; the others learn
functions on the same tensors from initial weights of their own. What they disagree on, the data and
the prior leave open.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude.least_squares import (
    Objective,
    Stopping,
    first_state,
    law_misfit,
    linearise,
    next_state,
    norm_of_cost,
)
from discover.learners.tbnn_ude.prior import reweighted, sample_states
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.recipe_default import (
    PRIOR_SHARE,
    DefaultRecipe,
    Progress,
    constant_scale,
    initial_law,
)
from discover.learners.tbnn_ude.weights import Rebuild


def train_members(
    problem: TrainingProblem,
    found: TensorBasisNetwork,
    keys: Key[Array, " members"],
    recipe: DefaultRecipe,
    progress: Progress | None = None,
) -> list[TensorBasisNetwork]:
    """Return networks on the tensors of a trained law, one for each key.

    Each is what `train_members` returns for its key alone, to the rounding of a batched matrix
    product.

    Parameters
    ----------
    problem
        The training data.
    found
        A trained law: its tensors, invariant scale, base and known relaxation are taken over, its
        weights are not.
    keys
        For the initial weights, shape (members,).
    recipe
        Settings.
    progress
        Called after every step with step, total number of steps (at most) and mean misfit.
    """
    tensors = np.asarray(found.network_mask) > 0
    laws = _initial(keys, found, recipe.width)
    total = recipe.steps + recipe.polish_steps
    steps = 0

    def step(misfits: Float[np.ndarray, " members"]) -> None:
        nonlocal steps
        steps += 1
        if progress is not None:
            progress(min(steps, total), total, float(np.mean(misfits)))

    for strength, most in ((PRIOR_SHARE, recipe.steps), (None, recipe.polish_steps)):
        misfits = member_misfits(laws, problem)
        share = strength or PRIOR_SHARE * np.minimum(1.0, misfits) ** 2
        laws = _round(laws, problem, share, tensors, most, 0.1 * recipe.exact, step)
    return [member_of(laws, i) for i in range(keys.shape[0])]


def stack_members(members: list[TensorBasisNetwork]) -> TensorBasisNetwork:
    """Return the members as one law with a leading axis on every array."""
    arrays = [eqx.partition(member, eqx.is_array) for member in members]
    return eqx.combine(_stack([a for a, _ in arrays]), arrays[0][1])


def _stack(trees):
    # on the host: no program to compile for every shape of a leaf
    return jax.tree.map(lambda *leaves: jnp.asarray(np.stack(leaves)), *trees)


def member_of(laws: TensorBasisNetwork, index: int) -> TensorBasisNetwork:
    """Return one member of a stacked law."""
    arrays, rest = eqx.partition(laws, eqx.is_array)
    return eqx.combine(
        jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)[index]), arrays), rest
    )


def member_misfits(
    laws: TensorBasisNetwork, problem: TrainingProblem
) -> Float[np.ndarray, " members"]:
    """Return the relative misfit of every member of a stacked law; infinite where it runs away."""
    # one by one: a batched integration would be one more program to compile, for milliseconds
    members = [member_of(laws, i) for i in range(laws.constants.shape[0])]
    misfits = np.array([np.linalg.norm(np.asarray(law_misfit(law, problem))) for law in members])
    return np.where(np.isfinite(misfits), misfits, np.inf)


def _initial(
    keys: Key[Array, " members"], found: TensorBasisNetwork, width: int
) -> TensorBasisNetwork:
    scale = found.invariant_scale
    assert scale is not None  # a law with varying coefficients has one

    def one(key):
        law = initial_law(key, width, found.linear_relaxation, scale, found.base)
        return eqx.tree_at(lambda tree: tree.network_mask, law, found.network_mask)

    return eqx.filter_vmap(one)(keys)


@eqx.filter_jit
def _begin(laws, clouds, tensors, strengths):
    def one(law, cloud, strength):
        rebuild = Rebuild.with_network(law, np.array(tensors), constant_scale(cloud))
        prior = reweighted(law, cloud, strength)
        return (rebuild, cloud, prior), rebuild.start

    return eqx.filter_vmap(one)(laws, clouds, strengths)


@eqx.filter_jit
def _linearised(weights, parts, problem):
    return eqx.filter_vmap(lambda w, part: linearise(w, Objective(problem, *part)))(weights, parts)


_first_states = eqx.filter_jit(eqx.filter_vmap(first_state))
_next_states = eqx.filter_jit(eqx.filter_vmap(next_state))


@eqx.filter_jit
def _laws(parts, weights):
    return eqx.filter_vmap(lambda part, w: part[0](w))(parts, weights)


def _round(
    laws: TensorBasisNetwork,
    problem: TrainingProblem,
    strength: Float[np.ndarray, " members"] | float,
    tensors: np.ndarray,
    steps: int,
    target: float,
    callback,
) -> TensorBasisNetwork:
    """Train every member for one round; one that has ended keeps its weights while others go on."""
    n = laws.constants.shape[0]
    strengths = jnp.asarray(np.broadcast_to(strength, (n,)).astype(float))
    clouds = _stack([sample_states(member_of(laws, i), problem) for i in range(n)])
    parts, weights = _begin(laws, clouds, tuple(map(bool, tensors)), strengths)
    best = np.array(weights)
    stopping, going = [Stopping(target) for _ in range(n)], np.ones(n, bool)
    misfits = np.full(n, np.inf)
    linearised = _linearised(weights, parts, problem)
    state = _first_states(linearised)
    for step in range(steps):
        if step:
            linearised = _linearised(state.y_eval, parts, problem)
        weights, state = _next_states(weights, linearised, state)
        costs = np.asarray(_costs(state))
        for i in np.flatnonzero(going):
            misfits[i] = norm_of_cost(float(costs[i]))
            if np.isfinite(misfits[i]):
                best[i] = np.asarray(weights[i])
            going[i] = not stopping[i].done(float(misfits[i]))
        callback(misfits)
        if not np.any(going):
            break
    return _laws(parts, jnp.asarray(best))


@eqx.filter_jit
def _costs(state) -> Float[Array, " members"]:
    return eqx.filter_vmap(lambda s: s.f_info.as_min())(state)
