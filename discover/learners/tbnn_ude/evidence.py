"""Laplace evidence of laws that fit noisy data alike, which penalises those that follow the noise.

With weights w of a standard normal prior and Jacobian J of the residuals over the noise,

    −2 ln E = χ² + |w|² + ln det(1 + JᵀJ),

up to a common constant [MacKay 1992, Neural Computation 4, 448].
"""

from collections.abc import Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Key

from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.tbnn_ude import variational
from discover.learners.tbnn_ude.least_squares import cloud_of, law_misfit, relative_misses
from discover.learners.tbnn_ude.problem import Records, TrainingProblem
from discover.learners.tbnn_ude.session import constant_scale
from discover.programs import compiled
from discover.statistics import independent_samples


def negative_log_evidence(
    laws: Sequence[TensorBasisNetwork], problem: TrainingProblem
) -> Float[np.ndarray, " laws"]:
    """Return −2 ln E of every law; the least is the likeliest.

    Infinite for a law that diverges in the training flows, or in them at twice the rate, if another
    does not. The noise is what the best law leaves; correlated samples count as fewer.
    """
    along = [variational.trajectories(law, problem) for law in laws]
    misses = [np.asarray(relative_misses(one, problem)) for one in along]
    squares = np.array([np.sum(one**2) for one in misses])
    squares = np.where(np.isfinite(squares), squares, np.inf)
    best = int(np.argmin(squares))
    if not 0.0 < squares[best] < np.inf:
        return np.where(squares == squares[best], 0.0, np.inf)
    precision = _independent(misses[best], problem.records.seen) / squares[best]
    twice = at_twice_the_rate(problem)
    enduring = np.isfinite(squares) & [stable_at_double_rate(law, twice) for law in laws]
    found = np.full(len(laws), np.inf)
    usable = enduring if np.any(enduring) else np.isfinite(squares)
    for i in np.flatnonzero(usable).tolist():
        cost = _told(laws[i], along[i], problem, precision)
        found[i] = precision * squares[i] + cost
    return found


@compiled
def at_twice_the_rate(problem: TrainingProblem) -> TrainingProblem:
    """Return the problem with its flows at twice the rate."""
    twice = problem.flows.faster(jnp.full(len(problem.flows), 2.0))
    return eqx.tree_at(lambda tree: tree.flows, problem, twice)


def stable_at_double_rate(law: TensorBasisNetwork, problem: TrainingProblem) -> bool:
    """Return whether a law's stress stays finite in the flows of a problem."""
    return bool(np.all(np.isfinite(np.asarray(variational.trajectories(law, problem).states))))


def posterior_draws(
    law: TensorBasisNetwork, problem: TrainingProblem, keys: Key[Array, " draws"], fits: float
) -> list[TensorBasisNetwork]:
    """Return laws around a trained one that fit the data about as well.

    Drawn from Laplace's Gaussian, and halved until the relative misfit is at most `fits` times that
    of the law. `keys`: one for each draw.
    """
    along = variational.trajectories(law, problem)
    misses = np.asarray(relative_misses(along, problem))
    least = float(np.sqrt(np.sum(misses**2)))
    precision = _independent(misses, problem.records.seen) / max(least**2, 1e-300)
    rebuild, acts, columns = _sensitivities(law, along, problem)
    values, vectors = np.linalg.eigh(columns.T @ columns)
    spread = vectors / np.sqrt(1.0 + precision * np.clip(values, 0.0, None))
    start = np.asarray(rebuild.start)
    found = []
    for key in keys:
        step = np.zeros_like(start)
        step[acts] = spread @ np.asarray(jax.random.normal(key, (spread.shape[1],)))
        for _ in range(_HALVINGS):
            drawn = variational.rebuilt(rebuild, jnp.asarray(start + step))
            left = np.asarray(law_misfit(drawn, problem))
            if np.max(np.abs(left)) < np.inf and np.linalg.norm(left) <= fits * least:
                found.append(drawn)
                break
            step *= 0.5
    return found


_HALVINGS = 8


def _told(
    law: TensorBasisNetwork, along: variational.Along, problem: TrainingProblem, precision: float
) -> float:
    """Return |w|² + ln det(1 + JᵀJ), over the weights that act."""
    rebuild, acts, columns = _sensitivities(law, along, problem)
    values = precision * np.linalg.eigvalsh(columns.T @ columns)
    weights = np.asarray(rebuild.start)[acts]
    return float(weights @ weights + np.sum(np.log1p(np.clip(values, 0.0, None))))


_linearised = compiled(Records.linearised)


def _sensitivities(
    law: TensorBasisNetwork, along: variational.Along, problem: TrainingProblem
) -> tuple[variational.Rebuild, Bool[np.ndarray, " p"], Float[np.ndarray, "rows q"]]:
    """Return the weights of a law, which of them act, and their derivatives of the residuals."""
    cloud = cloud_of(along, problem)
    moving = (np.asarray(law.network_mask) > 0) | (np.asarray(law.constants) != 0.0)
    varies = bool(np.any(np.asarray(law.network_mask) > 0))
    rebuild = variational.Rebuild.of(law, moving, constant_scale(cloud), varies)
    _, jacobian = variational.side_by_side(rebuild.start, rebuild, problem)
    acts = np.asarray(rebuild.moves)
    _, columns = _linearised(problem.records, along.recorded, jacobian)
    return rebuild, acts, np.asarray(columns)[..., acts].reshape(-1, int(np.sum(acts)))


def _independent(misses: Float[np.ndarray, "runs n"], seen: Bool[np.ndarray, "runs n"]) -> float:
    """Return the effective number of independent samples of the residuals."""
    return sum(independent_samples(row[own]) for row, own in zip(misses, seen, strict=True))
