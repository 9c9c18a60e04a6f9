"""A linear frequency sweep, and a spectrum of relaxation modes from it."""

from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.mode_search import CLOSELY, ModeFit, ModeSearch, relative_moduli
from discover.dataset.tables.table import as_column
from discover.errors import InputError
from discover.statistics.noise_model import independent_samples, rms
from discover.statistics.whiteness import FEWEST_FAST, independence_probability

MOST_MODES = 30
# probability that noise leaves such a misfit, up to which it is taken to be none
_SEEMS_NOISE = 0.05
_SOLID = (
    "the material is a solid down to {:.4g} rad/s, with an elastic constant of {:.4g} Pa. A law of "
    "a fluid holds it as a mode of {:.3g} s, the shortest that the sweep allows: do not use what "
    "it says of steady flow, or of times as long."
)

Constant = float | Literal["fit"] | None
"""A constant that is known, that is fitted, or that evidence asks for."""


@dataclass(frozen=True)
class LinearSweep:
    """Small-amplitude oscillatory shear: G′ and G″ against frequency.

    Attributes
    ----------
    angular_frequency, storage_modulus, loss_modulus
        In rad/s, increasing, and in Pa, shape (n,).

    Examples
    --------
    >>> import discover as dc
    >>> import numpy as np
    >>> omega = np.logspace(-2, 2, 9)
    >>> len(dc.LinearSweep(omega, omega**2 / (1 + omega**2), omega / (1 + omega**2)))
    9
    """

    angular_frequency: Float[np.ndarray, " n"]
    storage_modulus: Float[np.ndarray, " n"]
    loss_modulus: Float[np.ndarray, " n"]

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

    @property
    def measured(self) -> Float[np.ndarray, "2 n"]:
        """G′ and G″ in Pa, shape (2, n)."""
        return np.stack([self.storage_modulus, self.loss_modulus])

    def __repr__(self) -> str:
        omega = self.angular_frequency
        span = f", {omega[0]:.4g} to {omega[-1]:.4g} rad/s" if len(self) else ""
        return f"<LinearSweep: {len(self)} frequencies{span}>"

    def relaxation_spectrum(self, **options: Any) -> "RelaxationSpectrum":
        """Return the modes of this sweep, with the options of `relaxation_spectrum`."""
        return relaxation_spectrum(self, **options)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the sweep, one line for each frequency, in the columns of ``lve.csv``."""
        columns = (self.angular_frequency, self.storage_modulus, self.loss_modulus)
        names = ("omega_rad_s", "Gp_Pa", "Gpp_Pa")
        return pd.DataFrame(dict(zip(names, columns, strict=True)))


@dataclass(frozen=True)
class RelaxationSpectrum:
    """Discrete relaxation spectrum, G(t) = Σ G_k exp(−t/λ_k), with a solvent.

    An elastic constant is the last mode, of the shortest time indistinguishable from a constant.
    """

    modulus: Float[np.ndarray, " k"]  # G_k in Pa, positive
    relaxation_time: Float[np.ndarray, " k"]  # λ_k in s, increasing
    relative_error: float  # root mean square of the relative misfit over all G′ and G″
    best_error: float  # the smallest of any number of modes tried
    # of the moduli in Pa², with a solvent's row and column last, in Pa s; None without a sweep
    modulus_covariance: Float[np.ndarray, "c c"] | None = None
    solvent_viscosity: float = 0.0  # η_s in Pa s
    elastic_modulus: float = 0.0  # G_e in Pa
    solid: str = ""  # what is to be known where G_e is more than G″ at the lowest frequency

    def __len__(self) -> int:
        return self.modulus.shape[0]

    @property
    def zero_shear_viscosity(self) -> float:
        """η₀ = Σ G_k λ_k + η_s of the modes that relax, in Pa s."""
        modulus, time = self._relaxing
        return float(np.sum(modulus * time)) + self.solvent_viscosity

    @property
    def mean_relaxation_time(self) -> float:
        """Σ G_k λ_k² / η₀ of the modes that relax, in s."""
        modulus, time = self._relaxing
        return float(np.sum(modulus * time**2)) / self.zero_shear_viscosity if len(time) else 0.0

    @property
    def _relaxing(self) -> tuple[np.ndarray, np.ndarray]:
        last = len(self) - (self.elastic_modulus > 0.0)
        return self.modulus[:last], self.relaxation_time[:last]

    def moduli(
        self, angular_frequency: Float[np.ndarray, " n"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return G′ and G″ in Pa at frequencies in rad/s."""
        x = angular_frequency[:, None] * self.relaxation_time
        storage, loss = (x**2 / (1 + x**2)) @ self.modulus, (x / (1 + x**2)) @ self.modulus
        return storage, loss + self.solvent_viscosity * angular_frequency


