"""The default recipe: few tensors, constants before functions, by Levenberg–Marquardt.

Gradient descent needs thousands of passes because the trajectories make the weights very unequal:
a few directions decide almost all of the stress. The Jacobian from the variational equation costs
a few gradients, and a few dozen Gauss–Newton steps with it reach a misfit that Adam does not reach
in 7,200.

Shear stress cannot tell apart laws that differ in tensors nobody measured, so the recipe asks for
the smallest law that explains it, in this order:

1. the eight constants c_n alone, with a penalty that empties tensors (see `prior`) and is then
   taken away;
2. if what they leave has structure, coefficient functions on one tensor, raced for each of the
   eight; then on one more tensor beside the best, while the misfit is above what a rheometer
   resolves;
3. where noise hides more than that, many functions fit, and the one that happens to fit best may
   be large, bent, and far off in N1. So the constants of the first stage are also tried with the
   least variation that leaves noise alone, on all tensors at once, and the likelier law of the two
   is taken (see `evidence`). With many modes, runs and steps only these are tried, and the training
   says so: `affordable` has the rest.

The last training of each stage is without penalty, or nearly: what is reported is not shrunk.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.tensor_basis_network import N_COEFFICIENTS, TensorBasisNetwork
from discover.learners.tbnn_ude.evidence import surprises
from discover.learners.tbnn_ude.least_squares import Objective, minimise, relative_misses
from discover.learners.tbnn_ude.prior import (
    Cloud,
    PriorWeights,
    cloud_of,
    least_variation,
    parts,
    reweighted,
)
from discover.learners.tbnn_ude.problem import TrainingProblem
from discover.learners.tbnn_ude.variational import trajectories
from discover.learners.tbnn_ude.weights import Rebuild, rebuilt
from discover.programs import compiled
from tensor_library.invariants import scalar_invariants

Progress = Callable[[int, int, float], None]


@dataclass(frozen=True)
class DefaultRecipe:
    """Settings of the default recipe; none of them knows which law made the data.

    Attributes
    ----------
    width
        Neurons in each of two hidden layers; half as many where coefficients vary little.
    affordable
        Work (modes times runs times steps of time) up to which functions on single tensors are
        tried; the recipe ``"thorough"`` always tries them.
    samples
        Most samples of a run that are fitted where the work is more than that.
    strengths
        Strength of the penalty in the rounds of the first stage, relative to the squared stress.
    variations
        Strength of the penalty on variation, likewise: the first that leaves noise alone ends.
    steps
        Levenberg–Marquardt steps a round, and for each tensor tried.
    polish_steps
        Steps after the penalty is gone.
    max_tensors
        Most tensors with coefficients that vary.
    removed_below
        A term whose root mean square is below this part of the largest is removed.
    resolved
        Relative misfit below which no further tensor is asked for: less than rheometers resolve.
    exact
        Relative misfit at which data count as fitted exactly: the error of integration.
    """

    width: int = 12
    affordable: float = 6000.0
    samples: int = 100
    strengths: tuple[float, ...] = (1e-3, 1e-4)
    variations: tuple[float, ...] = (1.0, 0.1, 1e-2, 1e-3)
    steps: int = 10
    polish_steps: int = 40
    max_tensors: int = 3
    removed_below: float = 2e-3
    resolved: float = 5e-4
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
    tensors
        Tensors whose coefficients vary, in the order in which they were taken.
    passed_over
        The other tensors, from which a law could have started, the least misfit first.
    others
        Less likely laws that were met on the way.
    left_out
        What was not tried, to save time, in words.
    """

    law: TensorBasisNetwork
    penalised_law: TensorBasisNetwork
    misfits: Float[np.ndarray, " m"]
    misfit: float
    varies: bool
    message: str
    tensors: tuple[int, ...] = ()
    passed_over: tuple[int, ...] = ()
    others: "tuple[Trained, ...]" = ()
    left_out: str = ""


@eqx.filter_jit
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


@compiled
def invariant_sizes(cloud: Cloud) -> Float[Array, "8"]:
    """Return the root mean square of every invariant, or one where it vanishes."""
    invariants = jax.vmap(scalar_invariants)(cloud.stress, cloud.rate)
    shares = (cloud.weight**2 / jnp.mean(cloud.weight**2))[:, None]
    size = jnp.sqrt(jnp.mean(shares * invariants**2, axis=0))
    return jnp.where(size > 1e-12, size, 1.0)


@compiled
def constant_scale(cloud: Cloud) -> Float[Array, "8"]:
    """Return the unit of each constant: one over the root mean square of its tensor."""
    size = jnp.sqrt(jnp.mean(cloud.size**2, axis=0))
    return 1.0 / jnp.maximum(size, 1e-6)


