"""How a network is trained."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.evidence import surprises
from discover.learners.tbnn_ude.problem import DefaultRecipe, Trained, TrainingProblem
from discover.learners.tbnn_ude.session import (
    Progress,
    Session,
    functions_along,
    initial_law,
    invariant_sizes,
    nearly_constant_functions,
    race_of_functions,
    without_network,
)

_FAR = 0.1  # relative misfit of constants that no data have as noise

_THINS = np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])  # a Giesekus fluid's

_LEFT_OUT = (
    "functions on single tensors were not tried, to save time (recipe 'thorough' tries them)"
)


def train_default(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    linear_relaxation: bool,
    recipe: DefaultRecipe | None,
    progress: Progress | None = None,
    base_law: AbstractConstitutiveLaw | None = None,
) -> Trained:
    """Return a law trained by the default recipe.

    `key`: of the initial weights. `linear_relaxation`: whether −σ is known. `progress`: called
    after every step with step, largest number of steps and misfit. `base_law`: known law below the
    network.
    """
    recipe = recipe or DefaultRecipe()
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
        penalised_race, raced = race_of_functions(session, start)
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
    order = np.argsort(surprises([one.law for one in found], problem), kind="stable")
    first, *others = (found[i] for i in order)
    return replace(first, others=tuple(others), left_out=left_out)


def work(problem: TrainingProblem) -> float:
    """Return modes × runs × steps of time: the cost of integrating a problem."""
    return float(problem.modulus.size * problem.flows.n_steps)


def train_constants(
    problem: TrainingProblem,
    linear_relaxation: bool,
    recipe: DefaultRecipe,
    base_law: AbstractConstitutiveLaw | None,
) -> Trained:
    """Return the law of few constants that explains some runs: the recipe's first stage alone."""
    session = Session(problem, recipe, None)
    penalised, law = session.constants(without_network(linear_relaxation, base_law))
    return _finish(session, law, penalised, False, "constant coefficients")


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
    end = "the residual is noise or nothing" if settled else "the residual still has structure"
    return Trained(
        law, penalised, misfit, varies,
        f"{what}; relative misfit {misfit:.2g}; {end}", tuple(session.taken) if varies else (),
        tuple(session.passed_over),
    )  # fmt: skip
