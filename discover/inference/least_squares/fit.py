"""A fitted vector of parameters, and what other data say of some of them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Prior:
    """What other data say of some parameters, as rows of the least-squares problem.

    Attributes
    ----------
    positions
        Of the parameters.
    mean
        Their values.
    weight
        Residual per unit of deviation, in the units of the weighted residuals.
    """

    positions: tuple[int, ...] = ()
    mean: tuple[float, ...] = ()
    weight: tuple[float, ...] = ()

    def rows(
        self, theta: np.ndarray, free: Sequence[int]
    ) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows free"]]:
        """Return residuals and their derivatives in the free parameters."""
        known = [i for i, position in enumerate(self.positions) if position in free]
        residual = np.array(
            [self.weight[i] * (theta[self.positions[i]] - self.mean[i]) for i in known]
        )
        design = np.zeros((len(known), len(free)))
        for row, i in enumerate(known):
            design[row, list(free).index(self.positions[i])] = self.weight[i]
        return residual, design


NO_PRIOR = Prior()


@dataclass
class Fit:
    """A fitted parameter vector.

    Attributes
    ----------
    free
        Positions of the fitted ones.
    residual
        Weighted residuals, shape (runs, n).
    derivatives
        Those of the residuals, as `jacobian` returns them, or what computes them.
    """

    theta: Float[np.ndarray, " p"]
    free: tuple[int, ...]
    residual: Float[np.ndarray, "runs n"]
    derivatives: Float[np.ndarray, "free runs n"] | Callable[[], Float[np.ndarray, "free runs n"]]

    @cached_property
    def jacobian(self) -> Float[np.ndarray, "free runs n"]:
        """Derivatives of the residuals in the fitted parameters, computed when first asked for.

        Of rival fits most are never asked.
        """
        return self.derivatives() if callable(self.derivatives) else self.derivatives

    @property
    def cost(self) -> float:
        """Sum over runs of the squared relative errors."""
        with np.errstate(over="ignore", invalid="ignore"):  # of what ran away
            return float(np.sum(self.residual**2))

    @property
    def run_errors(self) -> Float[np.ndarray, " runs"]:
        """Root-mean-square error over root-mean-square stress of each run."""
        return np.sqrt(np.sum(self.residual**2, axis=1))

    @property
    def usable(self) -> bool:
        """Whether residuals and derivatives are all finite."""
        return bool(np.all(np.isfinite(self.residual)) and np.all(np.isfinite(self.jacobian)))


def best_of(fits: Iterable[Fit]) -> Fit | None:
    """Return the usable fit of the least cost; None where none is usable."""
    by_cost = sorted(fits, key=lambda fit: fit.cost if np.isfinite(fit.cost) else np.inf)
    return next((fit for fit in by_cost if fit.usable), None)
