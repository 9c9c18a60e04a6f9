"""The constant of each mode as finally fitted, and whether the data say anything of it."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from discover.forward import AugmentedModel, Batch, FreeParameter
from discover.inference.by_mode.alone import half_widths_alone, is_told
from discover.inference.by_mode.constants import ConstantByMode, ModeConstant
from discover.inference.by_mode.degrees import Degree
from discover.inference.by_mode.varying_constant import FreerFit, varying_constants
from discover.inference.least_squares import Fit

_AT_THE_END = 1e-3
"""Share of the range from its upper end within which a constant stands at that end: no finding, for
beyond it nothing was tried. At the lower end there is no effect, which is one."""

_SMALL = 0.1
"""Share of the range within which an interval determines that a constant is small, or large."""


def constants_by_mode(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    bounds: Mapping[int, tuple[float, float]],
    degrees: Mapping[str, Degree],
    freer: Sequence[FreerFit],
    beside: Float[np.ndarray, "free free"] | None = None,
) -> dict[str, ConstantByMode]:
    """Return the constants by mode of a final fit.

    The interval of a mode, and that at the mean time, holds that of the chosen degree and those of
    freer fits.

    Parameters
    ----------
    model, batch, fit
        The model, the fitted runs and the fit.
    bounds
        95 % interval of each fitted parameter, by position.
    degrees
        Degree of each constant by mode.
    freer
        From `freer_fits`.
    beside
        Covariance of what was fitted that is no noise; None for none.
    """
    found = {}
    times = model.mode_times(fit.theta)
    for name, constant in varying_constants(model, fit, degrees).items():
        of = degrees[name]
        low, high, half = constant.band(batch, fit, of, beside)
        mean = bounds[constant.at]
        for one in (one for one in freer if one.name == name):
            more = constant.band(batch, one.fit, one.degree)
            low, high = np.minimum(low, more[0]), np.maximum(high, more[1])
            half = np.maximum(half, more[2])
            (lowest,), (highest,), _ = constant.at_the_mean.band(batch, one.fit, one.degree)
            mean = min(mean[0], float(lowest)), max(mean[1], float(highest))
        own = half_widths_alone(model, batch, fit, name)
        alone = constant.of_modes(fit, -own), constant.of_modes(fit, own)
        values = constant.of_modes(fit)
        known = _says(low, high, half, constant.law) & _says(*alone, own, constant.law)
        known &= ~_at_upper_end(values, constant.law)
        each = zip(times, values, low, high, known, strict=True)
        found[name] = ConstantByMode(
            float(fit.theta[constant.at]),
            mean,
            "",
            float(times[0] / 10.0 ** constant.places[0]),
            of.degree,
            of.evidence,
            tuple(
                ModeConstant(float(t), float(v), (float(a), float(b)) if k else None, not k)
                for t, v, a, b, k in each
            ),
            own=len(of.own),
            is_raised=of.is_raised,
        )
    return found


def _says(low, high, half, law: FreeParameter):
    """Return where an interval tells a constant."""
    width = law.high - law.low
    return is_told(half) | (np.isfinite(width) & (high - low < _SMALL * width))


def _at_upper_end(values: Float[np.ndarray, " k"], law: FreeParameter) -> np.ndarray:
    """Return which constants stand at the upper end of their range."""
    width = law.high - law.low
    return np.isfinite(width) & (values > law.high - _AT_THE_END * width)
