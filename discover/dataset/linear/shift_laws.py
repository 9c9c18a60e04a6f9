"""Laws of shift factors: a_T as a function of temperature."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.constants import R
from scipy.optimize import curve_fit
from scipy.stats import t as student

from discover.statistics.projection import rms


@dataclass(frozen=True)
class ShiftLaw:
    """Shift factors as a function of temperature.

    `name`: ``WLF`` or ``Arrhenius``.
    `values`: C1 and C2 in K, or the activation energy in J/mol, by name.
    `intervals`: 95 % interval of each; None where these shifts do not determine it.
    `error`: root-mean-square misfit of log10 a_T.
    """

    name: str
    values: dict[str, float]
    intervals: dict[str, tuple[float, float] | None]
    error: float

    def log_shift(
        self, celsius: Float[np.ndarray, " n"], reference: float
    ) -> Float[np.ndarray, " n"]:
        """Return log10 a_T at temperatures in °C."""
        return _LAWS[self.name][0](celsius, reference, *self.values.values())


def fit_shift_laws(
    celsius: Float[np.ndarray, " n"], log_shift: Float[np.ndarray, " n"], at: int
) -> tuple[ShiftLaw, ...]:
    """Return WLF and Arrhenius, fitted; fewer where there are too few temperatures.

    `celsius` in °C. `log_shift`: log10 a_T. `at`: which of them is the reference.
    """
    fitted = (_fit_law(name, celsius, log_shift, at) for name in _LAWS)
    return tuple(law for law in fitted if law is not None)


def _wlf(celsius, reference, c1, c2):
    return -c1 * (celsius - reference) / (c2 + celsius - reference)


def _arrhenius(celsius, reference, energy):
    return energy / R / np.log(10.0) * (1.0 / (celsius + 273.15) - 1.0 / (reference + 273.15))


_LAWS = {
    "WLF": (_wlf, {"C1": 10.0, "C2_K": 100.0}),
    "Arrhenius": (_arrhenius, {"activation_energy_J_mol": 5e4}),
}


def _fit_law(name: str, celsius, log_shift, at: int) -> ShiftLaw | None:
    """Return a law of the shifts; None with too few temperatures. The reference has no shift."""
    law, start = _LAWS[name]
    others = np.arange(len(celsius)) != at
    if np.sum(others) <= len(start):
        return None
    reference = float(celsius[at])
    coldest = reference - float(celsius[0])

    def of(temperatures, *free):
        return law(temperatures, reference, *free)

    first = list(start.values())
    first[-1] = max(first[-1], 1.5 * coldest) if name == "WLF" else first[-1]
    try:
        values, covariance = curve_fit(of, celsius[others], log_shift[others], p0=first)
    except RuntimeError:  # no such law near these shifts
        return None
    left = log_shift[others] - of(celsius[others], *values)
    wide = student.ppf(0.975, np.sum(others) - len(start)) * np.sqrt(np.diag(covariance))
    intervals = {
        key: (float(value - half), float(value + half)) if half < abs(value) else None
        for key, value, half in zip(start, values, wide, strict=True)
    }
    known = {key: float(value) for key, value in zip(start, values, strict=True)}
    return ShiftLaw(name, known, intervals, rms(left))
