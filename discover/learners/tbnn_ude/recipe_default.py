"""The default recipe: constants first, then a network, by Levenberg–Marquardt.

Gradient descent needs thousands of passes because the trajectories make the weights very unequal:
a few directions decide almost all of the stress. The Jacobian from the variational equation costs
little more than a gradient, and a few dozen Gauss–Newton steps with it reach a misfit that Adam
does not reach in 7,200.

Two stages, each with a prior that prefers few and constant coefficients (see `prior`) and that is
relaxed until the residual is white or the relaxation ends:

1. the eight constants c_n alone;
2. if the residual they leave has structure, the whole network on top of them.

Then terms that the prior has emptied are removed and the rest is polished without it, so that what
is reported is not shrunk.
"""

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.least_squares import Objective, data_misfit, minimise
from discover.learners.tbnn_ude.prior import Cloud, parts, reweighted, sample_states
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.weights import Rebuild, trainable_mask, weights_of
from tensor_library.invariants import scalar_invariants

Progress = Callable[[int, int, float], None]


@dataclass(frozen=True)
class DefaultRecipe:
    """Settings of the default recipe; none of them knows which law made the data.

    Attributes
    ----------
    width
        Neurons in each of two hidden layers.
    constant_strengths, network_strengths
        Strength of the prior in the rounds of each stage, relative to the squared stress.
    variation_share
        Strength of the preference for constant coefficients over that for few.
    steps
        Levenberg–Marquardt steps a round.
    polish_steps
        Steps after the prior is gone.
    removed_below
        A term whose root mean square is below this part of the largest is removed.
    exact
        Relative misfit at which data count as fitted exactly: the error of integration.
    """

    width: int = 16
    constant_strengths: tuple[float, ...] = (1e-3, 1e-4)
    network_strengths: tuple[float, ...] = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 3e-6, 1e-6)
    variation_share: float = 1.0
    steps: int = 8
    polish_steps: int = 40
    removed_below: float = 2e-3
    exact: float = 1e-5


@dataclass(frozen=True)
class Trained:
    """A trained law.

    Attributes
    ----------
    law
        After the polish without prior.
    penalised_law
        As the prior left it.
    misfits
        Norm of all residuals after each step.
    misfit
        Relative misfit to the data at the end.
    varies
        Whether the network part was needed.
    message
        How the training ended.
    """

    law: TensorBasisNetwork
    penalised_law: TensorBasisNetwork
    misfits: Float[np.ndarray, " m"]
    misfit: float
    varies: bool
    message: str


def initial_law(
    key: PRNGKeyArray,
    width: int,
    linear_relaxation: bool,
    invariant_scale: Float[Array, "8"],
    base_law: AbstractConstitutiveLaw | None = None,
) -> TensorBasisNetwork:
    """Return a law with h = 0: the last layer starts at zero, the hidden ones at random."""
    law = TensorBasisNetwork.initialise(key, width, 2, linear_relaxation)
    law = eqx.tree_at(lambda tree: tree.base, law, base_law, is_leaf=lambda leaf: leaf is None)
    last = law.network.layers[-1]
    law = eqx.tree_at(
        lambda tree: (tree.network.layers[-1].weight, tree.network.layers[-1].bias),
        law,
        (jnp.zeros_like(last.weight), jnp.zeros_like(last.bias)),
    )
    return eqx.tree_at(
        lambda tree: tree.invariant_scale, law, invariant_scale, is_leaf=lambda leaf: leaf is None
    )


def invariant_sizes(cloud: Cloud) -> Float[Array, "8"]:
    """Return the root mean square of every invariant, or one where it vanishes."""
    invariants = jax.vmap(scalar_invariants)(cloud.stress, cloud.rate)
    size = jnp.sqrt(jnp.mean(invariants**2, axis=0))
    return jnp.where(size > 1e-12, size, 1.0)


def is_white(residual: Float[np.ndarray, "runs n"], mask: np.ndarray) -> bool:
    """Return whether neighbouring residuals are uncorrelated, at three standard deviations."""
    pairs = mask[:, 1:] & mask[:, :-1]
    product = np.sum(np.where(pairs, residual[:, 1:] * residual[:, :-1], 0.0))
    correlation = product / max(np.sum(residual**2), 1e-300)
    return abs(correlation) < 3.0 / np.sqrt(max(np.sum(pairs), 1))


