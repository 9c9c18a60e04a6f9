"""Time–temperature superposition: tests at several temperatures as one, and how well that holds.

Neighbouring tests are laid over each other by log a_T, and log b_T if asked for, that make the logs
of their values agree best; shifts add up from the reference temperature [Ferry 1980, ch. 11].
Sweeps lead where there are sweeps: they see the temperature in two curves.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.constants import R
from scipy.optimize import curve_fit
from scipy.stats import norm
from scipy.stats import t as student

from discover.dataset.linear.linear_tests import SWEEP, LinearTest, Tests, of_sweep
from discover.dataset.linear.overlap import lay_over, overlap_misfit
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.errors import InputError
from discover.statistics.noise.noise_model import rms


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
            energy / R / np.log(10.0) * (1.0 / (celsius + 273.15) - 1.0 / (at + 273.15))
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


# root-mean-square relative misfit in an overlap up to which tests superpose, about what two
# loadings of one sample differ by, and from which on they do not
SUPERPOSED, FAILED = 0.05, 0.1
_TWO_SIDED = float(norm.ppf(0.975))


@dataclass(frozen=True)
class Superposition:
    """Tests at several temperatures, moved to one."""

    reference: float  # in °C
    celsius: Float[np.ndarray, " n"]  # temperatures, increasing
    tests: Tests  # as measured, by kind and temperature
    leading: tuple[str, ...]  # the kinds that the shifts were found from
    log_shift: Float[np.ndarray, " n"]  # log10 of a_T
    log_vertical: Float[np.ndarray, " n"]  # log10 of b_T
    error: Float[np.ndarray, "n 2"]  # standard errors of both
    laws: tuple[ShiftLaw, ...]  # fitted to a_T; fewer where there are too few temperatures
    apart: tuple[float, ...] = ()  # temperatures that share no kind with the others, not moved

    def moved(self, kind: str, celsius: float) -> LinearTest:
        """Return the test at a temperature as it would be at the reference."""
        at = int(np.flatnonzero(self.celsius == celsius)[0])
        return self.tests[kind][celsius].moved(
            float(self.log_shift[at]), float(self.log_vertical[at])
        )

    def _all_moved(self, kind: str) -> dict[float, LinearTest]:
        there = sorted(set(self.tests.get(kind, ())) & set(self.celsius.tolist()))
        return {celsius: self.moved(kind, celsius) for celsius in there}

    def misfits(self, kind: str) -> dict[tuple[float, float], float]:
        """Return the root-mean-square relative misfit of neighbours where they overlap."""
        moved = self._all_moved(kind)
        found = {(a, b): overlap_misfit(moved[a], moved[b]) for a, b in pairwise(moved)}
        return {pair: misfit for pair, misfit in found.items() if misfit is not None}

    def verdict_of(self, kind: str) -> str:
        """``superposed``, ``doubtful`` or ``not_superposed``, by the worst overlap of a kind.

        Doubtful too where nothing overlaps: no misfit is not a small one.
        """
        misfits = self.misfits(kind)
        worst = max(misfits.values(), default=0.0)
        if misfits and worst <= SUPERPOSED:
            return "superposed"
        return "doubtful" if worst < FAILED else "not_superposed"

    @property
    def verdict(self) -> str:
        """The worst verdict of the kinds that the shifts were found from."""
        ranked = ("not_superposed", "doubtful", "superposed")
        return min((self.verdict_of(kind) for kind in self.leading), key=ranked.index)

    def factors(self, at: int) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return a_T and b_T at a temperature, each with its 95 % interval."""
        both = zip((self.log_shift[at], self.log_vertical[at]), self.error[at], strict=True)
        a, b = (
            tuple(float(10.0 ** (value + side * _TWO_SIDED * error)) for side in (0, -1, 1))
            for value, error in both
        )
        return a, b  # pyright: ignore[reportReturnType]

    def master(self, kind: str) -> LinearTest | None:
        """Return all moved tests of a kind as one; None where they do not become one."""
        moved = list(self._all_moved(kind).values())
        if not moved or "not_superposed" in (self.verdict, self.verdict_of(kind)):
            return None
        argument = np.concatenate([one.argument for one in moved])
        order = np.argsort(argument, kind="stable")
        if kind != SWEEP:  # a table over time has no time twice
            order = order[np.diff(argument[order], prepend=0.0) > 0.0]
        values = np.concatenate([one.values for one in moved], axis=1)
        spread = np.concatenate([one.spread for one in moved])
        return LinearTest(kind, argument, values, spread).select(order)


