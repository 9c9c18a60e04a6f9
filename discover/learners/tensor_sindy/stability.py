"""How often each term is chosen when half of the data are looked at.

Halves come in complementary pairs, made of blocks of consecutive samples so that neighbours in
time stay together   [Meinshausen & Bühlmann 2010, J. R. Stat. Soc. B 72, 417; Shah & Samworth 2013,
J. R. Stat. Soc. B 75, 55]. In each half the sparse optimiser runs its whole sweep on the linear
model, and the extended BIC chooses among what it proposes and the supports known beforehand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from discover.learners.tensor_sindy.optimisers import solve_sparse
from discover.learners.tensor_sindy.refit import Fit
from discover.learners.tensor_sindy.selection import extended_bic
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import linearise

_BLOCKS_PER_RUN = 8

STABLE = 0.6
"""Share of the halves from which a term counts as stable."""


@dataclass(frozen=True)
class Stability:
    """What subsampling says of every term.

    Attributes
    ----------
    frequency
        Share of the halves in which each term was chosen, shape (n_terms,).
    interchangeable
        Share of the halves in which the term, or one of identical signature, was chosen: twins
        take each other's place at random.
    """

    frequency: Float[np.ndarray, " n"]
    interchangeable: Float[np.ndarray, " n"]


def selection_stability(
    problem: TrajectoryProblem,
    fit: Fit,
    optimizer,
    max_terms: int,
    floor: float,
    known: Sequence[tuple[int, ...]],
    n_pairs: int,
    seed: int | None,
    worth: float = 1.0,
) -> Stability:
    """Return how often each term is chosen from halves of the data, near a fitted law.

    Parameters
    ----------
    fit
        Law at which the trajectory is linearised.
    optimizer
        As in `solve_sparse`.
    max_terms
        Largest support of interest.
    floor
        Relative misfit below which data count as reproduced.
    known
        Supports that take part in every half, such as a path found on all data.
    n_pairs
        Number of complementary pairs of halves.
    seed
        Of the halves.
    worth
        Independent observations for each one made: less than one in correlated noise.
    """
    n = len(problem.library)
    c = fit.dense(n)
    residual, columns = linearise(problem, jnp.asarray(c), jnp.asarray(fit.inner))
    design = np.asarray(columns)[:, :n]
    target = design @ c - np.asarray(residual)
    usable = np.isfinite(target) & np.all(np.isfinite(design), axis=1)
    usable &= problem.records.seen.reshape(-1)
    rng = np.random.default_rng(seed)
    chosen = np.zeros((2 * n_pairs, n), dtype=bool)
    for pair in range(n_pairs):
        half = _half(problem, rng)
        for side, rows in enumerate((half & usable, ~half & usable)):
            support = _choose(design[rows], target[rows], optimizer, max_terms, floor, known, worth)
            chosen[2 * pair + side, list(support)] = True
    alike = _alike(design[usable])
    together = np.stack([np.any(chosen[:, group], axis=1) for group in alike], axis=1)
    return Stability(chosen.mean(axis=0), together.mean(axis=0))


def _half(problem: TrajectoryProblem, rng: np.random.Generator) -> Bool[np.ndarray, " rows"]:
    runs, samples, kinds = problem.records.recorded.shape
    half = np.zeros((runs, samples, kinds), dtype=bool)
    seen = np.any(problem.records.seen, axis=2)
    for run in range(runs):
        blocks = np.array_split(np.flatnonzero(seen[run]), _BLOCKS_PER_RUN)
        for block in rng.permutation(_BLOCKS_PER_RUN)[: _BLOCKS_PER_RUN // 2]:
            half[run, blocks[block]] = True
    return half.reshape(-1)


def _choose(design, target, optimizer, max_terms, floor, known, worth) -> tuple[int, ...]:
    """Return the support that the extended BIC prefers of those the optimiser proposes."""
    if not len(design):  # the half of a record of very few samples
        return ()
    observations, n = worth * len(design), design.shape[1]
    triangular = np.asarray(np.linalg.qr(np.column_stack([design, target]), mode="r"))
    matrix, right = triangular[:, :-1], triangular[:, -1]
    # the weights make the norm over all rows a relative misfit; a half has its share of that
    scale = np.sqrt(2.0)
    best: tuple[int, ...] = ()
    lowest = _bic(scale * float(np.linalg.norm(right)), observations, 0, n, floor)
    proposals = [s.support for s in solve_sparse(optimizer, matrix, right, max_terms)]
    for support in dict.fromkeys([*known, *proposals]):
        if not 0 < len(support) <= max_terms:
            continue
        left = right - matrix[:, support] @ np.linalg.lstsq(matrix[:, support], right)[0]
        value = _bic(scale * float(np.linalg.norm(left)), observations, len(support), n, floor)
        if value < lowest:
            best, lowest = support, value
    return best


def _bic(misfit: float, observations: float, size: int, n: int, floor: float) -> float:
    return extended_bic(max(misfit, floor), observations, size, 0, n)


def _alike(design: np.ndarray) -> list[np.ndarray]:
    """Return, for each term, the terms whose signature is the same up to a factor."""
    norms = np.linalg.norm(design, axis=0)
    directions = design / np.where(norms > 0, norms, 1.0)
    cosine = np.abs(directions.T @ directions)
    # a cosine of 1 − 1e-10 is an angle of 1e-5: the accuracy of the sensitivities
    return [
        np.flatnonzero((row > 1.0 - 1e-10) | (np.arange(len(row)) == i))
        for i, row in enumerate(cosine)
    ]
