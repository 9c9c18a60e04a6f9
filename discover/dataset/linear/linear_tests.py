"""Linear tests at several temperatures, the spectrum of one, and whether it predicts the others."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float
from scipy.optimize import nnls
from scipy.special import exprel

from discover.dataset.linear_viscoelasticity import (
    FLOOR,
    MOST_MODES,
    LinearSweep,
    RelaxationSpectrum,
    relaxation_spectrum,
)
from discover.dataset.load import SWEEP_FILE, TESTS_FILE, read_sweep
from discover.dataset.material_functions import read_over_time
from discover.dataset.tables import units
from discover.dataset.tables.table import read_table
from discover.errors import InputError, Problems
from discover.statistics.noise.noise_model import rms
from discover.words import did_you_mean

SWEEP, RELAXATION, CREEP = SWEEP_FILE.removesuffix(".csv"), "relaxation", "creep"

NAMES = {SWEEP: "sweep", RELAXATION: "relaxation modulus", CREEP: "creep compliance"}
"""What each test is called, by its word in ``tests.csv``."""
_COLUMNS = {
    SWEEP: ("omega_rad_s", "Gp_Pa", "Gpp_Pa"),
    RELAXATION: (units.TIME.column, "relaxation_modulus_Pa"),
    CREEP: (units.TIME.column, "compliance_1_Pa"),
}

# Averages of a table over time that are kept in each decade. Instruments write thousands of samples
# evenly in time, which would give the last decade all the weight
PER_DECADE = 20
_FEWEST = 4
# times the largest modulus that a compliance shows at once, of a compliance that fits without one:
# what is faster than its first sample it does not see
_STIFFEST = 1e3
_MARGINS = (0.0, 0.25, 0.5)  # decades by which relaxation times go beyond the samples
_TOLERANCE = 1.5  # how much worse than the best a spectrum may be, as a factor
# root-mean-square relative error up to which two linear tests agree: two loadings and two kinds of
# test rarely differ by less than some per cent
AGREES = 0.1

Values = Float[np.ndarray, " n"]


@dataclass(frozen=True)
class LinearTest:
    """A material function at one temperature."""

    kind: str  # ``lve``, ``relaxation`` or ``creep``
    argument: Values  # frequencies in rad/s or times in s, increasing
    values: Float[np.ndarray, "k n"]  # G′ and G″ or G(t) in Pa, or J(t) in 1/Pa
    # relative standard error of averages; zero where nothing was averaged
    spread: Values = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        if not len(self.spread):
            object.__setattr__(self, "spread", np.zeros(len(self.argument)))

    def __len__(self) -> int:
        return len(self.argument)

    @property
    def name(self) -> str:
        """What it is called."""
        return NAMES[self.kind]

    @property
    def sweep(self) -> LinearSweep:
        """As a sweep, which it has to be."""
        return LinearSweep(self.argument, *self.values)

    @property
    def times(self) -> Values:
        """Times in s, 1/ω of a sweep."""
        return 1.0 / self.argument if self.kind == SWEEP else self.argument

    def moved(self, log_shift: float, log_vertical: float) -> "LinearTest":
        """Return the test as at the reference: ω a_T, t/a_T, G/b_T, J b_T."""
        along, up = directions(self.kind)
        argument = self.argument * 10.0 ** (along * log_shift)
        return replace(self, argument=argument, values=self.values * 10.0 ** (up * log_vertical))

    def select(self, rows: np.ndarray) -> "LinearTest":
        """Return some of its samples."""
        return LinearTest(self.kind, self.argument[rows], self.values[:, rows], self.spread[rows])

    def to_dataframe(self) -> pd.DataFrame:
        """Return it in the columns of its file."""
        columns = (self.argument, *self.values)
        return pd.DataFrame(dict(zip(_COLUMNS[self.kind], columns, strict=True)))


Tests = Mapping[str, Mapping[float, LinearTest]]
"""Linear tests by kind and by temperature in °C."""


def directions(kind: str) -> tuple[int, int]:
    """Return the signs with which log a_T moves arguments and log b_T moves values."""
    return (1 if kind == SWEEP else -1), (1 if kind == CREEP else -1)


def of_sweep(sweep: LinearSweep) -> LinearTest:
    """Return a linear sweep as a linear test."""
    moduli = np.stack([sweep.storage_modulus, sweep.loss_modulus])
    return LinearTest(SWEEP, sweep.angular_frequency, moduli)


def over_time(kind: str, time: Values, values: Values) -> LinearTest:
    """Return a table over time, in Pa or 1/Pa, as a linear test of averages, even in log time.

    Their error is that of the scatter about the straight line through the logs of an interval.
    """
    x, y = np.log10(time), np.log10(values)
    interval = np.floor(PER_DECADE * (x - x[0])).astype(int)
    starts = np.flatnonzero(np.diff(interval, prepend=-1))
    rows = []
    for part_x, part_y in zip(np.split(x, starts[1:]), np.split(y, starts[1:]), strict=True):
        error, n = 0.0, len(part_x)
        if n > 3 and np.ptp(part_x) > 0.0:  # a line has two constants
            left = part_y - np.polyval(np.polyfit(part_x, part_y, 1), part_x)
            error = np.log(10.0) * float(np.sqrt(np.sum(left**2) / (n - 2) / n))
        rows.append((np.mean(part_x), np.mean(part_y), error))
    mean_x, mean_y, spread = np.array(rows).T
    return LinearTest(kind, 10.0**mean_x, 10.0 ** mean_y[None], spread)


def read_linear_tests(root: Path) -> dict[str, dict[float, LinearTest]]:
    """Return the linear tests of a folder by kind and temperature, as ``tests.csv`` lists them.

    Raises InputError if the list or a file is wrong, or no kind of test has two temperatures.
    """
    missing = "Tests at several temperatures are listed there; write one with the columns file, "
    table = read_table(root / TESTS_FILE, TESTS_FILE, missing + "test and temperature_C.")
    problems = Problems()
    for column in ("file", "test", "temperature_C"):
        if column not in table.columns:
            problems.add(
                f"{TESTS_FILE} has no column {column!r}; it has {table.listed}."
                f"{did_you_mean(column, table.columns)} Add it."
            )
    problems.require_none(TESTS_FILE)
    found: dict[str, dict[float, LinearTest]] = {}
    degrees = table.numbers("temperature_C")
    names, tests = table.columns["file"], table.columns["test"]
    for celsius, name, test in zip(degrees.tolist(), names, tests, strict=True):
        kind = test.strip()
        if kind not in NAMES:
            continue
        if Path(name).name != name:
            raise InputError(f"{TESTS_FILE} names {name!r}; put the file itself in the folder.")
        at = found.setdefault(kind, {})
        if celsius in at:
            raise InputError(
                f"{TESTS_FILE} has two tests {kind!r} at {celsius:g} °C; keep one of them."
            )
        path = root / name
        if kind == SWEEP:
            at[celsius] = of_sweep(read_sweep(path))
            continue
        time, values = read_over_time(path, kind)
        # from where it is lost in noise nothing is left to lay over anything
        end = int(np.argmin(np.append(values > 0.0, False)))
        if end < _FEWEST:
            raise InputError(
                f"{path.name} has {end} positive values before the first that is not; "
                f"{_FEWEST} are needed. Remove what is lost in noise, or the file."
            )
        at[celsius] = over_time(kind, time[:end], values[:end])
    if not any(len(at) > 1 for at in found.values()):
        raise InputError(
            f"{TESTS_FILE} lists no kind of linear test (lve, relaxation, creep) at two "
            "temperatures; shifting needs two."
        )
    return found


def spectrum_of(test: LinearTest) -> RelaxationSpectrum:
    """Return the modes of a linear test, the fewest that fit nearly as well as any."""
    if test.kind == SWEEP:
        return relaxation_spectrum(test.sweep)
    most = min(MOST_MODES, len(test) // 2)
    trials = [_modes(test, n, m) for n in range(1, most + 1) for m in _MARGINS[: 2 * n]]
    best = min(error for _, _, error in trials)
    errors: dict[int, float] = {}
    for modulus, _, error in trials:
        errors[len(modulus)] = min(error, errors.get(len(modulus), np.inf))
    within = [trial for trial in trials if trial[2] <= max(_TOLERANCE * best, FLOOR)]
    modulus, relaxation_time, error = min(within, key=lambda trial: (len(trial[0]), trial[2]))
    return RelaxationSpectrum(modulus, relaxation_time, error, best, dict(sorted(errors.items())))


def _modes(test: LinearTest, n: int, margin: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return moduli and times of so many modes, and the relative misfit of non-negative ones."""
    shortest, longest = test.argument[0] * 10.0**-margin, test.argument[-1] * 10.0**margin
    times = np.geomspace(shortest, longest, n) if n > 1 else np.sqrt([shortest * longest])
    t, values, in_creep = test.argument[:, None], test.values[0], test.kind == CREEP
    curves = np.exp(-t / times)
    if in_creep:
        curves = np.hstack([np.ones_like(t), t, -np.expm1(-t / times)])
    weight = FLOOR / np.hypot(FLOOR, test.spread)  # averages that scatter count less
    design = weight[:, None] * curves / values[:, None]
    scale = np.linalg.norm(design, axis=0)
    found, left = nnls(design / scale, weight, maxiter=100 * len(scale) + 100)
    found, error = found / scale, float(left / np.linalg.norm(weight))
    if not in_creep:
        return found[found > 0], times[found > 0], error
    instant = max(found[0], values.min() / _STIFFEST)
    modulus, time = modes_of_retardation(instant, found[1], found[2:], times)
    # of a solid some of the modulus never relaxes, and stays over all times measured
    return modulus, np.minimum(time, 1e6 * test.argument[-1]), error


