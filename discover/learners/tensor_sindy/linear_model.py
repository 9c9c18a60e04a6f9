"""The linear sparse problem at one trial law, and scores of supports in it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from discover.learners.tensor_sindy.refit import Fit
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import linearise

_RIDGE = 1e-9
_RUNAWAY = 1e60
EXHAUSTIVE_LIMIT = 50_000
"""Supports of one size that are all scored; beyond it only moves from known supports are."""


@dataclass(frozen=True)
class LinearModel:
    """y − σ(c₀) + S c₀ ≈ S c: what the data say of the coefficients near a trial law.

    Attributes
    ----------
    design
        Weighted sensitivities of every term, compressed to as many rows as unknowns by a QR
        decomposition: every least-squares problem over them is unchanged.
    target
        Weighted left-hand side, compressed alike.
    norms
        Of the columns of `design`.
    """

    design: Float[np.ndarray, "rows n"]
    target: Float[np.ndarray, " rows"]
    norms: Float[np.ndarray, " n"]

    @classmethod
    def at(
        cls,
        problem: TrajectoryProblem,
        fit: Fit,
        keep: Bool[np.ndarray, "runs samples"] | None = None,
    ) -> "LinearModel":
        """Return the model at a fitted law, over the samples to keep.

        Inner parameters that are active are free too: their columns are projected out.
        """
        n = len(problem.library)
        c = fit.dense(n)
        residual, columns = linearise(problem, jnp.asarray(c), jnp.asarray(fit.inner))
        residual, columns = np.array(residual), np.array(columns)
        with np.errstate(invalid="ignore"):
            # a law that runs away may end finite and yet too large to be squared
            within = np.all(np.abs(columns) < _RUNAWAY, axis=1) & (np.abs(residual) < _RUNAWAY)
        lost = ~within  # so is what is not a number
        if keep is not None:
            lost |= ~np.repeat(keep.reshape(-1), problem.records.recorded.shape[2])
        residual[lost], columns[lost] = 0.0, 0.0
        design, inner = columns[:, :n], columns[:, n:]
        target = design @ c - residual
        inner = inner[:, np.linalg.norm(inner, axis=0) > 0]
        if inner.shape[1]:
            basis = np.linalg.qr(inner)[0]
            target = target - basis @ (basis.T @ target)
            design = design - basis @ (basis.T @ design)
        stacked = np.column_stack([design, target])
        rows = stacked[np.any(stacked != 0.0, axis=1)]
        triangular = np.asarray(np.linalg.qr(rows, mode="r"))
        return cls(triangular[:, :-1], triangular[:, -1], np.linalg.norm(design, axis=0))

    @cached_property
    def _normal_equations(self):
        normalised = self.design / np.where(self.norms > 0, self.norms, 1.0)
        return normalised.T @ normalised, normalised.T @ self.target

    def scores(self, supports: Sequence[tuple[int, ...]]) -> Float[np.ndarray, " supports"]:
        """Return the linear misfit of supports of one size: the smaller the more promising."""
        gram, right = self._normal_equations
        total = float(self.target @ self.target)
        index = np.array(supports, dtype=int)
        if index.size == 0:
            return np.full(len(supports), np.sqrt(total))
        blocks = gram[index[:, :, None], index[:, None, :]] + _RIDGE * np.eye(index.shape[1])
        rights = right[index]
        solved = np.linalg.solve(blocks, rights[..., None])[..., 0]
        return np.sqrt(np.maximum(total - np.sum(rights * solved, axis=1), 0.0))


def additions(support: tuple[int, ...], n: int) -> list[tuple[int, ...]]:
    """Return the supports with one term more."""
    return [tuple(sorted((*support, j))) for j in range(n) if j not in support]


def removals(support: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return the supports with one term less."""
    return [tuple(i for i in support if i != j) for j in support]


def swaps(support: tuple[int, ...], n: int) -> list[tuple[int, ...]]:
    """Return the supports with one term replaced by another."""
    return [bigger for smaller in removals(support) for bigger in additions(smaller, n)]


def all_of_size(size: int, n: int) -> list[tuple[int, ...]]:
    """Return every support of a size, or none where they are too many to score."""
    count = 1
    for i in range(size):
        count = count * (n - i) // (i + 1)
    return list(combinations(range(n), size)) if count <= EXHAUSTIVE_LIMIT else []


def distinct(supports: Iterable[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Return supports without repetition, in order."""
    return list(dict.fromkeys(supports))
