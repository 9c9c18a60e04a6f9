"""Relaxation modes, solvent viscosity and elastic constant that a linear sweep supports."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares, nnls

# Decades beyond the window in which a mode may lie. Further out it is a solvent or an elastic
# constant: at a decade its curvature is 1 % of its modulus
BEYOND = 1.0
# Relative error of a modulus below which no fit is better than another: that of sound rheometers in
# repeated sweeps, and of digits in exported files
REPEATABILITY = 0.002
_PER_DECADE = 12
_ROUGHLY, CLOSELY = (1e-6, 20), (1e-12, 200)  # tolerance and most evaluations of a fit
_LONGEST = 1e12


@dataclass(frozen=True)
class ModeFit:
    """Least-squares fit of modes, a solvent and an elastic constant to a sweep."""

    relaxation_time: Float[np.ndarray, " k"]  # in s, increasing
    # moduli in Pa, then the viscosity of a solvent in Pa s and an elastic constant in Pa, if fitted
    amounts: Float[np.ndarray, " c"]
    kinds: tuple[bool, bool]  # whether these two are
    squared: float  # sum of the squared relative misfits of G′ and G″

    @property
    def n_modes(self) -> int:
        """Number of modes, that of an elastic constant included."""
        return len(self.relaxation_time) + self.kinds[1]


def relative_moduli(
    frequency: Float[np.ndarray, " n"], measured: Float[np.ndarray, "2 n"],
    times: Float[np.ndarray, " k"], solvent: bool = False, elastic: bool = False,
) -> Float[np.ndarray, "rows c"]:  # fmt: skip
    """G′ and G″ over those measured of modes (1 Pa), solvent (1 Pa s) and constant (1 Pa)."""
    x, zero = frequency[:, None] * times, np.zeros_like(frequency)
    storage, loss = measured
    columns = [
        np.concatenate([x**2 / (1 + x**2) / storage[:, None], x / (1 + x**2) / loss[:, None]])
    ]
    if solvent:
        columns.append(np.concatenate([zero, frequency / loss])[:, None])
    if elastic:
        columns.append(np.concatenate([1.0 / storage, zero])[:, None])
    return np.hstack(columns)


@dataclass(frozen=True)
class ModeSearch:
    """Search for modes: those of non-negative least squares on a grid, fitted, merged and left out.

    [Lawson & Hanson 1974]
    """

    frequency: Float[np.ndarray, " n"]  # in rad/s
    measured: Float[np.ndarray, "2 n"]  # G′ and G″ in Pa
    # known beforehand, always fitted, or, with None, only where evidence asks for it
    solvent_viscosity: float | Literal["fit"] | None = None
    elastic_modulus: float | Literal["fit"] | None = None

    @property
    def bounds(self) -> tuple[float, float]:
        """Shortest and longest time in s that a mode may have."""
        margin = 10.0**BEYOND
        return 1.0 / margin / self.frequency.max(), margin / self.frequency.min()

    @cached_property
    def _target(self) -> Float[np.ndarray, " rows"]:
        """What the fitted constants have to give: one, less what known ones give."""
        asked = self.solvent_viscosity, self.elastic_modulus
        held = [0.0 if isinstance(v, str) or v is None else v for v in asked]
        return 1.0 - self._design(np.zeros(0), True, True) @ np.array(held)

    def fits(self, fewest: int = 0) -> Iterator[ModeFit]:
        """Yield fits of so many modes and more, with and without solvent and elastic constant."""
        choices = [
            (True,) if value == "fit" else (False, True) if value is None else (False,)
            for value in (self.solvent_viscosity, self.elastic_modulus)
        ]
        for solvent, elastic in product(*choices):
            yield from self._path(solvent, elastic, fewest)

    def elastic_time(self, fit: ModeFit) -> float:
        """Shortest time in s of a mode that raises the misfit by one standard deviation at most."""
        solvent, target = fit.kinds[0], self._target
        if not isinstance(self.elastic_modulus, str) and self.elastic_modulus is not None:
            column = self._design(np.zeros(0), False, True)[:, 0]
            target = target + column * self.elastic_modulus
        allowed = fit.squared + self._variance(fit)
        times = np.geomspace(1.0, _LONGEST, 4 * int(np.log10(_LONGEST)) + 1) / self.frequency.min()
        for time in times:
            modes = np.append(fit.relaxation_time, time)
            if solved(self._design(modes, solvent, False), target)[1] <= allowed:
                return float(time)
        return float(times[-1])

    def _variance(self, fit: ModeFit) -> float:
        n_constants = len(fit.relaxation_time) + len(fit.amounts)
        return fit.squared / max(self.measured.size - n_constants, 1) + REPEATABILITY**2

    def _design(self, times, solvent: bool, elastic: bool) -> Float[np.ndarray, "rows c"]:
        return relative_moduli(self.frequency, self.measured, times, solvent, elastic)

    def _path(self, solvent: bool, elastic: bool, fewest: int) -> Iterator[ModeFit]:
        low, high = self.bounds
        grid = np.geomspace(low, high, int(np.log10(high / low) * _PER_DECADE) + 1)
        amounts, _ = solved(self._design(grid, solvent, elastic), self._target)
        times = self._merged(grid, amounts[: len(grid)])
        while len(times) + elastic < fewest:
            # one more, in the middle of the widest gap
            places = np.concatenate([[low], times, [high]])
            widest = int(np.argmax(np.diff(np.log(places))))
            times = np.insert(times, widest, np.sqrt(places[widest] * places[widest + 1]))
        most = max((len(self.frequency) - solvent - elastic) // 2, fewest - elastic, 1)
        least = max(fewest - elastic, 0 if elastic else 1)
        while True:
            amounts, squared = solved(self._design(times, solvent, elastic), self._target)
            fit = ModeFit(np.sort(times), amounts, (solvent, elastic), squared)
            if len(times) <= most:
                fit = self.fitted(fit, _ROUGHLY)
                if np.all(fit.amounts > 0.0):
                    yield fit
            if len(times) <= least:
                return
            times = self._with_one_less(fit)

    def _merged(self, grid: np.ndarray, modulus: np.ndarray) -> np.ndarray:
        """Return times of modes; neighbours on the grid stand for one between them."""
        there = np.flatnonzero(modulus > 0.0)
        if not len(there):
            return np.array([np.sqrt(self.bounds[0] * self.bounds[1])])
        parts = np.split(there, np.flatnonzero(np.diff(there) > 1) + 1)
        return np.array([_mean(grid[part], modulus[part]) for part in parts])

    def _with_one_less(self, fit: ModeFit) -> np.ndarray:
        times = fit.relaxation_time
        trials = [np.delete(times, i) for i in range(len(times))]
        for i in range(len(times) - 1):
            between = _mean(times[i : i + 2], fit.amounts[i : i + 2])
            trials.append(np.concatenate([times[:i], [between], times[i + 2 :]]))
        costs = [
            solved(self._design(t, *fit.kinds), self._target)[1] if len(t) or any(fit.kinds)
            else np.inf
            for t in trials
        ]  # fmt: skip
        return trials[int(np.argmin(costs))]

    def fitted(self, fit: ModeFit, limits: tuple[float, int]) -> ModeFit:
        """Return the fit with the relaxation times fitted jointly, in logarithms."""
        tolerance, evaluations = limits
        k, kinds = len(fit.relaxation_time), fit.kinds
        if not k:
            return fit
        low, high = np.log(self.bounds)
        amounts = np.maximum(fit.amounts, 1e-6 * np.max(fit.amounts[:k], initial=1e-300))

        def misfit(logs: np.ndarray) -> np.ndarray:
            times = np.exp(np.clip(logs[:k], low, high))
            return self._design(times, *kinds) @ np.exp(logs[k:]) - self._target

        def slopes(logs: np.ndarray) -> np.ndarray:
            times, amounts = np.exp(np.clip(logs[:k], low, high)), np.exp(logs[k:])
            x = self.frequency[:, None] * times
            storage = 2 * x**2 / (1 + x**2) ** 2 / self.measured[0][:, None]
            loss = x * (1 - x**2) / (1 + x**2) ** 2 / self.measured[1][:, None]
            inside = (logs[:k] > low) & (logs[:k] < high)
            per_time = np.where(inside, np.concatenate([storage, loss]) * amounts[:k], 0.0)
            return np.hstack([per_time, self._design(times, *kinds) * amounts])

        start = np.log(np.concatenate([fit.relaxation_time, amounts]))
        with np.errstate(over="ignore", invalid="ignore"):
            ends = dict.fromkeys(("ftol", "xtol", "gtol"), tolerance)
            options: dict[str, Any] = {"jac": slopes, "method": "lm", "max_nfev": evaluations}
            end = least_squares(misfit, start, **ends, **options).x
        if not np.all(np.isfinite(misfit(end))):
            return fit
        times, amounts = np.exp(np.clip(end[:k], low, high)), np.exp(end[k:])
        order = np.argsort(times)
        amounts = np.append(amounts[:k][order], amounts[k:])
        return ModeFit(times[order], amounts, kinds, float(np.sum(misfit(end) ** 2)))

    def criterion(self, fit: ModeFit) -> float:
        """Return twice the negative log evidence   [Schwarz 1978, Ann. Stat. 6, 461].

        Solvent and constant have an even prior from 0 to the smallest G″/ω and G′.
        """
        count = self.measured.size
        variance = self._variance(fit)
        total = count * np.log(variance) + 2 * len(fit.relaxation_time) * np.log(count)
        if not any(fit.kinds):
            return float(total)
        design = self._design(fit.relaxation_time, *fit.kinds)
        scale = np.linalg.norm(design, axis=0)
        inverse = np.linalg.pinv((design / scale).T @ (design / scale), hermitian=True)
        errors = np.sqrt(variance * np.diag(inverse)) / scale
        room = np.array([np.min(self.measured[1] / self.frequency), np.min(self.measured[0])])
        share = room[np.array(fit.kinds)] / (np.sqrt(2 * np.pi) * errors[-sum(fit.kinds) :])
        return float(total + np.sum(np.maximum(2.0 * np.log(share), np.log(count))))


def _mean(times: np.ndarray, weights: np.ndarray) -> float:
    weights = weights if np.sum(weights) > 0.0 else np.ones_like(times)
    return float(np.exp(np.average(np.log(times), weights=weights)))


def solved(design: np.ndarray, target: np.ndarray) -> tuple[np.ndarray, float]:
    """Return coefficients of non-negative least squares, and the squared misfit."""
    scale = np.linalg.norm(design, axis=0)  # columns of similar size: moduli may span many decades
    scale = np.where(scale > 0.0, scale, 1.0)
    found, left = nnls(design / scale, target, maxiter=100 * design.shape[1] + 100)
    return found / scale, float(left**2)
