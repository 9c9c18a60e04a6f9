"""Time–temperature superposition: sweeps at several temperatures as one, and how well that holds.

Neighbouring sweeps are laid over each other by log a_T, and log b_T if asked for, that leave one
smooth curve through the logs of both moduli the least scatter; shifts add up from the reference
temperature [Ferry 1980, ch. 11].
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from jaxtyping import Float
from numpy.polynomial.chebyshev import chebvander
from scipy.constants import R
from scipy.interpolate import PchipInterpolator
from scipy.optimize import curve_fit, least_squares
from scipy.stats import f as variance_ratio
from scipy.stats import norm
from scipy.stats import t as student

from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.load import TESTS_FILE, read_sweep
from discover.dataset.tables.table import read_table
from discover.errors import InputError, Problems
from discover.statistics.noise.noise_model import independent_samples, rms
from discover.words import did_you_mean

_FEWEST = 4  # samples of each in the overlap, below which neighbours are not laid over
_STEPS = 241
_FACTOR_TWO = 0.3
# Of two overlaps whose misfits differ by no more than such noise would in this share of cases, the
# longer one counts
_CHANCE = 0.99
_TURNS = 3  # how often a shift is fitted: by it samples come into the overlap or leave it
# Largest degree of the smooth curve, and fewest samples for each of its constants: logs of moduli
# bend slowly. Schwarz's criterion chooses, with twice its penalty: a bend that is noise would seem
# to know the shift of a straight line
_LARGEST_DEGREE, _SAMPLES_A_CONSTANT = 8, 2
_UNKNOWN = 2.0  # standard error in decades of a shift of which an overlap says nothing
_DECADE = np.log(10.0)

# root-mean-square relative misfit in an overlap up to which sweeps superpose, about what two
# loadings of one sample differ by, and from which on they do not
SUPERPOSED, FAILED = 0.05, 0.1
_TWO_SIDED = float(norm.ppf(0.975))


def read_sweeps(root: Path) -> dict[float, LinearSweep]:
    """Return the sweeps of a folder by temperature in °C, as ``tests.csv`` lists them.

    Raises InputError if the list or a file is wrong.
    """
    missing = "Sweeps at several temperatures are listed there; write one with the columns file, "
    table = read_table(root / TESTS_FILE, TESTS_FILE, missing + "test and temperature_C.")
    problems = Problems()
    for column in ("file", "test", "temperature_C"):
        if column not in table.columns:
            problems.add(
                f"{TESTS_FILE} has no column {column!r}; it has {table.listed}."
                f"{did_you_mean(column, table.columns)} Add it."
            )
    problems.require_none(TESTS_FILE)
    found: dict[float, LinearSweep] = {}
    degrees = table.numbers("temperature_C").tolist()
    for celsius, name, test in zip(
        degrees, table.columns["file"], table.columns["test"], strict=True
    ):
        if test.strip() != "lve":
            continue
        if Path(name).name != name:
            raise InputError(f"{TESTS_FILE} names {name!r}; put the file itself in the folder.")
        if celsius in found:
            raise InputError(f"{TESTS_FILE} has two sweeps at {celsius:g} °C; keep one of them.")
        found[celsius] = read_sweep(root / name)
    return found


class _Pair(NamedTuple):
    """Log moduli, shape (2, n), over log frequencies of two neighbours."""

    x: Float[np.ndarray, " n"]  # of the colder
    cold: Float[np.ndarray, "2 n"]
    z: Float[np.ndarray, " m"]  # of the warmer
    warm: Float[np.ndarray, "2 m"]

    def inside(self, shift: float) -> np.ndarray:
        """Return which samples of the warmer lie in the range of the colder."""
        moved = self.z + shift
        return np.flatnonzero((moved >= self.x[0]) & (moved <= self.x[-1]))

    def off(self, shift: float, rows: np.ndarray) -> Float[np.ndarray, "2 k"]:
        """Return what log moduli of the warmer lie above those of the colder."""
        through = PchipInterpolator(self.x, self.cold, axis=1)
        return self.warm[:, rows] - through(self.z[rows] + shift)


def _logs(sweep: LinearSweep, where: str) -> tuple[np.ndarray, np.ndarray]:
    omega, first = np.unique(sweep.angular_frequency, return_index=True)
    if len(omega) < _FEWEST:
        raise InputError(
            f"Shifting needs {_FEWEST} frequencies in each sweep, and one of those at {where} has "
            f"{len(omega)}. Leave it out with --between."
        )
    return np.log10(omega), np.log10(sweep.measured[:, first])


Overlap = tuple[Float[np.ndarray, " 2"], Float[np.ndarray, " 2"]]
"""log10 of a_T and b_T of the warmer over the colder, and their variances."""


def lay_over(cold: LinearSweep, warm: LinearSweep, vertical: bool, where: str) -> Overlap:
    """Return the shift that lays a sweep over that at a lower temperature.

    `vertical`: whether moduli too may be moved. `where`: the two temperatures, in words. Raises
    InputError if nothing overlaps, or only curves of other shapes.
    """
    pair = _Pair(*_logs(cold, where), *_logs(warm, where))
    # power laws slide along themselves if they may move up too: first without that
    starts = (_longest(pair, up) for up in ((False, True) if vertical else (False,)))
    start = next((start for start in starts if start is not None), None)
    if start is None:
        raise InputError(
            f"No shift in time brings the sweeps at {where} within a factor of two of each other. "
            "They share no moduli, or differ in more than time; measure between them, or leave "
            "temperatures out with --between."
        )
    found = _refined(pair, start, vertical)
    for _ in range(_TURNS - 1):
        # what is not determined is not followed
        is_known = np.sqrt(found[1][0]) < _FACTOR_TWO
        if is_known and len(pair.inside(found[0][0])) >= _FEWEST:
            found = _refined(pair, float(found[0][0]), vertical)
    return found


def _longest(pair: _Pair, up: bool) -> float | None:
    """Return log a_T of the longest overlap of those that agree best; None if none agree."""

    def misfit(shift: float) -> tuple[float, float]:
        rows = pair.inside(shift)
        if len(rows) < _FEWEST:
            return np.inf, 0.0
        off = pair.off(shift, rows)
        return float(np.var(off) if up else np.mean(off**2)), float(off.size)

    trials = np.linspace(pair.x[0] - pair.z[-1], pair.x[-1] - pair.z[0], _STEPS)
    squares, counts = np.array([misfit(shift) for shift in trials]).T
    best = int(np.argmin(squares))
    if not squares[best] < _FACTOR_TWO**2:
        return None
    # few samples may agree by chance: of all overlaps that are no worse, the one with most
    chance = variance_ratio.ppf(_CHANCE, np.maximum(counts, 1.0), max(counts[best] - 1.0, 1.0))
    alike = np.flatnonzero(squares <= chance * squares[best])
    return float(trials[alike[np.lexsort((squares[alike], -counts[alike]))[0]]])


def _refined(pair: _Pair, start: float, vertical: bool) -> Overlap:
    """Return the shift by which one smooth curve goes through both sweeps best.

    A curve drawn through the samples of one of them would bend with its noise, and seem to know the
    shift from bends that are none.
    """
    rows = pair.inside(start)
    moved = pair.z[rows] + start
    # the samples of the colder on both sides of the end ones are needed to lie between them
    first = max(int(np.searchsorted(pair.x, moved.min(), "right")) - 1, 0)
    last = min(int(np.searchsorted(pair.x, moved.max(), "left")), len(pair.x) - 1)
    x, cold = pair.x[first : last + 1], pair.cold[:, first : last + 1]
    low, high = min(x[0], moved.min()), max(x[-1], moved.max())
    n = len(x) + len(rows)

    def left(which: int, degree: int, shift: float, up: float) -> Float[np.ndarray, " n"]:
        places = np.concatenate([x, pair.z[rows] + shift])
        values = np.concatenate([cold[which], pair.warm[which, rows] - up])
        basis = chebvander((2.0 * places - low - high) / (high - low), degree)
        return values - basis @ np.linalg.lstsq(basis, values)[0]

    up = float(np.mean(pair.off(start, rows))) if vertical else 0.0

    def criterion(which: int, degree: int) -> float:
        square = max(float(np.sum(left(which, degree, start, up) ** 2)), 1e-300)
        return n * np.log(square) + 2.0 * (degree + 1) * np.log(n)

    most = max(min(_LARGEST_DEGREE, n // _SAMPLES_A_CONSTANT - 1), 1)
    curves = [
        (which, min(range(1, most + 1), key=lambda degree, which=which: criterion(which, degree)))
        for which in range(2)
    ]

    first_guess = np.array([start, up] if vertical else [start])

    def all_left(shift: np.ndarray) -> list[np.ndarray]:
        return [left(*curve, shift[0], shift[1] if vertical else 0.0) for curve in curves]

    # straight lines slide along themselves: their shift stays near, and its error is large
    held = rms(np.concatenate(all_left(first_guess))) / _UNKNOWN
    fit = least_squares(
        lambda shift: np.concatenate([*all_left(shift), held * (shift - first_guess)]),
        first_guess,
        x_scale=0.1,
    )
    parts = [part for one in all_left(fit.x) for part in np.split(one, [len(x)])]
    spent = len(first_guess) + sum(degree + 1 for _, degree in curves)
    share = max(2 * n - spent, 1) / (2 * n)
    alone = min(sum(independent_samples(part) for part in parts), 2.0 * n) * share
    # what neighbours share, such as a shape that differs, counts once
    variance = sum(float(part @ part) for part in parts) / max(alone, 1.0)
    # few independent samples: their scatter is itself uncertain
    wide = student.ppf(0.975, max(alone, 1.0)) / _TWO_SIDED
    variances = np.append(wide**2 * variance * np.diag(np.linalg.inv(fit.jac.T @ fit.jac)), [0.0])[
        :2
    ]
    return np.append(fit.x, [0.0])[:2], variances


@dataclass(frozen=True)
class ShiftLaw:
    """Shift factors as a function of temperature."""

    name: str  # ``WLF`` or ``Arrhenius``
    values: dict[str, float]  # C1 and C2 in K, or the activation energy in J/mol, by name
    intervals: dict[str, tuple[float, float] | None]  # 95 %; None where it is not determined
    error: float  # root-mean-square misfit of log10 a_T

    def log_shift(
        self, celsius: Float[np.ndarray, " n"], reference: float
    ) -> Float[np.ndarray, " n"]:
        """Return log10 a_T at temperatures in °C."""
        return _LAWS[self.name][0](celsius, reference, *self.values.values())


# log10 a_T at temperatures and a reference in °C, and the constants with values to start from
_LAWS = {
    "WLF": (
        lambda celsius, at, c1, c2: -c1 * (celsius - at) / (c2 + celsius - at),
        {"C1": 10.0, "C2_K": 100.0},
    ),
    "Arrhenius": (
        lambda celsius, at, energy: (
            energy / R / _DECADE * (1.0 / (celsius + 273.15) - 1.0 / (at + 273.15))
        ),
        {"activation_energy_J_mol": 5e4},
    ),
}


def _fit_law(name: str, celsius, log_shift, at: int) -> ShiftLaw | None:
    """Return a law of the shifts; None with too few temperatures. The reference has no shift."""
    law, start = _LAWS[name]
    others = np.arange(len(celsius)) != at
    if np.sum(others) <= len(start):
        return None
    reference = float(celsius[at])
    first = list(start.values())
    if name == "WLF":
        first[-1] = max(first[-1], 1.5 * (reference - float(celsius[0])))

    def of(temperatures, *free):
        return law(temperatures, reference, *free)

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
    return ShiftLaw(name, dict(zip(start, values.tolist(), strict=True)), intervals, rms(left))


@dataclass(frozen=True)
class Superposition:
    """Sweeps at several temperatures, moved to one."""

    reference: float  # in °C
    celsius: Float[np.ndarray, " n"]  # temperatures, increasing
    sweeps: Mapping[float, LinearSweep]  # as measured, by temperature
    log_shift: Float[np.ndarray, " n"]  # log10 of a_T
    log_vertical: Float[np.ndarray, " n"]  # log10 of b_T
    error: Float[np.ndarray, "n 2"]  # standard errors of both
    laws: tuple[ShiftLaw, ...]  # fitted to a_T; fewer where there are too few temperatures

    @cached_property
    def moved(self) -> dict[float, LinearSweep]:
        """The sweeps as they would be at the reference: ω a_T, G/b_T."""
        shifts = zip(self.celsius.tolist(), self.log_shift, self.log_vertical, strict=True)
        return {
            at: LinearSweep(one.angular_frequency * 10.0**a, *(one.measured / 10.0**b))
            for at, a, b in shifts
            for one in [self.sweeps[at]]
        }

    @cached_property
    def misfits(self) -> dict[tuple[float, float], float]:
        """Root-mean-square relative misfit of neighbours where they overlap."""
        found = {}
        for cold, warm in pairwise(self.moved):
            pair = _Pair(*(part for at in (cold, warm) for part in _logs(self.moved[at], "")))
            if len(rows := pair.inside(0.0)) >= _FEWEST:
                found[cold, warm] = float(_DECADE * rms(pair.off(0.0, rows)))
        return found

    @property
    def verdict(self) -> str:
        """``superposed``, ``doubtful`` or ``not_superposed``, by the worst overlap.

        Doubtful too where nothing overlaps: no misfit is not a small one.
        """
        worst = max(self.misfits.values(), default=0.0)
        if self.misfits and worst <= SUPERPOSED:
            return "superposed"
        return "doubtful" if worst < FAILED else "not_superposed"

    def factors(self, at: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return a_T and b_T at a temperature, each with its 95 % interval."""
        both = zip((self.log_shift[at], self.log_vertical[at]), self.error[at], strict=True)
        a, b = (
            tuple(float(10.0 ** (value + side * _TWO_SIDED * error)) for side in (0, -1, 1))
            for value, error in both
        )
        return a, b  # pyright: ignore[reportReturnType]

    def master(self) -> LinearSweep | None:
        """Return all moved sweeps as one; None where they do not become one."""
        if self.verdict == "not_superposed":
            return None
        omega = np.concatenate([one.angular_frequency for one in self.moved.values()])
        moduli = np.concatenate([one.measured for one in self.moved.values()], axis=1)
        order = np.argsort(omega, kind="stable")
        return LinearSweep(omega[order], *moduli[:, order])

    def table(self) -> pd.DataFrame:
        """Return temperatures, shift factors and misfits, as ``shift_factors.csv`` has them."""
        ends = ("", "_low95", "_high95")
        names = [f"{factor}{end}" for factor in ("a_T", "b_T") for end in ends]
        factors = [sum(self.factors(i), ()) for i in range(len(self.celsius))]
        table = pd.DataFrame(factors, columns=names)
        table.insert(0, "temperature_C", self.celsius)
        misfits = {cold: misfit for (cold, _), misfit in self.misfits.items()}
        return table.assign(misfit_to_next=[misfits.get(at) for at in self.celsius.tolist()])