class _Session:
    """State shared by the rounds of one training: the data, the history, the progress."""

    def __init__(self, problem: TrainingProblem, recipe: DefaultRecipe, progress: Progress | None):
        self.problem, self.recipe, self.progress = problem, recipe, progress
        self.misfits: list[float] = []
        rounds = len(recipe.constant_strengths) + len(recipe.network_strengths)
        self.total = rounds * recipe.steps + 2 * recipe.polish_steps

    def record(self, misfit: float) -> None:
        self.misfits.append(misfit)
        if self.progress is not None:
            self.progress(min(len(self.misfits), self.total), self.total, misfit)

    def residual(self, law: TensorBasisNetwork) -> np.ndarray:
        rebuild = Rebuild(law, trainable_mask(law, np.ones(N_COEFFICIENTS, bool), True))
        cloud = sample_states(law, self.problem)
        objective = Objective(self.problem, rebuild, cloud, reweighted(law, cloud, 0.0))
        return np.asarray(data_misfit(weights_of(law), objective))

    def misfit(self, law: TensorBasisNetwork) -> float:
        return float(np.sqrt(np.sum(self.residual(law) ** 2)))

    def round(
        self, law: TensorBasisNetwork, strength: float, constants: np.ndarray, network: bool,
        steps: int,
    ) -> TensorBasisNetwork:  # fmt: skip
        """Return a law trained for one round with the prior reweighted at its start."""
        rebuild = Rebuild(law, trainable_mask(law, constants, network))
        cloud = sample_states(law, self.problem)
        if not bool(jnp.all(jnp.isfinite(cloud.stress))):
            return law
        objective = Objective(
            self.problem,
            rebuild,
            cloud,
            reweighted(law, cloud, strength, self.recipe.variation_share),
        )
        weights = minimise(
            weights_of(law), objective, steps, self.record, target=0.1 * self.recipe.exact
        )
        return rebuild(jnp.asarray(weights))

    def anneal(
        self, law: TensorBasisNetwork, strengths: tuple[float, ...], network: bool
    ) -> TensorBasisNetwork:
        """Return a law trained with an ever weaker prior, until its residual is noise."""
        everything = np.ones(N_COEFFICIENTS, bool)
        for strength in strengths:
            law = self.round(law, strength, everything, network, self.recipe.steps)
            if is_white(self.residual(law), np.asarray(self.problem.grids.sample_mask)):
                break
        return law

    def settled(self, law: TensorBasisNetwork) -> bool:
        residual = self.residual(law)
        small = np.sqrt(np.sum(residual**2)) < self.recipe.exact
        return small or is_white(residual, np.asarray(self.problem.grids.sample_mask))


def train_default(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    linear_relaxation: bool,
    recipe: DefaultRecipe | None = None,
    progress: Progress | None = None,
    base_law: AbstractConstitutiveLaw | None = None,
) -> Trained:
    """Return a law trained by the default recipe.

    Parameters
    ----------
    problem
        The training data.
    key
        For the initial weights.
    linear_relaxation
        Whether −σ is known.
    recipe
        Settings.
    progress
        Called after every step with step, total number of steps (at most) and misfit.
    base_law
        Known law to which the network is added.
    """
    recipe = recipe or DefaultRecipe()
    session = _Session(problem, recipe, progress)
    law = initial_law(key, recipe.width, linear_relaxation, jnp.ones(N_COEFFICIENTS), base_law)
    law = session.anneal(law, recipe.constant_strengths, network=False)
    penalised = law
    law = _without_empty_terms(law, sample_states(law, problem), recipe.removed_below)
    kept = np.asarray(law.constants) != 0.0
    law = session.round(law, 0.0, kept, False, recipe.polish_steps)
    if session.settled(law):
        return _finish(session, law, penalised, False, "eight constants suffice")

    scale = invariant_sizes(sample_states(law, problem))
    start = initial_law(key, recipe.width, linear_relaxation, scale, base_law)
    start = eqx.tree_at(lambda tree: tree.constants, start, penalised.constants)
    law = session.anneal(start, recipe.network_strengths, network=True)
    penalised = law
    law = _without_empty_terms(law, sample_states(law, problem), recipe.removed_below)
    kept = np.asarray(law.constants) != 0.0
    # Hundreds of weights would fit noise: polish without prior only where there is none
    noisy = is_white(session.residual(penalised), np.asarray(problem.grids.sample_mask))
    final = recipe.network_strengths[-1] if not noisy else recipe.network_strengths[0]
    law = session.round(law, 0.1 * final, kept, True, recipe.polish_steps)
    return _finish(session, law, penalised, True, "coefficients vary with the invariants")


def _without_empty_terms(
    law: TensorBasisNetwork, cloud: Cloud, removed_below: float
) -> TensorBasisNetwork:
    """Return the law without the terms, and the variations, that the prior has emptied."""
    amount, variation = (
        np.sqrt(np.mean(np.asarray(rows) ** 2, axis=0)) for rows in parts(law, cloud)
    )
    limit = removed_below * max(float(np.max(amount)), 1e-12)
    present = amount > limit
    varying = present & (variation > limit) & (np.asarray(law.network_mask) > 0)
    # A coefficient that stops varying keeps its mean
    mean = np.mean(np.asarray(cloud.coefficients(law)), axis=0)
    constants = np.where(varying, np.asarray(law.constants), np.where(present, mean, 0.0))
    return eqx.tree_at(
        lambda tree: (tree.constants, tree.network_mask),
        law,
        (jnp.asarray(constants), jnp.asarray(varying, dtype=law.network_mask.dtype)),
    )


def _finish(
    session: _Session,
    law: TensorBasisNetwork,
    penalised: TensorBasisNetwork,
    varies: bool,
    what: str,
) -> Trained:
    misfit = session.misfit(law)
    settled = session.settled(law)
    end = "the residual is noise or nothing" if settled else "the residual still has structure"
    return Trained(
        law,
        penalised,
        np.asarray(session.misfits),
        misfit,
        varies,
        f"{what}; relative misfit {misfit:.2g}; {end}",
    )