def relaxation_spectrum(
    sweep: LinearSweep, *, modes: int | None = None, solvent_viscosity: Constant = None,
    elastic_modulus: Constant = None,
) -> RelaxationSpectrum:  # fmt: skip
    """Return the modes, the solvent viscosity and the elastic constant that a sweep supports.

    G′ = Σ G_k x²/(1 + x²) + G_e and G″ = Σ G_k x/(1 + x²) + η_s ω with x = ωλ_k are fitted to the
    relative misfit, with times up to a decade beyond the sweep; evidence decides on modes, solvent
    and constant (`ModeSearch`).

    `modes`: their number, that of an elastic constant included. `solvent_viscosity`,
    `elastic_modulus`: in Pa s and Pa where known; ``"fit"`` asks for no evidence. Raises InputError
    if the sweep is too short or an argument is out of range.
    """
    count, measured, needs = len(sweep), sweep.measured, "A relaxation spectrum needs"
    if count < 2:
        raise InputError(f"{needs} a sweep of at least 2 frequencies; got {count}.")
    if modes is not None and not 1 <= modes <= count:
        raise InputError(
            f"modes must be from 1 to the number of frequencies, {count}; got {modes}."
        )
    if np.any(measured <= 0):
        raise InputError(f"{needs} moduli that are positive at every frequency. Remove the others.")
    known = {"solvent_viscosity": solvent_viscosity, "elastic_modulus": elastic_modulus}
    for name, value in known.items():
        number = isinstance(value, Real) and not isinstance(value, bool)
        if value not in (None, "fit") and not (number and 0.0 <= float(value) < np.inf):
            raise InputError(f'{name} must be a number, not negative, or "fit"; got {value!r}.')
    search = ModeSearch(sweep.angular_frequency, measured, solvent_viscosity, elastic_modulus)
    held = 0 if elastic_modulus in (None, "fit", 0.0) else 1  # a known constant is a mode too
    fits = list(search.fits(0 if modes is None else modes - held))
    most = [fit for fit in fits if fit.n_modes + held <= (modes or MOST_MODES)]
    most = most or [min(fits, key=lambda fit: fit.n_modes)]
    possible = [fit for fit in most if fit.n_modes + held == modes] or most
    likeliest = min(possible, key=search.criterion)
    found = _as_spectrum(sweep, search, search.fitted(likeliest, CLOSELY))
    best = _as_spectrum(sweep, search, min(fits, key=lambda fit: fit.squared))
    covariance = _covariance(sweep, found, _misfit(sweep, found))
    return replace(found, best_error=best.relative_error, modulus_covariance=covariance)


def _as_spectrum(sweep: LinearSweep, search: ModeSearch, fit: ModeFit) -> RelaxationSpectrum:
    times, known = fit.relaxation_time, (search.solvent_viscosity, search.elastic_modulus)
    modulus, extra = fit.amounts[: len(times)], iter(fit.amounts[len(times) :])
    solvent, elastic = (
        float(next(extra)) if one else float(value) if isinstance(value, Real) else 0.0
        for one, value in zip(fit.kinds, known, strict=True)
    )
    if elastic > 0.0:
        modulus = np.append(modulus, elastic)
        times = np.append(times, search.elastic_time(fit))
    slowest = int(np.argmin(sweep.angular_frequency))
    solid = ""
    if elastic > sweep.loss_modulus[slowest]:
        solid = _SOLID.format(sweep.angular_frequency[slowest], elastic, times[-1])
    found = RelaxationSpectrum(modulus, times, 0.0, 0.0, None, solvent, elastic, solid)
    return replace(found, relative_error=rms(_misfit(sweep, found)))


def _covariance(
    sweep: LinearSweep, found: RelaxationSpectrum, rows: Float[np.ndarray, "2 n"]
) -> Float[np.ndarray, "c c"]:
    """Return s² (AᵀA)⁻¹ of moduli and solvent; correlated misfit counts as fewer samples."""
    has_solvent = found.solvent_viscosity > 0.0
    amounts = np.append(found.modulus, [found.solvent_viscosity] if has_solvent else [])
    design = amounts * relative_moduli(
        sweep.angular_frequency, sweep.measured, found.relaxation_time, has_solvent
    )
    variance = np.sum(rows**2) / max(rows.size - design.shape[1], 1)
    tested = [[row] for row in rows] + [list(rows)]
    few = rows.shape[1] < FEWEST_FAST  # which do not tell whether it is noise
    if few or len(tested) * min(map(independence_probability, tested)) <= _SEEMS_NOISE:
        variance *= rows.size / sum(independent_samples(row) for row in rows)
    return variance * np.linalg.pinv(design.T @ design) * np.outer(amounts, amounts)


def _misfit(sweep: LinearSweep, found: RelaxationSpectrum) -> Float[np.ndarray, "2 n"]:
    """Return what a spectrum misses G′ and G″ by, relative, along increasing frequency."""
    order = np.argsort(sweep.angular_frequency)
    return (np.stack(found.moduli(sweep.angular_frequency)) / sweep.measured - 1.0)[:, order]