def predicted(spectrum: RelaxationSpectrum, kind: str, argument: Values) -> np.ndarray:
    """Return what a spectrum says of a kind of test at frequencies in rad/s or times in s."""
    if kind == SWEEP:
        return np.stack(spectrum.moduli(argument))
    of = relaxation_modulus if kind == RELAXATION else creep_compliance
    return of(spectrum, argument)[None]


def relaxation_modulus(spectrum: RelaxationSpectrum, time: Values) -> Values:
    """Return G(t) = Σ G_k exp(−t/λ_k) in Pa at times in s; a solvent has none after t = 0."""
    return np.exp(-time[:, None] / spectrum.relaxation_time) @ spectrum.modulus


def creep_compliance(spectrum: RelaxationSpectrum, time: Values) -> Values:
    """Return J(t) in 1/Pa at times in s: the creep of Maxwell elements side by side.

    Under a unit stress s_k' = −s_k/λ_k + g_k Σ s_j/λ_j, g_k = G_k/ΣG; scaled by (g_k λ_k)^½ the
    matrix is symmetric, and its modes are those of retardation   [Ferry 1980, ch. 3].
    """
    total = float(np.sum(spectrum.modulus))
    share = np.sqrt(spectrum.modulus / total / spectrum.relaxation_time)
    rates, modes = np.linalg.eigh(np.outer(share, share) - np.diag(1 / spectrum.relaxation_time))
    weights = (share @ modes) ** 2
    # one rate is zero but for rounding
    growth = time[:, None] * exprel(np.minimum(rates, 0.0) * time[:, None])
    return (1.0 + growth @ weights) / total