def superpose(
    tests: Tests | Mapping[float, LinearSweep],
    reference: float | None = None,
    vertical: bool = False,
) -> Superposition:
    """Return tests by kind and temperature, or sweeps by temperature, moved to one of them.

    `reference` in °C; the middle one if None. `vertical`: whether moduli and compliances too may be
    moved. Raises InputError if there is no test there, or neighbours share too few values.
    """
    sweeps = {t: of_sweep(one) for t, one in tests.items() if isinstance(one, LinearSweep)}
    known: Tests = {SWEEP: sweeps} if sweeps else tests  # pyright: ignore[reportAssignmentType]
    several = {kind: at for kind, at in known.items() if len(at) > 1}
    if not several:
        raise InputError("Shifting needs tests of one kind at two temperatures; got none.")
    main = several.get(SWEEP) or next(iter(several.values()))
    middle = sorted(main)[len(main) // 2]
    reference = middle if reference is None else reference
    every = sorted({celsius for at in known.values() for celsius in at})
    if reference not in every:
        listed = ", ".join(f"{t:g}" for t in every)
        raise InputError(f"There is no test at {reference:g} °C. Take one of {listed}.")
    found, leading = _walk(several, reference, vertical)
    celsius = np.array(sorted(found))
    shifts = np.array([found[t][0] for t in celsius])
    errors = np.sqrt([np.diag(found[t][1]) for t in celsius])
    at = int(np.flatnonzero(celsius == reference)[0])
    fitted = (_fit_law(name, celsius, shifts[:, 0], at) for name in _LAWS)
    laws = tuple(law for law in fitted if law is not None)
    apart = tuple(t for t in every if t not in found)
    log_a, log_b = shifts.T
    return Superposition(reference, celsius, known, leading, log_a, log_b, errors, laws, apart)


def _walk(several: Tests, reference: float, vertical: bool):
    """Return the sum of shifts and of their covariances by temperature, and the leading kinds.

    From the reference on, the next temperature is one that a sweep ties to those reached, then one
    that any other test does, the nearest first.
    """
    reached = {reference: (np.zeros(2), np.zeros((2, 2)))}
    leading: dict[str, None] = {}
    links = [
        (kind != SWEEP, warm - cold, cold, warm)
        for kind, at in several.items()
        for cold, warm in pairwise(sorted(at))
    ]
    while open_ := [link for link in links if (link[2] in reached) != (link[3] in reached)]:
        table, _, cold, warm = min(open_)
        kinds = [k for k in several if (k != SWEEP) == table and {cold, warm} <= set(several[k])]
        leading.update(dict.fromkeys(kinds))
        below, above = ({kind: several[kind][t] for kind in kinds} for t in (cold, warm))
        laid = lay_over(below, above, vertical, f"{cold:g} and {warm:g} °C")
        start, end, sign = (cold, warm, 1.0) if cold in reached else (warm, cold, -1.0)
        shift, covariance = reached[start]
        reached[end] = (shift + sign * laid.shift, covariance + laid.covariance)
    return reached, tuple(leading)


def shift_table(found: Superposition) -> str:
    """Return temperatures, shift factors and misfits as the text of ``shift_factors.csv``."""
    head = ["temperature_C", "a_T", "a_T_low95", "a_T_high95", "b_T", "b_T_low95", "b_T_high95"]
    misfits = {kind: found.misfits(kind) for kind in found.tests}
    names = ["misfit_to_next" if kind == SWEEP else f"{kind}_misfit_to_next" for kind in misfits]
    rows = [[*head, *names]]
    for i, degrees in enumerate(found.celsius):
        off = [
            next((f"{m:.4g}" for (cold, _), m in pairs.items() if cold == degrees), "")
            for pairs in misfits.values()
        ]
        numbers = [repr(value) for factor in found.factors(i) for value in factor]
        rows.append([f"{degrees:g}", *numbers, *off])
    return "\n".join(",".join(row) for row in rows) + "\n"


def move_tests(
    tests: Tests, reference: float | None, vertical: bool, between: tuple[float, float] | None
) -> Superposition:
    """Return tests between two temperatures in °C moved to one."""
    if between is not None:
        low, high = min(between), max(between)
        chosen = {k: {t: one for t, one in at.items() if low <= t <= high}
                  for k, at in tests.items()}  # fmt: skip
        tests = {kind: at for kind, at in chosen.items() if at}
    return superpose(tests, reference, vertical)
