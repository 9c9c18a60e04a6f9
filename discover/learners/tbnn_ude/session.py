"""Rounds of one training, and what they share."""

from collections.abc import Callable, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude import least_squares
from discover.learners.tbnn_ude.problem import DefaultRecipe, TrainingProblem
from discover.learners.tbnn_ude.variational import Along, Rebuild, rebuilt, trajectories
from discover.programs import compiled, on_device
from tensor_library.algebra import scalar_invariants


@eqx.filter_jit
def initial_law(
    key: PRNGKeyArray,
    width: int,
    linear_relaxation: bool,
    invariant_scale: Float[Array, "8"] | None,
    base_law: AbstractConstitutiveLaw | None = None,
    output: float = 0.0,
) -> TensorBasisNetwork:
    """Return a law at the start: hidden layers at random, the last one by default at zero (h = 0).

    `output`: factor on the random weights of the last layer.
    """
    law = TensorBasisNetwork.initialise(key, width, 2, linear_relaxation)
    law = eqx.tree_at(lambda tree: tree.base, law, base_law, is_leaf=lambda leaf: leaf is None)
    last = law.network.layers[-1]
    law = eqx.tree_at(
        lambda tree: (tree.network.layers[-1].weight, tree.network.layers[-1].bias),
        law,
        (output * last.weight, jnp.zeros_like(last.bias)),
    )
    return eqx.tree_at(
        lambda tree: tree.invariant_scale, law, invariant_scale, is_leaf=lambda leaf: leaf is None
    )


def without_network(
    linear_relaxation: bool, base_law: AbstractConstitutiveLaw | None = None
) -> TensorBasisNetwork:
    """Return a law with h = 0 whose coefficients are constants."""
    zero = on_device(np.zeros(N_COEFFICIENTS))
    return TensorBasisNetwork(
        network=None,
        constants=zero,
        network_mask=zero,
        linear_relaxation=linear_relaxation,
        base=base_law,
    )


@compiled
def invariant_sizes(cloud: least_squares.Cloud) -> Float[Array, "8"]:
    """Return the root mean square of every invariant, or one where it vanishes."""
    invariants = jax.vmap(scalar_invariants)(cloud.stress, cloud.rate)
    shares = (cloud.weight**2 / jnp.mean(cloud.weight**2))[:, None]
    size = jnp.sqrt(jnp.mean(shares * invariants**2, axis=0))
    return jnp.where(size > 1e-12, size, 1.0)


@compiled
def constant_scale(cloud: least_squares.Cloud) -> Float[Array, "8"]:
    """Return the unit of each constant: one over the root mean square of its tensor."""
    size = jnp.sqrt(jnp.mean(cloud.size**2, axis=0))
    return 1.0 / jnp.maximum(size, 1e-6)


def with_tensors(law: TensorBasisNetwork, tensors: np.ndarray) -> TensorBasisNetwork:
    """Return the law in which the coefficients of these tensors may vary."""
    mask = on_device(np.asarray(tensors, dtype=law.network_mask.dtype))
    return eqx.tree_at(lambda tree: tree.network_mask, law, mask)


def without_empty_terms(
    law: TensorBasisNetwork, cloud: least_squares.Cloud, removed_below: float
) -> TensorBasisNetwork:
    """Return the law without the terms, and the variations, that the prior has emptied."""
    amount, variation = (
        np.sqrt(np.mean(np.asarray(rows) ** 2, axis=0)) for rows in least_squares.parts(law, cloud)
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
        (on_device(constants), on_device(varying.astype(law.network_mask.dtype))),
    )


Progress = Callable[[int, int, float], None]


def is_white(residual: Float[np.ndarray, "runs n"], mask: np.ndarray) -> bool:
    """Return whether neighbouring residuals are uncorrelated, at three standard deviations."""
    pairs = mask[:, 1:] & mask[:, :-1]
    product = np.sum(np.where(pairs, residual[:, 1:] * residual[:, :-1], 0.0))
    correlation = product / max(np.sum(residual**2), 1e-300)
    return bool(abs(correlation) < 3.0 / np.sqrt(max(np.sum(pairs), 1)))


class Session:
    """Rounds of one training: they share the data, the history and the progress."""

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

    def cloud(self, law: TensorBasisNetwork) -> least_squares.Cloud:
        """Return the points of stress and rate that a law passes."""
        return least_squares.cloud_of(self.along(law), self.problem)

    def residual(self, law: TensorBasisNetwork) -> np.ndarray:
        """Return what a law misses, relative to each run, shape (runs, n)."""
        return np.asarray(least_squares.relative_misses(self.along(law), self.problem))

    def misfit(self, law: TensorBasisNetwork) -> float:
        """Return the relative misfit of a law; infinite where it diverges."""
        misfit = float(np.sqrt(np.sum(self.residual(law) ** 2)))
        return misfit if np.isfinite(misfit) else np.inf

    def round(
        self, law: TensorBasisNetwork, strength: float, tensors: np.ndarray, network: bool,
        steps: int, pace: list[float] | None = None,
        prior: least_squares.PriorWeights | None = None,
    ) -> TensorBasisNetwork:  # fmt: skip
        """Return a law trained for one round, by default with the prior reweighted at its start.

        It ends early where it falls far behind the pace of a rival's misfits.
        """
        cloud = self.cloud(law)
        if not np.all(np.isfinite(np.asarray(cloud.stress))):
            return law
        rebuild = Rebuild.of(law, tensors, constant_scale(cloud), network)
        if prior is None:
            prior = least_squares.reweighted(law, cloud, on_device(strength))
        objective = least_squares.Objective(self.problem, rebuild, cloud, prior)
        target = 0.1 * self.recipe.exact
        weights = least_squares.minimise(rebuild.start, objective, steps, self.record, target, pace)
        trained = rebuilt(rebuild, weights)
        # a law that diverges in some run is no progress
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

        Each round begins with a fresh damping and a prior as weak as the misfit is by then.
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


