"""A linear frequency sweep, and a spectrum of relaxation modes from it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.optimize import nnls

from discover.dataset.tables.columns import as_column
from discover.errors import InputError
from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.noise.whiteness import FEWEST_FAST, noise_probability, separate_probability
from discover.statistics.projection import rms
from discover.statistics.residual import slow_part

MOST_MODES = 30
TOLERANCE = 1.5
FLOOR = 0.01
"""A relative error below which no sweep is worth fitting: rheometers are not that accurate."""

MARGINS = (0.0, 0.25, 0.5)

_Fit = Callable[[int, float], tuple[np.ndarray, np.ndarray, float]]

_SEEMS_NOISE = 0.05
"""Probability that noise leaves such a misfit, up to which it is taken to be none."""


@dataclass(frozen=True)
class LinearSweep:
    """Small-amplitude oscillatory shear: G′ and G″ against frequency.

    Attributes
    ----------
    angular_frequency
        In rad/s, shape (n,), increasing.
    storage_modulus, loss_modulus
        In Pa, shape (n,).
    thinned
        How it was thinned when it was read, in words; empty if it was not.

    Examples
    --------
    >>> import discover as dc
    >>> import numpy as np
    >>> omega = np.logspace(-2, 2, 9)
    >>> sweep = dc.LinearSweep(omega, omega**2 / (1 + omega**2), omega / (1 + omega**2))
    >>> sweep.storage_modulus.shape
    (9,)
    """

    angular_frequency: Float[np.ndarray, " n"]
    storage_modulus: Float[np.ndarray, " n"]
    loss_modulus: Float[np.ndarray, " n"]
    thinned: str = ""

    def __post_init__(self):
        for label in ("angular_frequency", "storage_modulus", "loss_modulus"):
            column = as_column(getattr(self, label), f"{label} of a linear sweep")
            if column.shape != np.shape(self.angular_frequency):
                raise InputError(
                    f"{label} of a linear sweep must have shape {np.shape(self.angular_frequency)} "
                    f"like its frequencies; got {column.shape}."
                )
            object.__setattr__(self, label, column)
        if np.any(self.angular_frequency <= 0):
            raise InputError("The frequencies of a linear sweep must be positive, in rad/s.")

    def __len__(self) -> int:
        return self.angular_frequency.shape[0]

    def __repr__(self) -> str:
        omega = self.angular_frequency
        span = f", {omega[0]:.4g} to {omega[-1]:.4g} rad/s" if len(self) else ""
        return f"<LinearSweep: {len(self)} frequencies{span}>"

    def relaxation_spectrum(self, **options: Any) -> "RelaxationSpectrum":
        """Return the modes of this sweep.

        Parameters
        ----------
        **options
            `most_modes` and `tolerance` of `discover.dataset.relaxation_spectrum`.
        """
        return relaxation_spectrum(self, **options)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the sweep, one line for each frequency, in the columns of ``lve.csv``."""
        return pd.DataFrame(
            {
                "omega_rad_s": self.angular_frequency,
                "Gp_Pa": self.storage_modulus,
                "Gpp_Pa": self.loss_modulus,
            }
        )


