"""A constant that may differ from mode to mode, on the scale of its link about a fit."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.forward import AugmentedModel, Batch, FreeParameter
from discover.forward.by_mode import DEGREE, constants_of_modes, link_slope
from discover.inference.by_mode.alone import told_beyond_a_polynomial
from discover.inference.by_mode.degrees import FREE, Degree
from discover.inference.fit_uncertainty import uncertainty
from discover.inference.least_squares import NO_PRIOR, Fit, Prior, fit_batch

_FARTHEST = 50.0  # e^50 of a constant is any
_ACROSS = 300.0  # on the link's scale, from one end of a range to the other wherever it began


@dataclass(frozen=True)
class VaryingConstant:
    """A constant by mode: its range, where it and its coefficients stand, and where the modes.

    Attributes
    ----------
    law
        Its range.
    at
        Position of the constant at the mean time.
    start
        Position of the first coefficient in log λ.
    places
        Of the modes, from `decades`.
    deviate
        Whether these are the modes, which may deviate from the polynomial.
    """

    law: FreeParameter
    at: int
    start: int
    places: Float[np.ndarray, " k"]
    deviate: bool = True

    @property
    def at_the_mean(self) -> "VaryingConstant":
        """The same constant at the mean time alone."""
        return replace(self, places=np.zeros(1), deviate=False)

    def of_modes(self, fit: Fit, shift: np.ndarray | float = 0.0) -> Float[np.ndarray, " k"]:
        """Return the constant of each mode, moved on the link's scale.

        Parameters
        ----------
        shift
            By how much, shape (k,) or ().
        """
        # one that stands far beyond an end must come back from there too
        farthest = _ACROSS if np.isfinite(self.law.high - self.law.low) else _FARTHEST
        first = self.start + DEGREE
        own = fit.theta[first : first + len(self.places)] if self.deviate else 0.0
        moved = np.clip(np.broadcast_to(shift, self.places.shape) + own, -farthest, farthest)
        coefficients = fit.theta[self.start : self.start + DEGREE]
        given = map(jnp.asarray, (coefficients, moved, self.places))
        mean = jnp.asarray(fit.theta[self.at])
        return np.asarray(constants_of_modes(mean, self.law.low, self.law.high, *given))

    def gradient(self, fit: Fit, degree: Degree) -> Float[np.ndarray, "k free"] | None:
        """Return the derivative of each mode's link in what was fitted; None at an end of a range.

        Parameters
        ----------
        fit
            The fit.
        degree
            What of the constant is free in it.
        """
        slope = link_slope(float(fit.theta[self.at]), self.law.low, self.law.high)
        if not np.isfinite(slope):
            return None
        gradient = np.zeros((len(self.places), len(fit.free)))
        gradient[:, fit.free.index(self.at)] = slope
        for i in range(degree.coefficients):
            gradient[:, fit.free.index(self.start + i)] = self.places ** (i + 1)
        for mode in degree.own if self.deviate else ():
            gradient[mode, fit.free.index(self.start + DEGREE + mode)] = 1.0
        return gradient

    def band(
        self,
        batch: Batch,
        fit: Fit,
        degree: Degree,
        beside: Float[np.ndarray, "free free"] | None = None,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the 95 % interval of each mode, and half its width on the link's scale.

        To first order there, so that it keeps the range.

        Parameters
        ----------
        batch, fit, degree
            The fitted runs, the fit, and what of the constant is free in it.
        beside
            Covariance of what was fitted that is no noise; None for none.
        """
        covariance, quantile = uncertainty(batch, fit.residual, fit.jacobian)
        covariance = covariance if beside is None else covariance + beside
        gradient = self.gradient(fit, degree)
        half = np.full(len(self.places), np.inf)
        if gradient is not None:
            variance = np.einsum("ki,ij,kj->k", gradient, covariance, gradient)
            half = quantile * np.sqrt(np.clip(variance, 0.0, None))
        return self.of_modes(fit, -half), self.of_modes(fit, half), half


def varying_constants(
    model: AugmentedModel, fit: Fit, degrees: Mapping[str, Degree]
) -> dict[str, VaryingConstant]:
    """Return the constants by mode that a fit has."""
    declared, found = model.declared, {}
    places = model.mode_places(fit.theta)
    for name in degrees:
        law, at = model.constant(name)
        if at in fit.free:
            start = declared.by_mode_slices[name].start
            found[name] = VaryingConstant(law, at, start, places)
    return found


@dataclass(frozen=True)
class FreerFit:
    """A fit in which one constant by mode is freer than evidence asks for.

    Attributes
    ----------
    name
        Of the constant.
    fit
        The fit.
    degree
        What of the constant is free in it.
    """

    name: str
    fit: Fit
    degree: Degree


def freer_fits(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    degrees: Mapping[str, Degree],
    prior: Prior = NO_PRIOR,
) -> list[FreerFit]:
    """Return the fits in which one constant has its next coefficient too, or is free in each mode.

    Evidence for the lower degree does not say that the next coefficient is zero, nor evidence for a
    smooth function that the constants lie on it. One constant for all modes has its first
    coefficient alone. A fit that is not usable is left out.

    Parameters
    ----------
    model, batch, fit
        The model, the fitted runs and the fit.
    degrees
        Degree of each constant by mode.
    prior
        What is known of some parameters.
    """
    found = []
    for name, constant in varying_constants(model, fit, degrees).items():
        of = degrees[name]
        freer = []
        if of.degree < min(len(of.evidence) - 1, DEGREE):
            freer.append(replace(of, degree=of.degree + 1))
        own = told_beyond_a_polynomial(model, batch, fit, name) if 0 < of.degree < FREE else ()
        if own:
            freer.append(replace(of, degree=FREE, own=own))
        for degree in freer:
            varied = [constant.start + place for place in degree.places]
            free = tuple(dict.fromkeys([*fit.free, *varied]))
            wider = fit_batch(model, batch, [fit.theta], [free], prior=prior)[0]
            if wider.usable:
                found.append(FreerFit(name, wider, degree))
    return found