_POLISHED = 2
_CLOSE = 1.5  # what lies further behind the best of a race is not polished
_MORE_ROUNDS = 4  # with the least penalty, while they pay: near laws that diverge steps are short
_STILL_GAINS = 0.95  # white or not, a residual that still falls so much holds more than noise


def concurrent_trainings(
    session: Session, start: TensorBasisNetwork
) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return the best law of few tensors with varying coefficients, before and after polish."""
    chosen = np.zeros(N_COEFFICIENTS, bool)
    law, misfit = start, np.inf
    penalised = law
    for _ in range(session.recipe.max_tensors):
        # first the best constant on each tensor: from h = 0 a whole network's first step
        # overshoots; then a race of functions, in which those far behind are given up
        starts = []
        for tensor in np.flatnonzero(~chosen):
            tensors = chosen.copy()
            tensors[tensor] = True
            start = session.round(with_tensors(law, tensors), 0.0, tensors, False, START_STEPS)
            starts.append((session.misfit(start), int(tensor), start, tensors))
        trials, pace = [], None
        for _, tensor, start, tensors in sorted(starts, key=lambda s: s[:2]):
            before = len(session.misfits)
            trial = session.round(start, PRIOR_SHARE, tensors, True, session.recipe.steps, pace)
            trials.append((session.misfit(trial), tensor, trial))
            if min(trials, key=lambda trial: trial[:2])[1] == tensor:
                pace = session.misfits[before:]
        trials.sort(key=lambda trial: trial[:2])
        if not trials[0][0] < misfit:
            break
        tensor, penalised, law = _polished(session, trials, chosen)
        if not session.taken:
            session.passed_over = [t for _, t, _ in trials if t != tensor]
        session.taken.append(tensor)
        chosen[tensor] = True
        misfit = session.misfit(law)
        if misfit < session.recipe.resolved or session.settled(law):
            break
    return penalised, law


def _polished(
    session: Session, trials: Sequence[tuple[float, int, TensorBasisNetwork]], chosen: np.ndarray
) -> tuple[int, TensorBasisNetwork, TensorBasisNetwork]:
    """Return the tensor that does best in the end, and its law before and after polish.

    The race hardly predicts the next steps: the first tensor has to be right before a second.
    """
    ends = []
    for reached, tensor, trial in trials[:_POLISHED]:
        if reached > _CLOSE * trials[0][0]:
            break
        tensors = chosen.copy()
        tensors[tensor] = True
        law = trial if session.settled(trial) else session.polish(trial, reached, tensors)
        ends.append((session.misfit(law), tensor, trial, law))
        if ends[-1][0] < session.recipe.resolved or session.settled(law):
            return tensor, trial, law
    _, tensor, trial, law = min(ends, key=lambda end: end[:2])
    return tensor, trial, law


def nearly_constant_functions(
    session: Session, start: TensorBasisNetwork, constants: Float[Array, "8"]
) -> list[TensorBasisNetwork]:
    """Return laws whose coefficients vary as little as the residual allows, the last the best.

    Earlier ones are held to less variation still.
    """
    everything = np.ones(N_COEFFICIENTS, bool)
    law = with_tensors(start, everything)
    law = eqx.tree_at(lambda tree: tree.constants, law, constants)
    found = []
    before = np.inf
    variations = session.recipe.variations
    for number, strength in enumerate([*variations, *_MORE_ROUNDS * variations[-1:]]):
        prior = least_squares.least_variation(on_device(strength))
        law = session.round(law, strength, everything, True, session.recipe.steps, prior=prior)
        misfit = session.misfit(law)
        if misfit < before:  # the same law twice is no second opinion
            found.append(law)
        settled, gains = session.settled(law), misfit <= _STILL_GAINS * before
        through = number + 1 >= len(variations)
        if (settled and not gains) or (through and (settled or not gains)):
            break
        before = misfit
    return found


def functions_along(
    session: Session, start: TensorBasisNetwork, groups: Sequence[Sequence[int]]
) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
    """Return a law that takes tensors group by group, without a race, as far as that pays."""
    chosen = np.zeros(N_COEFFICIENTS, bool)
    law, misfit = start, np.inf
    penalised = law
    for group in groups:
        tensors = chosen.copy()
        tensors[list(group)] = True
        trial = session.round(with_tensors(law, tensors), 0.0, tensors, False, START_STEPS)
        trial = session.round(trial, PRIOR_SHARE, tensors, True, session.recipe.steps)
        polished, reached = trial, session.misfit(trial)
        if not session.settled(trial):
            polished = session.polish(trial, reached, tensors)
        if session.misfit(polished) < misfit:
            chosen, law, penalised, misfit = tensors, polished, trial, session.misfit(polished)
            session.taken = [int(t) for t in np.flatnonzero(chosen)]
        if misfit < session.recipe.resolved or session.settled(law):
            break
    return penalised, law
