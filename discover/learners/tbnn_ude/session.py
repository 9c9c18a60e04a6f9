"""What the rounds of one training share, and the rounds that every law goes through."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.initial_law import constant_scale, without_empty_terms
from discover.learners.tbnn_ude.least_squares import Objective, minimise, relative_misses
from discover.learners.tbnn_ude.prior import Cloud, PriorWeights, cloud_of, reweighted
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.recipe import DefaultRecipe
from discover.learners.tbnn_ude.variational import Along, trajectories
from discover.learners.tbnn_ude.weights import Rebuild, rebuilt

Progress = Callable[[int, int, float], None]


def is_white(residual: Float[np.ndarray, "runs n"], mask: np.ndarray) -> bool:
    """Return whether neighbouring residuals are uncorrelated, at three standard deviations."""
    pairs = mask[:, 1:] & mask[:, :-1]
    product = np.sum(np.where(pairs, residual[:, 1:] * residual[:, :-1], 0.0))
    correlation = product / max(np.sum(residual**2), 1e-300)
    return bool(abs(correlation) < 3.0 / np.sqrt(max(np.sum(pairs), 1)))


class Session:
    """What the rounds of one training share: the data, the history, the progress."""

    def __init__(self, problem: TrainingProblem, recipe: DefaultRecipe, progress: Progress | None):
        self.problem, self.recipe, self.progress = problem, recipe, progress
        self.misfits: list[float] = []
        self.taken: list[int] = []
        self.passed_over: list[int] = []
        self._latest: tuple[TensorBasisNetwork, Along] | None = None
        first = len(recipe.strengths) * recipe.steps + recipe.polish_steps
        trials = N_COEFFICIENTS * (START_STEPS + recipe.steps)
        search = recipe.max_tensors * (trials + _MOST_POLISHES * recipe.polish_steps)
        self.total = first + search

    def record(self, misfit: float) -> None:
        """Note a step, and tell of it."""
        self.misfits.append(misfit)
        if self.progress is not None:
            self.progress(min(len(self.misfits), self.total), self.total, misfit)

    def along(self, law: TensorBasisNetwork) -> Along:
        """Return what a law makes of the runs, and its states there."""
        # most questions are asked of the law that was trained last
        if self._latest is None or self._latest[0] is not law:
            self._latest = (law, trajectories(law, self.problem))
        return self._latest[1]

    def cloud(self, law: TensorBasisNetwork) -> Cloud:
        """Return the points of stress and rate that a law passes."""
        return cloud_of(self.along(law), self.problem)

    def residual(self, law: TensorBasisNetwork) -> np.ndarray:
        """Return what a law misses, relative to each run, shape (runs, n)."""
        return np.asarray(relative_misses(self.along(law), self.problem))

    def misfit(self, law: TensorBasisNetwork) -> float:
        """Return the relative misfit of a law; infinite where it runs away."""
        misfit = float(np.sqrt(np.sum(self.residual(law) ** 2)))
        return misfit if np.isfinite(misfit) else np.inf

    def round(
        self, law: TensorBasisNetwork, strength: float, tensors: np.ndarray, network: bool,
        steps: int, pace: list[float] | None = None, prior: PriorWeights | None = None,
    ) -> TensorBasisNetwork:  # fmt: skip
        """Return a law trained for one round, by default with the prior reweighted at its start.

        It ends early where it falls far behind the pace of a rival's misfits.
        """
        cloud = self.cloud(law)
        if not np.all(np.isfinite(np.asarray(cloud.stress))):
            return law
        make = Rebuild.with_network if network else Rebuild.of_constants
        rebuild = make(law, tensors, constant_scale(cloud))
        if prior is None:
            prior = reweighted(law, cloud, jnp.asarray(strength))
        objective = Objective(self.problem, rebuild, cloud, prior)
        target = 0.1 * self.recipe.exact
        weights = minimise(rebuild.start, objective, steps, self.record, target, pace)
        trained = rebuilt(rebuild, weights)
        # a law that runs away in some run is no progress
        return trained if np.isfinite(self.misfit(trained)) else law

    def white(self, law: TensorBasisNetwork) -> bool:
        """Return whether what a law leaves looks like noise."""
        return is_white(self.residual(law), self.problem.records.seen)

    def settled(self, law: TensorBasisNetwork) -> bool:
        """Return whether a law leaves noise or nothing."""
        return self.misfit(law) < self.recipe.exact or self.white(law)

    def constants(self, law: TensorBasisNetwork) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
        """Return the best law of few constants, before and after the penalty is taken away."""
        everything = np.ones(N_COEFFICIENTS, bool)
        for strength in self.recipe.strengths:
            law = self.round(law, strength, everything, False, self.recipe.steps)
            if self.white(law):
                break
        penalised = law
        for _ in range(_CLEARINGS):
            before = law
            law = without_empty_terms(law, self.cloud(law), self.recipe.removed_below)
            kept = np.asarray(law.constants) != 0.0
            law = self.round(law, 0.0, kept, False, self.recipe.polish_steps)
            if np.array_equal(kept, np.asarray(before.constants) != 0.0):
                break
        return penalised, law

    def polish(
        self, law: TensorBasisNetwork, misfit: float, tensors: np.ndarray
    ) -> TensorBasisNetwork:
        """Return a law trained on almost without prior, round by round while that pays.

        Each round begins with a fresh damping and with a prior as weak as the misfit is by then.
        """
        for _ in range(_MOST_POLISHES):
            before = misfit
            share = PRIOR_SHARE * min(1.0, before) ** 2
            law = self.round(law, share, tensors, True, self.recipe.polish_steps)
            misfit = self.misfit(law)
            if misfit > 0.5 * before or self.settled(law):
                break
        return law


_CLEARINGS = 3


START_STEPS = 6


_MOST_POLISHES = 3


PRIOR_SHARE = 1e-6
"""Strength of the prior while functions are learned. It only settles what the data leave open."""
