"""A hypothesis at its likeliest constants, as a fit of it ends."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from discover.inference.noise import Noise
from discover.inference.priors import Priors
from discover.statistics import HALF_BAND


@dataclass(eq=False)
class Fit:
    """A hypothesis at its likeliest constants.

    `names`: effects that are there, in alphabetical order. `theta`: constants of the model, shape
    (p,). `linear`: what is linear in the records: gain, zeros, drifts, loadings, moduli, shape
    (q,). `priors`: of the constants that are free, by position. `predicted`: records as predicted,
    in Pa, shape (rows,). `log_likelihood`, `log_posterior`: at these constants, over all noises.
    `noise`: the likeliest noise. `slopes`: derivatives of `predicted` with respect to the
    coordinates, shape (rows, free). None where a step has made them old. `jacobian`: derivatives of
    the records with respect to the coordinates, then of what is linear, shape (rows, free + q).
    `covariance`, `root`: of these, and a factor of it: root rootᵀ, both of shape (free + q, free +
    q). `log_evidence`: of the records given the hypothesis, by Laplace's method; minus infinity
    where an effect ends at zero or the law runs away. `vanished`: effects whose amplitude ended at
    zero. `without`: a run whose rows the fit does not see; None for none. `shifts`: what errors of
    the moduli do to predictions, in Pa, shape (rows, k). `shifted`: the predictions that these are
    of, shape (rows,); None before they are taken, as if moduli had no errors.
    """

    names: tuple[str, ...]
    theta: Float[np.ndarray, " p"]
    linear: Float[np.ndarray, " q"]
    priors: Priors
    predicted: Float[np.ndarray, " rows"]
    log_likelihood: float
    log_posterior: float
    noise: Noise
    shifts: Float[np.ndarray, "rows k"]
    slopes: Float[np.ndarray, "rows free"] | None = None
    jacobian: Float[np.ndarray, "rows n"] | None = None
    covariance: Float[np.ndarray, "n n"] | None = None
    root: Float[np.ndarray, "n n"] | None = None
    log_evidence: float = -np.inf
    vanished: tuple[str, ...] = ()
    without: int | None = None
    shifted: Float[np.ndarray, " rows"] | None = None
    damping: float = 1e-2
    memory: dict = field(default_factory=dict)

    @property
    def free(self) -> list[int]:
        """Positions of the free constants."""
        return list(self.priors)

    @property
    def coordinates(self) -> Float[np.ndarray, " free"]:
        """Coordinates of the free constants."""
        return self.priors.coordinates(self.theta)

    def at(self, coordinates: Float[np.ndarray, "*trials free"]) -> Float[np.ndarray, "*trials p"]:
        """Return the constants at other coordinates of what is free, inside their ranges."""
        ends = self.priors.ends
        return self.priors.placed(self.theta, np.clip(coordinates, ends[:, 0], ends[:, 1]))

    def drawn(
        self, normal: Float[np.ndarray, "draws n"]
    ) -> tuple[Float[np.ndarray, "draws p"], Float[np.ndarray, "draws q"]]:
        """Return draws of the constants, and of what is linear, of independent normal numbers."""
        assert self.covariance is not None
        off, free = normal @ np.linalg.cholesky(self.covariance).T, len(self.priors)
        return self.at(self.coordinates + off[:, :free]), self.linear + off[:, free:]

    def interval(self, position: int) -> tuple[float, float]:
        """Return the 95 % interval of a free constant by this fit alone, inside its range."""
        assert self.covariance is not None
        at, prior = self.free.index(position), self.priors[position]
        half = HALF_BAND * float(np.sqrt(self.covariance[at, at]))
        low, high = np.clip(self.coordinates[at] + half * np.array([-1.0, 1.0]), *prior.ends)
        return prior.to_value(low), prior.to_value(high)
