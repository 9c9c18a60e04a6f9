"""Recipes of training: the default, and that of the paper."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.files import kept_in_files
from discover.learners.tbnn_ude.evidence import negative_log_evidence
from discover.learners.tbnn_ude.problem import DefaultRecipe, Trained, TrainingProblem
from discover.learners.tbnn_ude.session import (
    Progress,
    Session,
    concurrent_trainings,
    functions_along,
    initial_law,
    invariant_sizes,
    nearly_constant_functions,
    without_network,
)
from discover.words import percent_of

_FAR = 0.1  # relative misfit of constants that no data have as noise

_THINS = np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])  # a Giesekus fluid's

_LEFT_OUT = (
    "functions on single tensors were not tried, to save time (recipe 'thorough' tries them)"
)


def train_default(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    linear_relaxation: bool,
    recipe: DefaultRecipe,
    progress: Progress | None = None,
    base_law: AbstractConstitutiveLaw | None = None,
) -> Trained:
    """Return a law trained by the default recipe.

    `key`: of the initial weights. `linear_relaxation`: whether −σ is known. `progress`: called
    after every step with step, largest number of steps and misfit. `base_law`: known law below the
    network.
    """
    session = Session(problem, recipe, progress)
    # beside a network that is zero the steps would be the same, at three times the work
    start = without_network(linear_relaxation, base_law)
    penalised, law = session.constants(start)
    if session.misfit(law) > _FAR:
        # from h = 0 the stress of a thinning fluid is too far away: from one that thins it is not
        thins = eqx.tree_at(lambda tree: tree.constants, start, jnp.asarray(_THINS))
        again = session.constants(thins)
        if session.misfit(again[1]) < session.misfit(law):
            penalised, law = again
    if session.settled(law) or recipe.max_tensors == 0:
        return _finish(session, law, penalised, False, "constant coefficients")
    # the invariants as the data's own stresses have them, from the best law so far
    scale = invariant_sizes(session.cloud(law))
    what = "coefficients that vary with the invariants"
    found, left_out = [], _LEFT_OUT
    if work(problem) <= recipe.affordable:
        start = initial_law(key, recipe.width, linear_relaxation, scale, base_law)
        penalised_race, raced = concurrent_trainings(session, start)
        found = [_finish(session, raced, penalised_race, True, what)]
        left_out = ""
    if not found or found[0].misfit > recipe.resolved:
        narrow = max(recipe.width // 2, 4)
        start = initial_law(key, narrow, linear_relaxation, scale, base_law)
        path = nearly_constant_functions(session, start, law.constants)
        what += ", as little as the residual allows"
        every = tuple(range(N_COEFFICIENTS))
        ends = path[-1:] if found else path
        found += [
            replace(_finish(session, one, one, True, what), tensors=every) for one in reversed(ends)
        ]
    # what leaves noise alone is better than what does not, by however little
    least = session.misfit(law)
    found = [one for one in found if one.misfit <= 0.9 * least or session.settled(one.law)]
    if not found:
        end = "constant coefficients, no function better"
        return replace(_finish(session, law, penalised, False, end), left_out=left_out)
    if len(found) == 1:
        return replace(found[0], left_out=left_out)
    order = np.argsort(negative_log_evidence([one.law for one in found], problem), kind="stable")
    first, *others = (found[i] for i in order)
    return replace(first, others=tuple(others), left_out=left_out)


def work(problem: TrainingProblem) -> float:
    """Return modes × runs × steps of time: the cost of integrating a problem."""
    return float(problem.modulus.size * problem.flows.n_steps)


def train_along(
    problem: TrainingProblem, key: PRNGKeyArray, found: TensorBasisNetwork,
    groups: Sequence[Sequence[int]], recipe: DefaultRecipe, progress: Progress | None,
) -> Trained:  # fmt: skip
    """Return a law whose tensors are given, from initial weights of its own.

    `found`: trained law, of which invariant scale, base and known relaxation are kept. `groups`:
    tensors, taken group by group while the law has not settled.
    """
    session = Session(problem, recipe, progress)
    assert found.invariant_scale is not None  # a law with varying coefficients has one
    start = initial_law(
        key, recipe.width, found.linear_relaxation, found.invariant_scale, found.base
    )
    penalised, law = functions_along(session, start, groups)
    return _finish(session, law, penalised, True, "coefficients that vary with the invariants")


def _finish(
    session: Session,
    law: TensorBasisNetwork,
    penalised: TensorBasisNetwork,
    varies: bool,
    what: str,
) -> Trained:
    misfit = session.misfit(law)
    settled = session.settled(law)
    end = "noise only" if settled else "a systematic residual remains"
    return Trained(
        law, penalised, misfit, varies,
        f"{what}; misfit {percent_of(misfit)}; {end}", tuple(session.taken) if varies else (),
        tuple(session.passed_over),
    )  # fmt: skip


_CHUNK = 50
"""Iterations between two looks at the clock; each chunk is one compiled scan."""

_INITIAL_OUTPUT = 0.01
"""Factor on the last layer's initial weights. A network of full size at the start makes some
trajectories diverge; the paper does not say how its network started."""


@kept_in_files
@dataclass(frozen=True)
class PaperRecipe:
    """Settings of the paper."""

    width: int = 32  # neurons in each of two hidden layers
    learning_rate: float = 1e-3  # of Adam, with decay rates 0.9 and 0.999
    penalty: float = 0.01  # factor κ on the sum of absolute weights
    iterations_per_series: int = 900  # iterations for each series added; 8 × 900 = 7,200 in all


def _with_series(problem: TrainingProblem, active: Bool[Array, " runs"]) -> TrainingProblem:
    """Return the problem with the other series at rest, where they cannot diverge."""
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
        # A trial that diverges is a rejected step: weights and moments stay as they were
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
    recipe: PaperRecipe,
    progress: Progress | None = None,
    base_law: AbstractConstitutiveLaw | None = None,
) -> tuple[TensorBasisNetwork, Float[np.ndarray, " m"]]:
    """Return a law trained by the paper's recipe, and the loss at every iteration.

    `problem`: the training data; series are added in the order of its runs. `key`: for the initial
    weights. `linear_relaxation`: whether −σ is known. `progress`: called every 50 iterations with
    iteration, total and loss. `base_law`: known law to which the network is added.
    """
    law = initial_law(key, recipe.width, linear_relaxation, None, base_law, _INITIAL_OUTPUT)
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