@dataclass(frozen=True)
class RelaxationSpectrum:
    """Discrete relaxation spectrum, G(t) = Σ G_k exp(−t/λ_k).

    Attributes
    ----------
    modulus
        G_k in Pa, shape (k,), positive.
    relaxation_time
        λ_k in s, shape (k,), increasing.
    relative_error
        Root mean square of the relative misfit over all G′ and G″.
    best_error
        The smallest such error with any number of modes tried.
    errors
        Error against the number of modes, the best for each number.
    modulus_covariance
        Of the moduli at these relaxation times in Pa², shape (k, k), as the misfit of the sweep
        leaves them, with frequencies that err alike counted as one; None where they do not come
        from one.
    pattern
        Root mean square of what in that misfit is no noise, and may be of modes too few to follow
        the sweep; 0 where all of it may be noise. None where no number of modes follows it: it is
        off by itself, and excuses no pattern in records.
    """

    modulus: Float[np.ndarray, " k"]
    relaxation_time: Float[np.ndarray, " k"]
    relative_error: float
    best_error: float
    errors: dict[int, float]
    modulus_covariance: Float[np.ndarray, "k k"] | None = None
    pattern: float | None = 0.0

    def __len__(self) -> int:
        return self.modulus.shape[0]

    @property
    def zero_shear_viscosity(self) -> float:
        """η₀ = Σ G_k λ_k, in Pa s."""
        return float(np.sum(self.modulus * self.relaxation_time))

    def moduli(
        self, angular_frequency: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return G′ and G″ in Pa at frequencies in rad/s."""
        x = angular_frequency[:, None] * self.relaxation_time
        return (x**2 / (1 + x**2)) @ self.modulus, (x / (1 + x**2)) @ self.modulus


def relaxation_spectrum(
    sweep: LinearSweep, most_modes: int = MOST_MODES, tolerance: float = TOLERANCE
) -> RelaxationSpectrum:
    """Return the spectrum with the fewest modes that fits nearly as well as any.

    Relaxation times are spaced evenly in log time over the range of the sweep, widened by up to
    half a decade on each side; moduli come from non-negative least squares on the relative misfit
    of G′ and G″   [Baumgärtel & Winter 1989, Rheol. Acta 28, 511, for the aim; NNLS: Lawson &
    Hanson 1974]. Grids of 1 to `most_modes` times are tried; moduli that come out zero are not
    modes. Chosen is the spectrum with the fewest modes whose error is within the factor
    `tolerance` of the smallest error found, or below 1 %, whichever is the larger.

    Parameters
    ----------
    sweep
        G′ and G″.
    most_modes
        Largest number of relaxation times tried.
    tolerance
        How much worse than the best a spectrum may be, as a factor of 1 or more.

    Raises
    ------
    InputError
        If the sweep is too short or an argument is out of range.
    """
    if len(sweep.angular_frequency) < 2:
        raise InputError(
            "A relaxation spectrum needs a sweep of at least 2 frequencies; got "
            f"{len(sweep.angular_frequency)}."
        )
    if most_modes < 1 or tolerance < 1.0:
        raise InputError(
            f"most_modes must be at least 1 and tolerance at least 1; got {most_modes} and "
            f"{tolerance}."
        )
    if np.any(sweep.storage_modulus <= 0) or np.any(sweep.loss_modulus <= 0):
        raise InputError(
            "A relaxation spectrum needs moduli that are positive at every frequency. Remove the "
            "others."
        )
    # more unknowns than data would fit the noise
    count, fit = len(sweep.angular_frequency), cache(partial(_fit, sweep))
    found = fewest_modes(fit, min(most_modes, count), tolerance)
    modulus, time, error = min(_trials(fit, min(MOST_MODES, count)), key=lambda one: one[2])
    best = replace(found, modulus=modulus, relaxation_time=time, relative_error=error)
    rows = _misfit(sweep, found)
    is_noise = _seems_noise(rows)
    return replace(
        found,
        modulus_covariance=_covariance(sweep, found, rows, is_noise),
        pattern=_pattern(found, rows, is_noise, _misfit(sweep, best)),
    )


def fewest_modes(
    fit: _Fit,
    most: int,
    tolerance: float = TOLERANCE,
) -> RelaxationSpectrum:
    """Return the spectrum with the fewest modes of those that fit nearly as well as any.

    Parameters
    ----------
    fit
        Moduli in Pa, relaxation times in s and relative error, of a number of modes and of how far
        their times go beyond the data, in decades.
    most
        Largest number of modes.
    tolerance
        How much worse than the best a spectrum may be, as a factor of 1 or more.
    """
    trials = _trials(fit, most)
    best = min(error for _, _, error in trials)
    errors: dict[int, float] = {}
    for modulus, _, error in trials:
        errors[len(modulus)] = min(error, errors.get(len(modulus), np.inf))
    within = [trial for trial in trials if trial[2] <= max(tolerance * best, FLOOR)]
    modulus, relaxation_time, error = min(within, key=lambda trial: (len(trial[0]), trial[2]))
    return RelaxationSpectrum(modulus, relaxation_time, error, best, dict(sorted(errors.items())))


def _trials(fit: _Fit, most: int) -> list[tuple[np.ndarray, np.ndarray, float]]:
    return [fit(n, margin) for n in range(1, most + 1) for margin in MARGINS[: 2 * n]]


def _fit(sweep: LinearSweep, n: int, margin: float) -> tuple[np.ndarray, np.ndarray, float]:
    frequency = sweep.angular_frequency
    longest = 10.0**margin / frequency.min()
    shortest = 10.0**-margin / frequency.max()
    times = np.geomspace(shortest, longest, n) if n > 1 else np.array([(longest * shortest) ** 0.5])
    design = _relative_moduli(sweep, times)
    # columns of similar size: moduli may span many decades
    scale = np.linalg.norm(design, axis=0)
    modulus, _ = nnls(design / scale, np.ones(len(design)), maxiter=100 * n + 100)
    modulus = modulus / scale
    error = rms(design @ modulus - 1.0)
    keep = modulus > 0
    return modulus[keep], times[keep], error


def _relative_moduli(sweep: LinearSweep, times: Float[np.ndarray, " k"]) -> np.ndarray:
    """Return G′ and G″ of modes of 1 Pa over those measured, shape (2n, k), in 1/Pa."""
    x = sweep.angular_frequency[:, None] * times
    return np.concatenate(
        [
            x**2 / (1 + x**2) / sweep.storage_modulus[:, None],
            x / (1 + x**2) / sweep.loss_modulus[:, None],
        ]
    )


def _covariance(
    sweep: LinearSweep, found: RelaxationSpectrum, rows: Float[np.ndarray, "2 n"], is_noise: bool
) -> Float[np.ndarray, "k k"]:
    """Return s² (AᵀA)⁻¹ of the moduli, s² the misfit for each degree of freedom that is left.

    Where the misfit is no noise, neighbouring frequencies err alike, and so many of them count as
    one as the autocorrelation of the misfit says: a sweep at a strain that is not small, or of a
    tool with inertia, is off by something smooth, which the moduli take up as far as they can.
    """
    design = _relative_moduli(sweep, found.relaxation_time) * found.modulus
    free = max(len(design) - len(found), 1)
    variance = np.sum((np.sum(design, axis=1) - 1.0) ** 2) / free
    if not is_noise:
        variance *= rows.size / sum(independent_samples(row) for row in rows)
    return variance * np.linalg.pinv(design.T @ design) * np.outer(found.modulus, found.modulus)


def _misfit(sweep: LinearSweep, found: RelaxationSpectrum) -> Float[np.ndarray, "2 n"]:
    """Return what modes miss G′ and G″ by, relative, along increasing frequency."""
    design = _relative_moduli(sweep, found.relaxation_time)
    order = np.argsort(sweep.angular_frequency)
    return (design @ found.modulus - 1.0).reshape(2, -1)[:, order]


def _seems_noise(rows: Float[np.ndarray, "2 n"]) -> bool:
    """Return whether noise of each frequency may leave such a misfit; not told of a few."""
    if rows.shape[1] < FEWEST_FAST:
        return False
    chance = len(rows) * min(separate_probability([row]) for row in rows)
    of_all = noise_probability(rows, np.ones_like(rows))
    return min(chance, 1.0 if of_all is None else of_all) > _SEEMS_NOISE


def _pattern(
    found: RelaxationSpectrum,
    rows: Float[np.ndarray, "2 n"],
    is_noise: bool,
    left: Float[np.ndarray, "2 n"],
) -> float | None:
    """Return the root mean square of what in the misfit is no noise, and due to modes too few.

    Neighbours that do not lie about the moduli as noise does show it; and so do more modes, which
    leave less than these by more than the freedom that they have. Of a sweep too short to tell it
    is all of the misfit. None if no number of modes leaves noise: `left` is of the best.
    """
    if rows.shape[1] < FEWEST_FAST:
        return found.relative_error
    count = rows.size

    def variance(modes: int, error: float) -> float:
        return error**2 * count / max(count - modes, 1)

    least = min(variance(modes, error) for modes, error in found.errors.items())
    coarse = np.sqrt(max(variance(len(found), found.relative_error) - least, 0.0))
    slow = 0.0 if is_noise else _slow(rows)
    pattern = min(max(slow, float(coarse)), found.relative_error)
    return None if _slow(left) > FLOOR and not _seems_noise(left) else pattern


def _slow(rows: Float[np.ndarray, "2 n"]) -> float:
    return float(np.sqrt(np.mean([slow_part(row) ** 2 for row in rows])))
