"""Predictions of a posterior in any run: mixtures over hypotheses with their 95 % bands."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import ndtr, ndtri

from discover.effects import ConstitutiveEffect
from discover.inference.fit import Fit
from discover.inference.left_out import MOST_MISSED, next_run_factor
from discover.inference.noise import deviation
from discover.inference.problem import NUISANCES
from discover.inference.rows import Rows
from discover.inference.variables import SLIP_CURVE, Variable
from discover.inference.with_function import WithFunction
from discover.statistics.noise_model import rms

_RUNS_AWAY = 10.0
"""Times the largest stress recorded, or predicted as declared, which no sound law exceeds."""

_LEAST = 1e-3
"""Weight below which a hypothesis changes no band."""

LOST = 0.5
"""Weight of hypotheses that may diverge in a run in which the others still make a band."""

_POWERS = np.array([1.0, 2.0, 2.0])
"""Powers of the shear stress with which σ12, N1 and N2 go   [second-order fluid: Bird, Armstrong &
Hassager 1987, ch. 6], and so their relative errors."""

_UNRELATED = np.array([0.0, 2.0, 0.0]), np.array([0.0, 0.05, 0.0])
"""Relative errors that a law has in N1 besides, for what relates N1 to σ12 is not known either:
over the error of σ12, and at least. On development seeds laws of no library that others fit to the
noise have N1 off by 4 to 13 %."""

SIMPLE_FLUIDS = -2.0 / 7.0
"""Least N2/N1 of a simple fluid   [Doi & Edwards 1986, The Theory of Polymer Dynamics, ch. 7: −2/7
at small strain with independent alignment; measured ratios lie between that and zero]."""

Laws = Sequence[tuple[Fit, float]]
"""Hypotheses with weights that add up to one."""


@dataclass(frozen=True)
class Band:
    """A prediction of one run with its 95 % band: what is recorded, N1 and N2, shape (n, 3)."""

    middle: Float[np.ndarray, "n 3"]
    low: Float[np.ndarray, "n 3"]
    high: Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Part:
    """What one hypothesis predicts of rows, and in which runs it does not run away."""

    weight: float
    middle: Float[np.ndarray, "rows 3"]
    variance: Float[np.ndarray, "rows 3"]
    sound: Bool[np.ndarray, " runs"]


class Predictions:
    """What a posterior predicts of runs: a normal distribution for each hypothesis.

    `posterior`, `rows`: the posterior, and the runs to predict. `as_recorded`: as the bench reads
    them, or of the fluid alone. `noise`: whether with the noise of the fitted runs.
    """

    def __init__(self, posterior: Any, rows: Rows, as_recorded: bool = True, noise: bool = False):
        self.posterior, self.rows = posterior, rows
        self.as_recorded, self.noise = as_recorded, noise
        self.problem = posterior.problem
        known = np.nan_to_num(np.abs(self._observed([self.problem.zero])[0, :, 0]), posinf=0.0)
        largest = np.full(len(rows.runs), np.max(np.abs(self.problem.fitted.recorded)))
        np.maximum.at(largest, rows.run, known)
        self._limit = _RUNS_AWAY * largest

    def bands(self, of_none: Laws) -> list[Band | None]:
        """Return the band of each run; None where most hypotheses run away.

        Hypotheses are weighed by their evidence. `of_none`: those to rely on where none is all
        there is: every stress is then missed as runs left out are, more beyond the fastest rate,
        and N2 is as likely anything from −2/7 N1 to zero.
        """
        parts = [*self._of_fits, *self.of_laws(of_none, self.posterior.unexplained, True)]
        return [self._band(parts, i) for i in range(len(self.rows.runs))]

    @cached_property
    def _of_fits(self) -> list[Part]:
        return self.of_laws(self.posterior.fits, 1.0 - self.posterior.unexplained)

    def of_laws(self, laws: Laws, share: float = 1.0, are_none: bool = False) -> list[Part]:
        """Return what laws predict, those of any weight; two of one that leaves N2 open.

        `share`: of all of them. `are_none`: whether none of them is all there is.
        """
        likely = ((f, share * p) for f, p in laws if f.covariance is not None)
        some = [(f, weight) for f, weight in likely if weight > _LEAST]
        return [part for fit, weight in some for part in self._parts(fit, weight, are_none)]

    def followed(self, fits: Sequence[Fit]) -> list[Fit]:
        """Return those of some hypotheses that run away in none of the runs."""
        sound = self._is_sound(self._observed([fit.theta for fit in fits])[..., 0])
        return [fit for fit, one in zip(fits, sound, strict=True) if np.all(one)]

    def _observed(self, thetas: Any, moduli: Any = None) -> np.ndarray:
        """Return the rows of what is recorded, N1 and N2 by vectors, shape (vectors, rows, 3)."""
        with np.errstate(all="ignore"):
            found = self.problem.model.observables(thetas, self.rows.batch, moduli)
        return np.asarray(found)[:, self.rows.seen]

    def _is_sound(self, record: Float[np.ndarray, "draws rows"]) -> Bool[np.ndarray, "draws runs"]:
        """Return in which runs each of some records does not run away."""
        with np.errstate(invalid="ignore"):
            fine = np.abs(record) < self._limit[self.rows.run]
        runs = range(len(self.rows.runs))
        return np.stack([np.all(fine[:, self.rows.run == i], axis=1) for i in runs], axis=1)

    @property
    def _of_bench(self) -> list[int]:
        """Positions of constants of the instrument, of the clock too where it is not fitted."""
        effects, model = self.problem.effects, self.problem.model
        names = {n for n, e in effects.items() if not isinstance(e, ConstitutiveEffect)}
        names |= {SLIP_CURVE.name, *(nuisance.effect for nuisance in NUISANCES)}
        at = [place for name in names for place in model.positions(name)]
        return at if 1 in self.problem.declared.free_positions else [1, *at]

    def _parts(self, fit: Fit, weight: float, is_none: bool) -> list[Part]:
        """Return what a hypothesis predicts; two where N2 may be as it says, or anything."""
        weights, thetas, moduli, linear = moved(self.posterior, fit)
        if not self.as_recorded:
            thetas[:, self._of_bench] = self.problem.zero[self._of_bench]
        # what is linear in the records moves no prediction of the model
        own, place = distinct(np.column_stack([thetas, moduli]))
        values = self._observed(thetas[own], moduli[own])[place]
        sound = self._is_sound(values[..., 0])
        fitter = self.posterior.fitter_of(fit)
        if isinstance(fitter, WithFunction) and fitter.variable.slot == "network":
            function = fitter.variable.at(self.rows)
            first = 1 if self.as_recorded else 0  # the record has it among what is linear
            values[..., first:] *= _factor(function, linear)[..., None]
        apart: Any = 0.0
        if self.as_recorded:
            values[..., 0], apart = self._read(fitter, values[..., 0], fit, linear)
        middle, off = values[0], values[1:] - values[0]
        ways = np.nan_to_num(np.where(sound[1:, self.rows.run, None], off, 0.0))
        variance = np.tensordot(weights, ways**2, axes=1)
        size = self._sizes(middle)
        variance[:, 0] += apart
        if self.noise:
            noise = fit.noise.common * deviation(size[:, 0], middle[:, 0], fit.noise.share)
            variance[:, 0] += noise**2
        if is_none:
            missed, (share, least) = self._missed(fit)[:, None], _UNRELATED
            off = (missed * _POWERS) ** 2 + np.maximum(missed * share, least) ** 2
            variance = variance + off * size**2
        found = Part(weight, middle, variance, sound[0])
        if not (is_none or self.problem.leaves_second_difference_open(fit.names)):
            return [found]
        prior, wide = middle.copy(), variance.copy()
        prior[:, 2] = 0.5 * SIMPLE_FLUIDS * middle[:, 1]
        wide[:, 2] += (SIMPLE_FLUIDS * middle[:, 1]) ** 2 / 12.0
        halves = (middle, variance), (prior, wide)
        return [Part(0.5 * weight, *half, sound[0]) for half in halves]

    def _read(
        self,
        fitter: Any,
        record: Float[np.ndarray, "draws rows"],
        fit: Fit,
        linear: Float[np.ndarray, "draws q"],
    ) -> tuple[Float[np.ndarray, "draws rows"], Float[np.ndarray, " rows"]]:
        """Return records as the bench reads them, and the variance of what is not known.

        Zero, drift and loading of a run that was fitted are its own; those of another are as large.
        """
        assert fit.covariance is not None
        fitted, errors = fitter.errors, fitter.errors_of(self.rows)
        variances = np.diag(fit.covariance)[len(fit.priors) :]
        with np.errstate(all="ignore"):  # a law that runs away
            apart = errors.unshared_variance(record[0], fit.linear, variances, fitted)
            nothing = np.zeros((len(self.rows), 0))  # moduli were moved themselves
            found = errors.recorded(record, errors.like(fitted, linear), nothing)
        return found, np.where(errors.places_in(fitted)[self.rows.run] >= 0, 0.0, apart)

    def _sizes(self, middle: Float[np.ndarray, "rows 3"]) -> Float[np.ndarray, "rows 3"]:
        """Return the size of each stress, N2's by N1: of a curve each value, else of the run."""
        of_runs = np.column_stack([self.rows.rms_by_run(one)[self.rows.run] for one in middle.T])
        found = np.where(self.rows.alone[:, None], np.abs(middle), of_runs)
        found[:, 2] = -SIMPLE_FLUIDS * found[:, 1]
        return found

    def _missed(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return the deviation, over its size, by which rows may be missed, from runs left out.

        Of a hypothesis that was not fitted without each run, that of the best, and more by as much
        as it misses the fitted runs by more.
        """
        posterior, best = self.posterior, fit
        if "missed" not in fit.memory and not posterior.has_function(fit) and posterior.left:
            best = posterior.left.fit
        missed, fastest = posterior.missed(best), np.max(self.problem.fitted.fastest)
        worse = 1.0
        if best is not fit:
            own, least = (posterior.fitter_of(one).misfit(one) for one in (fit, best))
            worse = max(own / max(least, 1e-150), 1.0)
        size = next_run_factor(len(missed)) * rms(missed) * worse
        beyond = np.maximum(self.rows.fastest / fastest, 1.0)
        return np.minimum(size * beyond, MOST_MISSED)[self.rows.run]

    def _band(self, parts: Sequence[Part], run: int) -> Band | None:
        """Return the mixture in one run of the hypotheses that can be followed there."""
        at, some = self.rows.run == run, [part for part in parts if part.sound[run]]
        kept, total = (sum(part.weight for part in one) for one in (some, parts))
        if not some or kept < LOST * total:
            return None
        middles = np.array([part.middle[at].ravel() for part in some])
        variances = np.array([part.variance[at].ravel() for part in some])
        told = np.all(np.isfinite(middles) & np.isfinite(variances), axis=0)
        limits = np.full((3, middles.shape[1]), np.nan)
        weights = np.array([part.weight for part in some])
        limits[:, told] = quantiles(
            weights, middles[:, told], variances[:, told], (0.025, 0.5, 0.975)
        )
        low, middle, high = limits.reshape(3, -1, 3)
        return Band(middle, low, high)


def moved(posterior: Any, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return weights of `credible_steps`, and constants, moduli, what is linear: before, by each.

    Weighted squares of what the steps change add up to a variance.
    """
    steps, weights = credible_steps(posterior.fitter_of(fit), fit)
    thetas, linear = fit.drawn(np.concatenate([0.0 * steps[:1], steps]))
    return weights, thetas, posterior.search.fitter.moduli_of(linear), linear


def credible_steps(
    fitter: Any, fit: Fit
) -> tuple[Float[np.ndarray, "steps n"], Float[np.ndarray, " steps"]]:
    """Return steps along each independent direction of what is uncertain, and their weights.

    Of one standard deviation by Laplace's method, or as far as the fitted runs then change by one
    of their noise: a constant that they do not tell at its likeliest value, they may tell far off.
    Both ways along what moves constants, half each, and one way along what is linear alone.
    """
    if "steps" not in fit.memory:
        assert fit.covariance is not None
        n, free = len(fit.covariance), len(fit.priors)
        steps = np.concatenate([np.eye(n), -np.eye(n)[:free]])
        thetas, linear = fit.drawn(steps)
        own, place = distinct(np.concatenate([fit.theta[None], thetas]))
        predicted = fitter.predict(np.concatenate([fit.theta[None], thetas])[own])[place[1:]]
        record = fitter.record(fit)
        with np.errstate(all="ignore"):  # a law that runs away
            off = (fitter.records(fit, predicted, linear) - record).T
            white = fitter.noise.whitened(off, record, fit.noise)
            far = np.nan_to_num(np.sqrt(np.sum(white**2, axis=0)), nan=_FAR, posinf=_FAR)
        both = np.any(steps[:, :free], axis=1)
        fit.memory["steps"] = steps / np.maximum(far, 1.0)[:, None], np.where(both, 0.5, 1.0)
    return fit.memory["steps"]


_FAR = 10.0
"""Standard deviations that a step is taken for along which the law runs away."""


def distinct(vectors: Float[np.ndarray, "trials m"]) -> tuple[np.ndarray, np.ndarray]:
    """Return which vectors differ from the first, that itself too, and the place of each there."""
    own = np.append(True, np.any(vectors[1:] != vectors[0], axis=1))
    return own, np.where(own, np.cumsum(own) - 1, 0)


def _factor(
    function: Variable, linear: Float[np.ndarray, "draws q"]
) -> Float[np.ndarray, "draws rows"]:
    """Return a factor on all stresses that depends on the strain: it is of the fluid.

    The damping function of Wagner 1976, Rheol. Acta 15, 136.
    """
    assert function.values is not None
    return 1.0 + linear[:, -function.count :] @ function.basis(function.values).T


def quantiles(
    weights: Float[np.ndarray, " parts"],
    middle: Float[np.ndarray, "parts n"],
    variance: Float[np.ndarray, "parts n"],
    probabilities: Sequence[float],
) -> list[Float[np.ndarray, " n"]]:
    """Return quantiles of mixtures of normal distributions, by bisection."""
    weights = weights / np.sum(weights)
    spread = np.sqrt(np.maximum(variance, 1e-300))
    out = []
    for probability in probabilities:
        # between those of the distributions that are mixed, a billion times finer
        each = middle + ndtri(probability) * spread
        low, high = np.min(each, axis=0), np.max(each, axis=0)
        for _ in range(30):
            half = 0.5 * (low + high)
            below = weights @ ndtr((half - middle) / spread) < probability
            low, high = np.where(below, half, low), np.where(below, high, half)
        out.append(0.5 * (low + high))
    return out
