"""Factors on the records of runs, one of each loading: what they leave of residuals.

Of a loading with the residual e = p − y of a prediction p, in units of the noise, and a factor
1 + f with f ~ N(0, s²), the records are normal about p with the covariance I + s² p pᵀ. So f need
not be fitted beside the constants: with the part of e along p made smaller,

    e' = e − (1 − 1/√(1 + s² p·p)) (p·e / p·p) p,

the squares of e' add up to the least of |(1 + f) p − y|² + f²/s² over f   [Seber & Wild 1989,
Nonlinear Regression, ch. 5, for such a prior; Golub & Pereyra 1973, SIAM J. Numer. Anal. 10, 413,
for what is linear in some parameters], and derivatives of e' are those of the others with f free.
Along the record in place of the prediction this would be linear in p, but then a law that predicts
less would leave less of the noise.
"""

from collections.abc import Sequence
from typing import TypeVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.dataset import Run
from discover.dataset.run import Loading
from discover.statistics.noise.whiteness import FEWEST_FAST
from discover.statistics.residual import fast_part

_LEAST = 1e-3
"""Relative noise below which none is taken to be: a law is not told to more digits."""

_MOST = 1.0 / 3.0
"""Of the deviation of loadings, up to which their noise is told from the records: what changes from
sample to sample of few samples may be the flow, and a noise that is told too small leaves factors
freer, and intervals wider."""


Values = TypeVar("Values", Array, np.ndarray)
"""Arrays of JAX, where programs hold the records, or else of NumPy."""


class Loadings(eqx.Module):
    """Which rows of records share a loading, and how much their factors may differ.

    `members`: whether a row is a record of a loading, shape (loadings, rows).
    `noise`: standard deviation of the weighted residuals of each row that is noise, shape (rows,).
    """

    members: Bool[Array | np.ndarray, "loadings rows"]
    deviation: Float[Array | np.ndarray, ""]  # standard deviation of the factors
    noise: Float[Array | np.ndarray, " rows"]

    @property
    def rows(self) -> tuple[tuple[int, ...], ...]:
        """The rows of each loading's records."""
        return tuple(tuple(np.flatnonzero(own).tolist()) for own in np.asarray(self.members))

    def of_rows(self, rows: Sequence[int]) -> "Loadings":
        """Return the loadings of some rows; those of one loading are all there, or none."""
        at = list(rows)
        return Loadings(self.members[:, at], self.deviation, self.noise[at])

    def whitened(
        self, residual: Float[Values, "*trials rows n"], predicted: Float[Values, "*trials rows n"]
    ) -> Float[Values, "*trials rows n"]:
        """Return weighted residuals with factors of their own, which the prior holds back.

        `residual`, `predicted`: predictions minus records, and predictions, both weighted; arrays
        of NumPy or JAX.
        """
        along, size = self._along(residual, predicted)
        with np.errstate(all="ignore"):  # a trial that ran away
            signal = self.deviation**2
            # what the likely factor takes, and no more where nothing is predicted
            share = (1.0 - (1.0 + signal * size) ** -0.5) * along / (size + (size == 0.0))
            # a loading whose runs ran away leaves the others as they are
            return residual - self.at_rows(share)[..., None] * predicted

    def at_rows(self, values: Float[Values, "*trials loadings"]) -> Float[Values, "*trials rows"]:
        """Return values of loadings at the rows of their records; zero at rows of none."""
        return _where(self.members, values[..., :, None]).sum(-2)

    def factors(
        self,
        residual: Float[np.ndarray, "trials rows n"],
        predicted: Float[np.ndarray, "trials rows n"],
    ) -> tuple[Float[np.ndarray, "trials loadings"], Float[np.ndarray, "trials loadings"]]:
        """Return the factors less one that fit best without the prior, and their precisions.

        The precision is one over the variance by noise. Parameters as in `whitened`.
        """
        along, size = self._along(residual, predicted)
        return -along / np.where(size > 0.0, size, 1.0), size

    def _along(self, residual, predicted):
        """Return p·e and p·p of each loading, in units of the noise."""
        with np.errstate(all="ignore"):
            noise = self.noise[:, None]
            along = (residual * predicted / noise**2).sum(-1)
            size = ((predicted / noise) ** 2).sum(-1)
            both = (_where(self.members, of[..., None, :]).sum(-1) for of in (along, size))
            return tuple(both)


def _where(chosen, values):
    """Return values where they are chosen and zero elsewhere, of NumPy or JAX."""
    return values.__array_namespace__().where(chosen, values, 0.0)


def loadings(runs: Sequence[Run], unit: Float[np.ndarray, " runs"]) -> Loadings | None:
    """Return the loadings of runs; None where they are none of their own.

    What else was recorded of a run, and both moduli of a sweep, share its loading.

    `runs`: of each record one. `unit`: the norm of the weighted residuals of one that misses by all
    of its size, over the root of the number of its samples, shape (runs,).
    """
    deviations = {run.loading.deviation for run in runs if run.loading is not None}
    if not deviations:
        return None
    (deviation,) = deviations
    sources = np.array([run.source if run.loading is not None else "" for run in runs])
    own = np.array(names_of_loadings(runs))
    noise = [1.0 if (one := run.loading) is None else relative_noise(run, one) for run in runs]
    told = np.array([run.loading is not None for run in runs])
    return Loadings(
        (sources == own[:, None]) & told, np.asarray(deviation), np.where(told, noise * unit, 1.0)
    )


def names_of_loadings(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the name of each loading of some runs, in the order of `Loadings`."""
    return tuple(dict.fromkeys(run.source for run in runs if run.loading is not None))


def relative_noise(run: Run, loading: Loading) -> float:
    """Return the noise of a run that is a loading of its own, relative to its size."""
    noise = loading.noise
    if noise is None:
        most = _MOST * loading.deviation
        fast = fast_part(run.recorded / run.sizes(run.recorded))
        noise = float(np.clip(fast, _LEAST, most)) if len(run) >= FEWEST_FAST else most
    return max(noise, _LEAST)
