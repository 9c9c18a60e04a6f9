"""Time–temperature superposition: sweeps at several temperatures as one, and how well that holds.

Neighbouring sweeps are laid over each other by log a_T, and log b_T if asked for, that make
log G′ and log G″ agree best where they overlap; shifts add up from the reference temperature
[Ferry 1980, Viscoelastic Properties of Polymers, ch. 11]. b_T divides moduli, a_T multiplies
frequencies.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float
from scipy.constants import R
from scipy.interpolate import PchipInterpolator
from scipy.optimize import curve_fit, least_squares
from scipy.stats import t as student

from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.load import SWEEP_FILE, TESTS_FILE, read_sweep
from discover.dataset.table import read_table
from discover.errors import InputError

_FEWEST = 4
"""Samples of each of two neighbours in their overlap, below which they are not laid over."""

_STEPS = 241

SUPERPOSED, FAILED = 0.05, 0.1
"""Root-mean-square relative misfit in an overlap up to which sweeps superpose, about what two
loadings of one sample differ by, and from which on they do not."""

_FACTOR_TWO = 0.3


@dataclass(frozen=True)
class ShiftLaw:
    """Shift factors as a function of temperature.

    Attributes
    ----------
    name
        ``WLF`` or ``Arrhenius``.
    values
        C1 and C2 in K, or the activation energy in J/mol, by name.
    intervals
        95 % interval of each; None where these shifts do not determine it.
    error
        Root-mean-square misfit of log10 a_T.
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


@dataclass(frozen=True)
class Superposition:
    """Sweeps at several temperatures, moved to one.

    Attributes
    ----------
    reference
        In °C.
    celsius
        Temperatures, increasing, shape (n,).
    sweeps
        As measured, in this order.
    log_shift, log_vertical
        log10 of a_T and b_T, shape (n,).
    misfit
        Root-mean-square relative misfit in the overlap of each temperature with the next,
        shape (n − 1,).
    laws
        WLF and Arrhenius, fitted to a_T; fewer where there are too few temperatures.
    """

    reference: float
    celsius: Float[np.ndarray, " n"]
    sweeps: tuple[LinearSweep, ...]
    log_shift: Float[np.ndarray, " n"]
    log_vertical: Float[np.ndarray, " n"]
    misfit: Float[np.ndarray, " pairs"]
    laws: tuple[ShiftLaw, ...]

    @property
    def verdict(self) -> str:
        """``superposed``, ``doubtful`` or ``not_superposed``, by the worst overlap."""
        worst = float(np.max(self.misfit))
        if worst <= SUPERPOSED:
            return "superposed"
        return "doubtful" if worst < FAILED else "not_superposed"

    def moved(self, at: int) -> LinearSweep:
        """Return the sweep at a temperature as it would be at the reference."""
        sweep, factor = self.sweeps[at], 10.0 ** -self.log_vertical[at]
        return LinearSweep(
            sweep.angular_frequency * 10.0 ** self.log_shift[at],
            sweep.storage_modulus * factor,
            sweep.loss_modulus * factor,
        )

    @property
    def master(self) -> LinearSweep:
        """All moved sweeps as one, sorted by frequency."""
        moved = [self.moved(at) for at in range(len(self.sweeps))]
        omega, storage, loss = (
            np.concatenate([getattr(one, name) for one in moved])
            for name in ("angular_frequency", "storage_modulus", "loss_modulus")
        )
        order = np.argsort(omega, kind="stable")
        return LinearSweep(omega[order], storage[order], loss[order])


def read_temperatures(root: Path) -> dict[float, LinearSweep]:
    """Return the linear sweeps of a folder by temperature in °C, as ``tests.csv`` lists them.

    Raises
    ------
    InputError
        If the list is missing or wrong, or has fewer than two temperatures.
    """
    table = read_table(
        root / TESTS_FILE, TESTS_FILE, "Sweeps at several temperatures are listed there; write one "
        "with the columns file, test and temperature_C."
    )  # fmt: skip
    for column in ("file", "test", "temperature_C"):
        if column not in table.columns:
            raise InputError(
                f"{TESTS_FILE} has no column {column!r}; it has {table.listed}. Add it."
            )
    degrees = table.numbers("temperature_C")
    found: dict[float, LinearSweep] = {}
    for row, (name, test) in enumerate(
        zip(table.columns["file"], table.columns["test"], strict=True)
    ):
        if test.strip() != SWEEP_FILE.removesuffix(".csv"):
            continue
        if Path(name).name != name:
            raise InputError(f"{TESTS_FILE} names {name!r}; put the file itself in the folder.")
        if float(degrees[row]) in found:
            raise InputError(f"{TESTS_FILE} has two sweeps at {degrees[row]:g} °C; keep one.")
        found[float(degrees[row])] = read_sweep(root / name)
    if len(found) < 2:
        raise InputError(
            f"{TESTS_FILE} lists {len(found)} linear sweeps; shifting needs two temperatures."
        )
    return found