def is_white(residual: Float[np.ndarray, "runs n"], mask: np.ndarray) -> bool:
    """Return whether neighbouring residuals are uncorrelated, at three standard deviations."""
    pairs = mask[:, 1:] & mask[:, :-1]
    product = np.sum(np.where(pairs, residual[:, 1:] * residual[:, :-1], 0.0))
    correlation = product / max(np.sum(residual**2), 1e-300)
    return bool(abs(correlation) < 3.0 / np.sqrt(max(np.sum(pairs), 1)))


class _Session:
    """What the rounds of one training share: the data, the history, the progress."""

    def __init__(self, problem: TrainingProblem, recipe: DefaultRecipe, progress: Progress | None):
        self.problem, self.recipe, self.progress = problem, recipe, progress
        self.misfits: list[float] = []
        self.taken: list[int] = []
        self.passed_over: list[int] = []
        self._latest: tuple[TensorBasisNetwork, Float[Array, "runs n k 4"]] | None = None
        first = len(recipe.strengths) * recipe.steps + recipe.polish_steps
        trials = N_COEFFICIENTS * (_START_STEPS + recipe.steps)
        search = recipe.max_tensors * (trials + _MOST_POLISHES * recipe.polish_steps)
        self.total = first + search

    def record(self, misfit: float) -> None:
        self.misfits.append(misfit)
        if self.progress is not None:
            self.progress(min(len(self.misfits), self.total), self.total, misfit)

    def states(self, law: TensorBasisNetwork) -> Float[Array, "runs n k 4"]:
        # most questions are asked of the law that was trained last
        if self._latest is None or self._latest[0] is not law:
            self._latest = (law, trajectories(law, self.problem))
        return self._latest[1]

    def cloud(self, law: TensorBasisNetwork) -> Cloud:
        return cloud_of(self.states(law), self.problem)

    def residual(self, law: TensorBasisNetwork) -> np.ndarray:
        return np.asarray(relative_misses(self.states(law), self.problem))

    def misfit(self, law: TensorBasisNetwork) -> float:
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
        if not bool(jnp.all(jnp.isfinite(cloud.stress))):
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
        return is_white(self.residual(law), np.asarray(self.problem.grids.sample_mask))

    def settled(self, law: TensorBasisNetwork) -> bool:
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
            law = _without_empty_terms(law, self.cloud(law), self.recipe.removed_below)
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

    def functions(self, start: TensorBasisNetwork) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
        """Return the best law of few tensors with varying coefficients, before and after polish."""
        chosen = np.zeros(N_COEFFICIENTS, bool)
        law, misfit = start, np.inf
        penalised = law
        for _ in range(self.recipe.max_tensors):
            # first the best constant on each tensor: from h = 0 a whole network's first step
            # overshoots; then a race of functions, in which those far behind are given up
            starts = []
            for tensor in np.flatnonzero(~chosen):
                tensors = chosen.copy()
                tensors[tensor] = True
                start = self.round(_with_tensors(law, tensors), 0.0, tensors, False, _START_STEPS)
                starts.append((self.misfit(start), int(tensor), start, tensors))
            trials, pace = [], None
            for _, tensor, start, tensors in sorted(starts, key=lambda s: s[:2]):
                before = len(self.misfits)
                trial = self.round(start, PRIOR_SHARE, tensors, True, self.recipe.steps, pace)
                trials.append((self.misfit(trial), tensor, trial))
                if min(trials, key=lambda trial: trial[:2])[1] == tensor:
                    pace = self.misfits[before:]
            trials.sort(key=lambda trial: trial[:2])
            if not trials[0][0] < misfit:
                break
            tensor, penalised, law = self.polished(trials, chosen)
            if not self.taken:
                self.passed_over = [t for _, t, _ in trials if t != tensor]
            self.taken.append(tensor)
            chosen[tensor] = True
            misfit = self.misfit(law)
            if misfit < self.recipe.resolved or self.settled(law):
                break
        return penalised, law

    def polished(
        self, trials: Sequence[tuple[float, int, TensorBasisNetwork]], chosen: np.ndarray
    ) -> tuple[int, TensorBasisNetwork, TensorBasisNetwork]:
        """Return the tensor that does best in the end, and its law before and after polish.

        The race says little of what a few more steps make of the next ones: before a second tensor
        is asked for, the first has to be the right one.
        """
        ends = []
        for reached, tensor, trial in trials[:_POLISHED]:
            if reached > _CLOSE * trials[0][0]:
                break
            tensors = chosen.copy()
            tensors[tensor] = True
            law = trial if self.settled(trial) else self.polish(trial, reached, tensors)
            ends.append((self.misfit(law), tensor, trial, law))
            if ends[-1][0] < self.recipe.resolved or self.settled(law):
                return tensor, trial, law
        _, tensor, trial, law = min(ends, key=lambda end: end[:2])
        return tensor, trial, law

    def nearly_constant(
        self, start: TensorBasisNetwork, constants: Float[Array, "8"]
    ) -> list[TensorBasisNetwork]:
        """Return laws whose coefficients vary as little as the residual allows, the last the best.

        Those before it are held to less variation still.
        """
        everything = np.ones(N_COEFFICIENTS, bool)
        law = _with_tensors(start, everything)
        law = eqx.tree_at(lambda tree: tree.constants, law, constants)
        found = []
        before = np.inf
        for strength in self.recipe.variations:
            prior = least_variation(jnp.asarray(strength))
            law = self.round(law, strength, everything, True, self.recipe.steps, prior=prior)
            misfit = self.misfit(law)
            if misfit < before:  # the same law twice is no second opinion
                found.append(law)
            if self.settled(law) and misfit > _STILL_GAINS * before:
                break
            before = misfit
        return found

    def along(
        self, start: TensorBasisNetwork, groups: Sequence[Sequence[int]]
    ) -> tuple[TensorBasisNetwork, TensorBasisNetwork]:
        """Return a law that takes tensors group by group, without a race, as far as that pays."""
        chosen = np.zeros(N_COEFFICIENTS, bool)
        law, misfit = start, np.inf
        penalised = law
        for group in groups:
            tensors = chosen.copy()
            tensors[list(group)] = True
            trial = self.round(_with_tensors(law, tensors), 0.0, tensors, False, _START_STEPS)
            trial = self.round(trial, PRIOR_SHARE, tensors, True, self.recipe.steps)
            polished, reached = trial, self.misfit(trial)
            if not self.settled(trial):
                polished = self.polish(trial, reached, tensors)
            if self.misfit(polished) < misfit:
                chosen, law, penalised, misfit = tensors, polished, trial, self.misfit(polished)
                self.taken = [int(t) for t in np.flatnonzero(chosen)]
            if misfit < self.recipe.resolved or self.settled(law):
                break
        return penalised, law