def modes_of_retardation(
    instant: float, fluidity: float, compliance: Values, retardation_time: Values
) -> tuple[np.ndarray, np.ndarray]:
    """Return moduli in Pa and relaxation times in s of J(t) = J_g + Σ J_k (1 − exp(−t/τ_k)) + t/η.

    The inverse of `creep_compliance`: at a constant strain e_k' = J_k σ/τ_k − e_k/τ_k and e' = σ/η,
    where σ is what J_g leaves of it. `instant`, `compliance` in 1/Pa, `fluidity` in 1/(Pa s).
    """
    there = compliance > 0.0
    rates = 1.0 / retardation_time[there]
    share = np.sqrt(np.append(compliance[there] * rates, [fluidity] if fluidity > 0.0 else []))
    decay = np.append(rates, [0.0] if fluidity > 0.0 else [])
    if not len(share):
        return np.array([1.0 / instant]), np.array([np.inf])
    speeds, modes = np.linalg.eigh(np.diag(decay) + np.outer(share, share) / instant)
    moduli = (share @ modes) ** 2 / instant**2 / speeds
    order = np.argsort(1.0 / speeds)
    return moduli[order], (1.0 / speeds)[order]


@dataclass(frozen=True)
class Agreement:
    """How well the modes of one linear test predict another over the times that it reaches."""

    source: str  # the test that the modes come from: ``lve``, ``relaxation`` or ``creep``
    test: str  # the one predicted
    celsius: float  # temperature of both
    error: float  # root-mean-square relative error of the prediction
    bias: float  # mean relative error: a gain of one of the two shows here
    times: tuple[float, float]  # first and last in s, 1/ω for a sweep

    @property
    def left(self) -> float:
        """What would be left of the error, were the prediction divided by one factor."""
        return float(np.sqrt(max(self.error**2 - self.bias**2, 0.0)) / (1.0 + self.bias))

    @property
    def agrees(self) -> bool:
        """Whether the error is up to `AGREES`."""
        return self.error <= AGREES


def linear_agreements(tests: Tests) -> list[Agreement]:
    """How well the modes of each test predict each other test, over the times both reach."""
    spectra: dict[tuple[str, float], RelaxationSpectrum | None] = {}
    found = []
    slack = 1.0 + 1e-9  # of 1/ω
    pairs = [(a, b) for a in tests for b in tests if a != b]
    both = ((a, b, t) for a, b in pairs for t in sorted(set(tests[a]) & set(tests[b])))
    for source, test, celsius in both:
        one, other = tests[source][celsius], tests[test][celsius]
        reached, times = one.times, other.times
        inside = (times >= reached.min() / slack) & (times <= reached.max() * slack)
        if np.sum(inside) < _FEWEST:
            continue
        if (source, celsius) not in spectra:
            spectra[source, celsius] = None
            with suppress(InputError):  # too few samples, or moduli that no modes have
                spectra[source, celsius] = spectrum_of(one)
        if (spectrum := spectra[source, celsius]) is None:
            continue
        made = predicted(spectrum, test, other.argument[inside])
        error, seen = made / other.values[:, inside] - 1.0, times[inside]
        ends = float(seen.min()), float(seen.max())
        found.append(Agreement(source, test, celsius, rms(error), float(np.mean(error)), ends))
    return found
