"""What to measure next: the experiment expected to tell the remaining laws apart.

If law i is true, an experiment with noise of standard deviation s is expected to speak against law
j with a log-likelihood ratio of

    E_ij = ½ dᵀ (s² I + A_i A_iᵀ + A_j A_jᵀ)⁻¹ d,    d = y_i − y_j,

where A Aᵀ is the covariance of a law's prediction that comes from its parameters: a difference
that a readjustment within their present intervals would remove is no evidence   [design for the
discrimination of models: Box & Hill 1967, Technometrics 9, 57].
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.identify.design.experiments import OBSERVED, Experiment
from discover.identify.side_by_side.many_laws import Contender, fluid_of, predict_laws, sigma_points
from discover.laws.multimode import Fluid
from discover.statistics.projection import squared_distance

DECISIVE = 5.0
"""Natural logarithm of the odds (150 to 1) from which an experiment counts as deciding."""

OVERWHELMING = 50.0
"""More evidence than this makes no experiment better than another."""

MOST_EVIDENCE = 1e6

_HIDDEN = 1e-3
"""Of the noise: a deviation of the prediction that changes no evidence by more than its square."""

_EFFORT = ("sigma12", "strain", "N1", "tensile_stress", "N2")
"""What is measured, the easiest first: N2 needs special plates, extension another instrument."""

_FEWEST = 5
"""Samples of an experiment that every law must reach."""

# an error of 1e-5 is nothing beside the noise that a measurement is given here
_LIMITS = {"strain_step": 0.2, "phase_step": 0.3}


@dataclass(frozen=True)
class Proposal:
    """One experiment with one set of measured quantities, and what it would decide.

    Attributes
    ----------
    observed
        What has to be measured: ``sigma12``, in creep the ``strain``, in extension the
        ``tensile_stress``; in shear with ``N1``, with ``N2``.
    evidence
        Expected log-likelihood ratio of the chosen law over each rival, by the rival's name.
    weakest
        The smallest over all pairs of laws.
    curves
        Prediction of every law, shape (laws, n, 3), the chosen one's first.
    """

    experiment: Experiment
    observed: tuple[str, ...]
    evidence: dict[str, float]
    weakest: float
    curves: Float[np.ndarray, "laws n 3"]

    @property
    def falling(self) -> tuple[str, ...]:
        """Rivals against which it is expected to decide."""
        return tuple(name for name, value in self.evidence.items() if value >= DECISIVE)

    def line(self) -> dict[str, Any]:
        """Return the proposal as one line of a table: expected logarithms of odds by rival."""
        what = " and ".join(self.observed)
        return {"measure": what, "in": self.experiment.title, **self.evidence}

    def to_json(self) -> dict[str, Any]:
        """Return the proposal without its curves."""
        return {
            "experiment": self.experiment.title,
            "observed": list(self.observed),
            "expected_evidence": dict(self.evidence),
            "weakest_pair": self.weakest,
            "separates": list(self.falling),
        }


def propose_experiments(
    chosen: Contender,
    rivals: Sequence[Contender],
    declared: Fluid,
    experiments: Sequence[Experiment],
    noise: float,
    observed: Sequence[str] = OBSERVED,
    n_draws: int = 32,
    seed: int = 0,
) -> list[Proposal]:
    """Return what to measure, best first.

    The easiest kind of measurement comes first among those that decide against equally many
    rivals; then the evidence against the hardest pair counts, until it is overwhelming; then the
    order in which the experiments are given, the gentlest first.

    Parameters
    ----------
    chosen, rivals
        The laws that the data leave, with the covariance of their parameters.
    declared
        The known part that they share.
    experiments
        What could be run.
    noise
        Standard deviation relative to the root-mean-square of each measured quantity; for N2, of
        N1, which the same force sensor has to bear.
    observed
        What could be measured, of `OBSERVED`.
    n_draws
        Of each law's parameters, where its covariance does not serve.
    """
    laws = [chosen, *rivals]
    rng = np.random.default_rng(seed)
    groups = [sigma_points(law, n_draws, rng) for law in laws]
    flat = [law for group in groups for law in group]
    starts = np.cumsum([0, *(len(group) for group in groups)])
    fluids, proposals = fluid_of(flat, declared), []
    for experiment, predicted in _predicted(fluids, experiments):
        runs = [predicted[a:b] for a, b in itertools.pairwise(starts)]
        if not experiment.in_transient_shear:
            runs, experiment = _followed_by_all(runs, experiment)
        if not len(experiment.times) or not np.all(np.isfinite(runs[0][0])):
            continue  # not an experiment that the chosen law survives
        recorded = experiment.protocol.quantity
        for kinds in _measurements(observed) if experiment.in_shear else [(0,)]:
            evidence = _evidence(runs, kinds, noise)
            proposals.append(
                Proposal(
                    experiment,
                    tuple(OBSERVED[k] if k else recorded for k in kinds),
                    {law.name: float(evidence[0, j]) for j, law in enumerate(laws) if j > 0},
                    float(np.min(evidence[np.triu_indices(len(laws), 1)], initial=MOST_EVIDENCE)),
                    np.stack([run[0] for run in runs]),
                )
            )
    return sorted(proposals, key=rank)


def _predicted(
    fluids: Fluid, experiments: Sequence[Experiment]
) -> Iterator[tuple[Experiment, Float[np.ndarray, "laws n 3"]]]:
    """Yield each experiment with what laws predict in it.

    Shear by itself: beside extension all components of a stress are followed together, and a law
    may run away in one that shear leaves alone.
    """
    for in_shear in (True, False):
        some = [one for one in experiments if one.in_shear is in_shear]
        if some:
            protocols, times = [e.protocol for e in some], [e.times for e in some]
            found = predict_laws(fluids, protocols, times, **_LIMITS)
            for place, one in enumerate(some):
                yield one, found[:, place, : len(one.times)]


def _followed_by_all(
    runs: Sequence[Float[np.ndarray, "_ n 3"]], experiment: Experiment
) -> tuple[list[Float[np.ndarray, "_ kept 3"]], Experiment]:
    """Return an experiment as far as every law can be followed.

    A law without a steady state, or one that has run away in extension, is no curve to measure.
    """
    finite = np.all([np.all(np.isfinite(run[0]), axis=1) for run in runs], axis=0)
    kept = int(np.argmin(np.append(finite, False)))
    if kept < _FEWEST:
        kept = 0
    shorter = replace(experiment, times=experiment.times[:kept])
    return [run[:, :kept] for run in runs], shorter


def rank(proposal: Proposal) -> tuple[float, ...]:
    """Return by what proposals are sorted, the best first; see `propose_experiments`."""
    enough = min(proposal.weakest, OVERWHELMING)
    total = sum(min(value, OVERWHELMING) for value in proposal.evidence.values())
    hardest = max(map(_EFFORT.index, proposal.observed))
    return (-float(len(proposal.falling)), float(hardest), -float(enough), -float(total))


def _measurements(observed: Sequence[str]) -> list[tuple[int, ...]]:
    """Return σ12 alone, then with each quantity that the user can measure besides."""
    extra = [OBSERVED.index(name) for name in observed if name != "sigma12"]
    return [(0,), *((0, k) for k in extra)]


def _evidence(runs, kinds, noise: float) -> Float[np.ndarray, "laws laws"]:
    """Return E_ij for all pairs; a law that runs away is refuted by any record."""
    centre = runs[0][0]
    scale = np.sqrt(np.mean(centre**2, axis=0))
    scale[2] = scale[1]
    size = noise * np.maximum(scale, 1e-300)
    measured = [(run[..., list(kinds)] / size[list(kinds)]).reshape(len(run), -1) for run in runs]
    factors = [_seen(spread_of(of_law)) for of_law in measured]
    evidence = np.zeros((len(runs), len(runs)))
    for i in range(len(runs)):
        for j in range(i):
            apart = measured[i][0] - measured[j][0]
            both = np.concatenate([factors[i], factors[j]], axis=0)
            evidence[i, j] = evidence[j, i] = _of_pair(apart, both)
    return evidence


def _of_pair(difference: np.ndarray, factor: np.ndarray) -> float:
    if not np.all(np.isfinite(difference)):
        return MOST_EVIDENCE
    return float(min(0.5 * squared_distance(difference, factor), MOST_EVIDENCE))


def _seen(factor: Float[np.ndarray, "k n"]) -> Float[np.ndarray, "r n"]:
    """Return a factor of the same covariance without what noise hides, for all pairs at once."""
    _, sizes, rows = np.linalg.svd(factor, full_matrices=False)
    kept = sizes > _HIDDEN
    return sizes[kept, None] * rows[kept]


def spread_of(group: Float[np.ndarray, "draws n"]) -> Float[np.ndarray, "k n"]:
    """Return F with FᵀF the covariance of a law's prediction; the law itself comes first.

    Of a law that runs away, whatever its draws do, and of fewer than two draws that do not, none.
    """
    drawn = group[1:]
    drawn = drawn[np.all(np.isfinite(drawn), axis=1)]
    if len(drawn) < 2 or not np.all(np.isfinite(group[0])):
        return np.zeros((0, group.shape[1]))
    return (drawn - group[0]) / np.sqrt(len(drawn))
