"""The constant of each mode as finally fitted, and whether the data say anything of it."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from discover.forward import AugmentedModel, Batch, FreeParameter
from discover.forward.by_mode import DEGREE
from discover.forward.least_squares import Fit, jacobians, uncertainty
from discover.inference.constants import ConstantByMode, ModeConstant
from discover.inference.degrees import Degree
from discover.inference.varying_constant import varying_constants

_OPEN = float(np.log(0.95 / 0.05))
"""Half width of an interval, on the link's scale, from which on nothing is determined: about the
middle of a range it holds nine tenths of it, about a small constant a factor of 19 either way."""

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
    wider: Mapping[str, Fit],
) -> dict[str, ConstantByMode]:
    """Return the constants by mode of a final fit.

    The interval of a mode, and that at the mean time, holds that of the chosen degree and that of
    one degree more, where there is one.
    """
    found = {}
    times = model.declared.relaxation_time * np.exp(fit.theta[1])
    for name, constant in varying_constants(model, fit, degrees).items():
        of = degrees[name]
        low, high, half = constant.band(batch, fit, of.degree)
        mean = bounds[constant.at]
        if name in wider:
            more = constant.band(batch, wider[name], of.degree + 1)
            low, high = np.minimum(low, more[0]), np.maximum(high, more[1])
            half = np.maximum(half, more[2])
            (lowest,), (highest,), _ = constant.at_the_mean.band(batch, wider[name], of.degree + 1)
            mean = min(mean[0], float(lowest)), max(mean[1], float(highest))
        own = _own_half_widths(model, batch, fit, constant.start + DEGREE)
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
        )
    return found


def _own_half_widths(model, batch, fit, first: int) -> Float[np.ndarray, " k"]:
    """Return half the interval of each mode's constant, were nothing else fitted.

    On the link's scale. No other question of one mode alone is easier for the data, so that what
    is open here is open indeed.
    """
    at = range(first, first + len(model.declared.modulus))
    columns = jacobians(model, batch, [fit.theta], fit.residual[None], [list(at)])[0]
    half = np.full(len(columns), np.inf)
    for i, column in enumerate(columns):
        if np.any(column) and np.all(np.isfinite(column)):
            variance, quantile = uncertainty(batch, fit.residual, column[None])
            half[i] = quantile * float(np.sqrt(variance[0, 0]))
    return half


def _says(low, high, half, law: FreeParameter):
    """Return where an interval tells a constant."""
    width = law.high - law.low
    return (half < _OPEN) | (np.isfinite(width) & (high - low < _SMALL * width))


def _at_upper_end(values: Float[np.ndarray, " k"], law: FreeParameter) -> np.ndarray:
    """Return which constants stand at the upper end of their range."""
    width = law.high - law.low
    return np.isfinite(width) & (values > law.high - _AT_THE_END * width)