def superpose(
    sweeps: Mapping[float, LinearSweep], reference: float | None = None, vertical: bool = False
) -> Superposition:
    """Return sweeps at several temperatures moved to one of them.

    Parameters
    ----------
    sweeps
        By temperature in °C.
    reference
        One of them; the middle one if None.
    vertical
        Whether moduli too may be moved.

    Raises
    ------
    InputError
        If the reference is none of the temperatures, or neighbours share too few moduli.
    """
    celsius = np.array(sorted(sweeps))
    reference = float(celsius[len(celsius) // 2]) if reference is None else reference
    if reference not in sweeps:
        known = ", ".join(f"{t:g}" for t in celsius)
        raise InputError(f"There is no sweep at {reference:g} °C. Take one of {known}.")
    ordered = tuple(sweeps[float(t)] for t in celsius)
    pairs = [
        _lay(cold, warm, vertical, f"{celsius[i]:g} and {celsius[i + 1]:g} °C")
        for i, (cold, warm) in enumerate(pairwise(ordered))
    ]
    shifts = np.concatenate([[[0.0, 0.0]], np.cumsum([pair[:2] for pair in pairs], axis=0)])
    at = int(np.flatnonzero(celsius == reference)[0])
    shifts = shifts - shifts[at]
    laws = tuple(
        law for name in _LAWS if (law := _fit_law(name, celsius, shifts[:, 0], at)) is not None
    )
    misfit = np.array([pair[2] for pair in pairs])
    return Superposition(reference, celsius, ordered, shifts[:, 0], shifts[:, 1], misfit, laws)


def _curves(sweep: LinearSweep) -> tuple[np.ndarray, np.ndarray]:
    omega, first = np.unique(sweep.angular_frequency, return_index=True)
    moduli = np.stack([sweep.storage_modulus, sweep.loss_modulus])[:, first]
    return np.log10(omega), np.log10(moduli)


def _lay(
    cold: LinearSweep, warm: LinearSweep, vertical: bool, where: str
) -> tuple[float, float, float]:
    """Return log a and log b that lay a sweep over its colder neighbour, and the misfit there."""
    x, fixed = _curves(cold)
    z, moving = _curves(warm)
    if min(len(x), len(z)) < _FEWEST:
        raise InputError(f"Shifting needs {_FEWEST} frequencies; a sweep at {where} has fewer.")
    spline = PchipInterpolator(x, fixed, axis=1, extrapolate=False)

    def residual(shift: float, rows: np.ndarray) -> np.ndarray:
        return moving[:, rows] - spline(z[rows] + shift)

    def inside(shift: float) -> np.ndarray:
        return (z + shift >= x[0]) & (z + shift <= x[-1])

    def misfit(shift: float) -> float:
        rows = inside(shift)
        if np.sum(rows) < _FEWEST:
            return np.inf
        left = residual(shift, rows)
        return float(np.sqrt(np.mean((left - (np.mean(left) if vertical else 0.0)) ** 2)))

    trials = np.linspace(x[0] - z[-1], x[-1] - z[0], _STEPS)
    best = trials[int(np.argmin([misfit(shift) for shift in trials]))]
    if not misfit(best) < _FACTOR_TWO:
        raise InputError(
            f"No shift in time brings the sweeps at {where} within a factor of two of each other. "
            "They share no moduli, or differ in more than time; measure between them, or leave "
            "temperatures out with --between."
        )
    rows = inside(best)
    spline = PchipInterpolator(x, fixed, axis=1)  # a sample may leave the overlap by a little

    def left(free: np.ndarray) -> np.ndarray:
        return (residual(free[0], rows) - (free[1] if vertical else 0.0)).ravel()

    start = np.mean(residual(best, rows)) if vertical else 0.0
    found = least_squares(left, [best, start][: 1 + vertical], x_scale=0.1).x
    error = float(np.sqrt(np.mean((np.log(10.0) * left(found)) ** 2)))
    return float(found[0]), float(found[1]) if vertical else 0.0, error


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
    return ShiftLaw(name, known, intervals, float(np.sqrt(np.mean(left**2))))


def shift_table(found: Superposition) -> str:
    """Return temperatures, shift factors and misfits as the text of ``shift_factors.csv``."""
    rows = [("temperature_C", "a_T", "b_T", "misfit_to_next")]
    for i, degrees in enumerate(found.celsius):
        misfit = f"{found.misfit[i]:.4g}" if i < len(found.misfit) else ""
        a, b = 10.0 ** found.log_shift[i], 10.0 ** found.log_vertical[i]
        rows.append((f"{degrees:g}", repr(float(a)), repr(float(b)), misfit))
    return "\n".join(",".join(row) for row in rows) + "\n"
