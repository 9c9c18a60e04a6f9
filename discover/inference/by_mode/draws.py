"""Constants by mode drawn from what the runs leave of them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.stats import norm
from scipy.stats.qmc import LatinHypercube

from discover.forward import Batch
from discover.inference.by_mode.degrees import Degree
from discover.inference.by_mode.varying_constant import (
    FreerFit,
    VaryingConstant,
    varying_constants,
)
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem
from discover.statistics import root_of

_TWO_SIDED = float(norm.ppf(0.975))


@dataclass(frozen=True)
class ConstantsDrawn:
    """Constants of every mode that the runs allow, in groups.

    Attributes
    ----------
    values
        Shape (draws, constants, k). Each group begins with the fit that it is drawn about.
    sizes
        Length of each group. The first has the degrees that evidence asked for; in every other one
        constant is freer.
    """

    names: tuple[str, ...]
    values: Float[np.ndarray, "draws constants k"]
    sizes: tuple[int, ...]


def draw_constants(
    problem: FitProblem,
    fit: Fit,
    degrees: Mapping[str, Degree],
    freer: Sequence[FreerFit],
    n_draws: int,
    beside: Float[np.ndarray, "free free"] | None = None,
) -> ConstantsDrawn | None:
    """Return constants by mode drawn about a fit, on the scale of their link.

    Of the fit itself, and of the freer ones, as intervals hold all. None where a constant stands at
    an end of its range, from where no first order leads anywhere.

    Parameters
    ----------
    problem, fit
        What is fitted to what, and the final fit.
    degrees
        Degree of each constant by mode.
    freer
        From `freer_fits`.
    n_draws
        About each fit.
    beside
        Covariance of what was fitted that is no noise; None for none. Freer fits are without it.
    """
    constants = varying_constants(problem.model, fit, degrees)
    if not constants:
        return None
    fits = [(fit, dict(degrees), beside)]
    fits += [(one.fit, {**degrees, one.name: one.degree}, None) for one in freer]
    rng = np.random.default_rng(0)
    groups = [_about(problem.batch, *one, constants, n_draws, rng) for one in fits]
    drawn = [group for group in groups if group is not None]
    if len(drawn) < len(groups):
        return None
    return ConstantsDrawn(tuple(constants), np.concatenate(drawn), tuple(map(len, drawn)))


def _about(
    batch: Batch,
    fit: Fit,
    degrees: Mapping[str, Degree],
    beside: Float[np.ndarray, "free free"] | None,
    constants: Mapping[str, VaryingConstant],
    n_draws: int,
    rng: np.random.Generator,
) -> Float[np.ndarray, "draws constants k"] | None:
    covariance, quantile = uncertainty(batch, fit.residual, fit.jacobian)
    covariance = covariance if beside is None else covariance + beside
    # evenly along every axis, or the ends of a band of few draws would be a matter of luck
    even = norm.ppf(LatinHypercube(len(covariance), scramble=False, rng=rng).random(n_draws))
    moved = (quantile / _TWO_SIDED) * even @ root_of(covariance).T
    columns = []
    for name, constant in constants.items():
        gradient = constant.gradient(fit, degrees[name])
        if gradient is None:
            return None
        shifts = [np.zeros(len(constant.places)), *(moved @ gradient.T)]
        columns.append(np.stack([constant.of_modes(fit, shift) for shift in shifts]))
    return np.stack(columns, axis=1)