_CLEARINGS = 3
_START_STEPS = 6
_FAR = 0.1  # relative misfit of constants that no data have as noise
_THINS = np.array([0.0, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0])  # a Giesekus fluid's
_LEFT_OUT = (
    "functions on single tensors were not tried, to save time (recipe 'thorough' tries them)"
)
_POLISHED = 2
_CLOSE = 1.5  # what lies further behind the best of a race is not polished
_STILL_GAINS = 0.95  # white or not, a residual that still falls so much holds more than noise
_MOST_POLISHES = 3

PRIOR_SHARE = 1e-6
"""Strength of the prior while functions are learned. It only settles what the data leave open."""


def _with_tensors(law: TensorBasisNetwork, tensors: np.ndarray) -> TensorBasisNetwork:
    """Return the law in which the coefficients of these tensors may vary."""
    mask = jnp.asarray(tensors, dtype=law.network_mask.dtype)
    return eqx.tree_at(lambda tree: tree.network_mask, law, mask)


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
    start = initial_law(key, recipe.width, linear_relaxation, jnp.ones(N_COEFFICIENTS), base_law)
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
        penalised_functions, functions = session.functions(start)
        found = [_finish(session, functions, penalised_functions, True, what)]
        left_out = ""
    if not found or found[0].misfit > recipe.resolved:
        narrow = max(recipe.width // 2, 4)
        start = initial_law(key, narrow, linear_relaxation, scale, base_law)
        path = session.nearly_constant(start, law.constants)
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
    """Return modes times runs times steps of time: what an integration of a problem costs."""
    return float(problem.modulus.size * problem.grids.times.size)


def train_constants(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    linear_relaxation: bool,
    recipe: DefaultRecipe,
    base_law: AbstractConstitutiveLaw | None = None,
) -> Trained:
    """Return the law of few constants that explains some runs: the recipe's first stage alone."""
    session = _Session(problem, recipe, None)
    start = initial_law(key, recipe.width, linear_relaxation, jnp.ones(N_COEFFICIENTS), base_law)
    penalised, law = session.constants(start)
    return _finish(session, law, penalised, False, "constant coefficients")


def train_along(
    problem: TrainingProblem,
    key: PRNGKeyArray,
    found: TensorBasisNetwork,
    groups: Sequence[Sequence[int]],
    recipe: DefaultRecipe,
    progress: Progress | None = None,
) -> Trained:
    """Return a law whose tensors are given, from initial weights of its own.

    Parameters
    ----------
    problem
        The training data.
    key
        For the initial weights.
    found
        A trained law: its invariant scale, base and known relaxation are taken over.
    groups
        Tensors, taken group by group while the law has not settled.
    recipe, progress
        As in `train_default`.
    """
    session = _Session(problem, recipe, progress)
    assert found.invariant_scale is not None  # a law with varying coefficients has one
    start = initial_law(
        key, recipe.width, found.linear_relaxation, found.invariant_scale, found.base
    )
    penalised, law = session.along(start, groups)
    return _finish(session, law, penalised, True, "coefficients that vary with the invariants")


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
        tuple(session.taken) if varies else (),
        tuple(session.passed_over),
    )
