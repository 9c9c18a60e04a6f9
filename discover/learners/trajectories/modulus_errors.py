"""What errors of moduli and solvent, as a sweep leaves them, do to a law's predictions and fit.

With moduli G + R u, u of unit variance, data of the law differ from its prediction by Z u, and
parameters fitted with u = 0 are off by (SᵀS)⁻¹SᵀZ u: one more correlated error of the data.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.learners.trajectories.problem import TrajectoryProblem
from discover.learners.trajectories.sensitivities import predict_many

_SHIFT = 0.1
"""Standard deviations of the differences; what a rate controls is linear in the moduli."""


@dataclass(frozen=True)
class ModulusErrors:
    """Errors of moduli, and those of fitted parameters that go with them.

    Attributes
    ----------
    root
        R with moduli G + R u, u of unit variance, shape (k, k), in Pa; with a solvent its row is
        the last.
    response
        B with parameters θ − B u, shape (p, k).
    """

    root: Float[np.ndarray, "c c"]
    response: Float[np.ndarray, "p c"]

    def draw(
        self,
        offset: Float[np.ndarray, "draws p"],
        covariance: Float[np.ndarray, "p p"],
        rng: np.random.Generator,
    ) -> Float[np.ndarray, "draws c"]:
        """Return changes of the moduli in Pa, and of the solvent, that go with drawn parameters.

        Parameters
        ----------
        offset
            Drawn parameters less the fitted ones.
        covariance
            Of the parameters, these errors included.
        rng
            Of what the parameters leave open of the moduli.
        """
        scale = np.sqrt(np.clip(np.diag(covariance), np.finfo(float).tiny, None))
        inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True)
        slope = -(inverse @ (self.response / scale[:, None])) / scale[:, None]
        left = np.eye(self.root.shape[1]) + self.response.T @ slope
        sizes, axes = np.linalg.eigh(0.5 * (left + left.T))
        open_ = rng.normal(size=(len(offset), len(sizes))) * np.sqrt(np.clip(sizes, 0.0, None))
        return (offset @ slope + open_ @ axes.T) @ self.root.T


def amounts_of(problem: TrajectoryProblem) -> Float[np.ndarray, " c"]:
    """Return the moduli in Pa, and the solvent viscosity behind them where a sweep told both."""
    amounts = np.append(np.asarray(problem.modulus), float(problem.solvent_viscosity))
    return amounts[: len(problem.modulus_error)]


def modulus_columns(
    problem: TrajectoryProblem,
    support: Sequence[int],
    slots: int,
    coefficients: Float[np.ndarray, " q"],
    inner: Float[np.ndarray, " m"],
) -> Float[np.ndarray, "rows c"]:
    """Return Z, the change of a law's weighted predictions with each direction of modulus errors.

    Parameters
    ----------
    problem
        Data and known physics.
    support
        Positions of the law's terms in the library.
    slots
        Number of places of the compiled program, at least that of the terms.
    coefficients, inner
        Of the terms, and of the whole library's closed forms.
    """
    root = np.asarray(problem.modulus_error)
    if not np.any(root):
        return np.zeros((problem.records.weight.size, len(root)))
    active, filled = np.zeros(slots, dtype=int), np.zeros(slots)
    active[: len(support)], filled[: len(support)] = support, coefficients
    moduli = amounts_of(problem) + _SHIFT * np.concatenate([root.T, -root.T])
    laws = len(moduli)
    predicted = predict_many(
        problem,
        jnp.asarray(active),
        jnp.asarray(np.tile(filled, (laws, 1))),
        jnp.asarray(np.tile(inner, (laws, 1))),
        jnp.asarray(moduli),
    )
    up, down = np.split(np.asarray(predicted), 2)
    return np.nan_to_num((up - down).T / (2.0 * _SHIFT))
