"""A free function that was found, and the closed form that is nearest to it."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.optimize import OptimizeWarning, curve_fit

from discover.closed_loop.results.error_pair import ErrorPair
from discover.statistics import HALF_BAND
from discover.statistics.projection import rms

Slot = Literal[
    "recorded_stress", "drift", "network", "rate", "position", "gap", "phase",
    "relaxation", "slip", "breakdown",
]  # fmt: skip

_WITHIN = 2.0
"""A closed form is the nearest one if it stays within so many standard deviations of the curve in
the mean square; or within `_CLOSE` of the curve's own size, where the curve is known better."""
_CLOSE = 0.05


@dataclass(frozen=True)
class FreeForm:
    """A smooth function that explains what named effects leave.

    Attributes
    ----------
    slot
        Where it acts: ``recorded_stress``, σ + f(σ) is recorded; ``drift``, σ + f(t); ``rate``,
        σ + f(γ̇); ``network``, σ (1 + f(|γ|)); ``position``, σ + f(γ); ``gap``, σ (1 + f(γ));
        ``phase``, σ + f(φ) in what oscillates, φ = 0 where the rate is largest; ``relaxation``,
        each mode relaxes 1 + f times as fast, with f of its dimensionless stress or rate;
        ``slip``, γ̇ − f(σ) is felt; ``breakdown``, a structure s to which the stress is proportional
        obeys ds/dt = (1 − s)/t_b − f(|γ̇|) s.
    variable, unit
        Of what it is a function, and its unit.
    beside
        Effects in the model with it.
    grid, value, low95, high95
        The curve with its 95 % band, shape (n,): in Pa (``network``, ``gap``, ``relaxation``: a
        pure number; ``slip``, ``breakdown``: in 1/s).
    nearest
        Name of a closed form that is it within its uncertainty; None if none is.
    evidence
        Lowering of the information criterion below that of what the search found.
    explains
        Whether nothing but noise is left with it.
    error
        Errors with it, on the runs fitted and held out.
    """

    slot: Slot
    variable: str
    unit: str
    beside: tuple[str, ...]
    grid: Float[np.ndarray, " n"]
    value: Float[np.ndarray, " n"]
    low95: Float[np.ndarray, " n"]
    high95: Float[np.ndarray, " n"]
    nearest: str | None
    evidence: float
    explains: bool
    error: ErrorPair


def drawn_form(
    slot: Slot,
    variable: tuple[str, str],
    beside: Sequence[str],
    grid: Float[np.ndarray, " n"],
    basis: Float[np.ndarray, "n m"],
    coefficients: Float[np.ndarray, " m"],
    covariance: Float[np.ndarray, "m m"],
    evidence: float,
    explains: bool,
    error: ErrorPair,
) -> FreeForm:
    """Return a sum of splines as a result holds it: with its band, and the nearest closed form.

    Parameters
    ----------
    slot, beside, evidence, explains, error
        As of a `FreeForm`.
    variable
        Of what it is a function, and its unit.
    grid, basis
        Where it is drawn, and the splines there.
    coefficients, covariance
        Of the splines.
    """
    value = basis @ coefficients
    variance = np.einsum("im,mk,ik->i", basis, covariance, basis)
    deviation = np.sqrt(np.clip(variance, 0.0, None))
    in_model = slot in ("relaxation", "slip", "breakdown")  # where nothing is a function of time
    nearest = nearest_form(grid, value, deviation, slot == "recorded_stress", not in_model)
    return FreeForm(
        slot,
        *variable,
        tuple(beside),
        grid,
        value,
        value - HALF_BAND * deviation,
        value + HALF_BAND * deviation,
        nearest,
        evidence,
        explains,
        error,
    )


def error_of(left: Float[np.ndarray, "runs n"]) -> float:
    """Return the mean relative error of runs, infinite where a model runs away."""
    if not np.all(np.isfinite(left)):
        return np.inf
    return float(np.mean(np.sqrt(np.sum(left**2, axis=1))))


_Form = Callable[..., np.ndarray]

# x is in units of its largest size, so that constants of all are of order one
_FORMS: dict[str, tuple[_Form, list[list[float]]]] = {
    "linear": (lambda x, a: a * x, [[0.1]]),
    "tanh": (lambda x, a: np.tanh(a * x) / a - x, [[0.5], [2.0]]),
    "power": (lambda x, a, n: a * np.sign(x) * np.abs(x) ** n, [[0.1, 0.5], [0.1, 2.0]]),
    "exponential": (lambda x, a, b: a * np.expm1(b * x), [[0.1, 1.0], [0.1, -3.0]]),
    "threshold": (
        lambda x, a, c: a * np.sign(x) * np.maximum(np.abs(x) - np.abs(c), 0.0),
        [[-0.5, 0.3], [-0.5, 0.7]],
    ),
    "periodic": (
        lambda x, a, b, c: a * np.sin(b * x) + c * (np.cos(b * x) - 1.0),
        [[0.1, b, 0.1] for b in (5.0, 15.0, 40.0)],
    ),
}


def nearest_form(
    grid: Float[np.ndarray, " n"],
    value: Float[np.ndarray, " n"],
    deviation: Float[np.ndarray, " n"],
    in_stress: bool,
    in_time: bool = True,
) -> str | None:
    """Return the simplest closed form that a curve is within its uncertainty; None if none is.

    A constant beside the form is free, for an offset is no shape.

    Parameters
    ----------
    grid, value, deviation
        The curve and its standard deviation.
    in_stress
        Whether the curve and its variable have one unit, which a saturation (tanh) needs.
    in_time
        Whether the variable may be one in which something repeats.
    """
    size = float(np.max(np.abs(grid))) or 1.0
    scale = size if in_stress else float(np.max(np.abs(value - np.mean(value)))) or 1.0
    x, y, spread = grid / size, value / scale, np.maximum(deviation / scale, 1e-12)
    own = rms(y - np.mean(y))
    for name, (form, starts) in _FORMS.items():
        if (name == "tanh" and not in_stress) or (name == "periodic" and not in_time):
            continue
        for start in starts:
            try:
                # a trial of an exponent or a rate may leave the range of numbers
                with warnings.catch_warnings(), np.errstate(all="ignore"):
                    # the values count, not their covariance
                    warnings.simplefilter("ignore", OptimizeWarning)
                    found, _ = curve_fit(
                        lambda at, offset, *rest, form=form: offset + form(at, *rest),
                        x, y, [0.0, *start], sigma=spread, maxfev=400,
                    )  # fmt: skip
            except (RuntimeError, FloatingPointError):
                continue
            off = y - found[0] - form(x, *found[1:])
            near = rms(off / spread) <= _WITHIN
            if near or rms(off) <= _CLOSE * own:
                return name
    return None
