"""Factors on the records of runs, one of each loading: what they leave of residuals.

Of a loading with the residual e = p − y of a prediction p, in units of the noise, and a factor
1 + f with f ~ N(0, s²), the records are normal about p with the covariance I + s² p pᵀ. So f need
not be fitted beside the constants: with the part of e along p made smaller,

    e' = e − (1 − 1/√(1 + s² p·p)) (p·e / p·p) p,

the squares of e' add up to the least of |(1 + f) p − y|² + f²/s² over f   [Seber & Wild 1989,
Nonlinear Regression, ch. 5, for such a prior; Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413,
for what is linear in some parameters], and derivatives of e' are those of the others with f free.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.dataset.loading import Loading
from discover.statistics.residual import FEWEST_FAST, fast_part

_LEAST = 1e-3
"""Relative noise below which none is taken to be: a law is not told to more digits."""

_MOST = 1.0 / 3.0
"""Of the deviation of loadings, up to which their noise is told from the records: what changes from
sample to sample of few samples may be the flow, and a noise that is told too small leaves factors
freer, and intervals wider."""


@dataclass(frozen=True)
class Loadings:
    """Which rows of a batch share a loading, and how much their factors may differ.

    Attributes
    ----------
    names, rows
        Of each loading, and the rows of its records.
    deviation
        Standard deviation of the factors.
    noise
        Standard deviation of the weighted residuals of each row that is noise.
    """

    names: tuple[str, ...]
    rows: tuple[tuple[int, ...], ...]
    deviation: float
    noise: tuple[float, ...]

    def whitened(
        self,
        residual: Float[np.ndarray, "trials rows n"],
        predicted: Float[np.ndarray, "trials rows n"],
        rows: Sequence[int],
    ) -> Float[np.ndarray, "trials rows n"]:
        """Return weighted residuals with factors of their own, which the prior holds back.

        Parameters
        ----------
        residual, predicted
            Predictions minus records, and predictions, both weighted.
        rows
            Rows of the batch that they are; those of one loading are all there, or none.
        """
        out = np.array(residual)
        at = {row: i for i, row in enumerate(rows)}
        for row in self.rows:
            own = [at[one] for one in row if one in at]
            if not own:
                continue
            along, size = self._along(residual[:, own], predicted[:, own], row)
            with np.errstate(all="ignore"):  # a trial that ran away
                share = share_of_factor(along, size, self.deviation**2)
                out[:, own] = residual[:, own] - share[:, None, None] * predicted[:, own]
        return out

    def factors(
        self,
        residual: Float[np.ndarray, "trials rows n"],
        predicted: Float[np.ndarray, "trials rows n"],
    ) -> tuple[Float[np.ndarray, "trials loadings"], Float[np.ndarray, "trials loadings"]]:
        """Return the factors less one that fit best without the prior, and their precisions.

        The precision is one over the variance by noise. Parameters as in `whitened`, of all rows.
        """
        found = [self._along(residual[:, [*r]], predicted[:, [*r]], r) for r in self.rows]
        along, size = (np.stack(column, axis=1) for column in zip(*found, strict=True))
        return -along / np.where(size > 0.0, size, 1.0), size

    def _along(self, residual, predicted, rows: Sequence[int]):
        noise = np.array([self.noise[row] for row in rows])[:, None]
        with np.errstate(all="ignore"):
            along = np.sum(residual * predicted / noise**2, axis=(1, 2))
            size = np.sum((predicted / noise) ** 2, axis=(1, 2))
        return along, size


def share_of_factor(along, size, signal):
    """Return (1 − 1/√(1 + s² p·p)) p·e / p·p, by how many p the likely factor lessens e.

    Parameters
    ----------
    along, size, signal
        p·e, p·p and s², arrays of NumPy or JAX.
    """
    return (1.0 - (1.0 + signal * size) ** -0.5) * along / (size + (size == 0.0))


def loadings(runs: Sequence[Run]) -> Loadings | None:
    """Return the loadings of runs; None where they are none of their own.

    What else was recorded of a run, and both moduli of a sweep, share its loading.
    """
    told = [run.loading for run in runs]
    deviations = {one.deviation for one in told if one is not None}
    if not deviations:
        return None
    rows: dict[str, list[int]] = {}
    for i, run in enumerate(runs):
        if run.loading is not None:
            rows.setdefault(run.source, []).append(i)
    (deviation,) = deviations
    return Loadings(
        tuple(rows), tuple(map(tuple, rows.values())), deviation, tuple(map(_noise_of, runs))
    )


def _noise_of(run: Run) -> float:
    """Return the standard deviation of a run's weighted residuals that is noise."""
    if run.loading is None:
        return 1.0
    return relative_noise(run, run.loading) * run.weight / float(np.sqrt(len(run)))


def relative_noise(run: Run, loading: Loading) -> float:
    """Return the noise of a run that is a loading of its own, relative to its size."""
    noise = loading.noise
    if noise is None:
        most = _MOST * loading.deviation
        fast = fast_part(run.recorded / run.sizes(run.recorded))
        noise = float(np.clip(fast, _LEAST, most)) if len(run) >= FEWEST_FAST else most
    return max(noise, _LEAST)