def superpose(
    sweeps: Mapping[float, LinearSweep], reference: float | None = None, vertical: bool = False
) -> Superposition:
    """Return sweeps by temperature in °C, moved to one of them.

    `reference` in °C; the middle one if None. `vertical`: whether moduli too may be moved. Raises
    InputError if there is no sweep there, or neighbours share too few values.
    """
    every = sorted(sweeps)
    if len(every) < 2:
        raise InputError(
            f"Shifting needs sweeps at two temperatures; got {len(every)}. List more of them in "
            f"{TESTS_FILE} as tests lve, or widen --between."
        )
    reference = every[len(every) // 2] if reference is None else reference
    if reference not in every:
        listed = ", ".join(f"{t:g}" for t in every)
        raise InputError(f"There is no sweep at {reference:g} °C. Take one of {listed}.")
    laid = [
        lay_over(sweeps[cold], sweeps[warm], vertical, f"{cold:g} and {warm:g} °C")
        for cold, warm in pairwise(every)
    ]
    at = every.index(reference)
    total, variance = np.cumsum([(np.zeros(2), np.zeros(2)), *laid], axis=0).swapaxes(0, 1)
    log_a, log_b = (total - total[at]).T
    celsius = np.array(every)
    fitted = (_fit_law(name, celsius, log_a, at) for name in _LAWS)
    laws = tuple(law for law in fitted if law is not None)
    error = np.sqrt(np.abs(variance - variance[at]))
    return Superposition(reference, celsius, dict(sweeps), log_a, log_b, error, laws)
