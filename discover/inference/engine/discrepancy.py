"""Discrepancy: what no hypothesis holds, in the law and in the records, with a size.

To first order about a fit the records are

    y = m + J dθ + Σ_i c_i u_i + d_r + ε,    c_i ~ N(0, (τ w_i)²),    d_r = Σ_k b_rk cos(π k x),

with u_i the signatures of all effects and terms that are not in the hypothesis, each no larger than
a third of the record at τ = 1 (so this is the dense library, and says something of any flow), and
d_r a smooth curve along the samples of each run, b_rk ~ N(0, ρ² S_k), whose size may grow with the
shear rate   [Kennedy & O'Hagan 2001, J. R. Stat. Soc. B 63, 425; MacKay 1992, Neural Comput. 4, 415
for τ by evidence]. ρ, τ, the stiffness of S and the growth are summed over a grid.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from discover.inference.engine.fits import LOG_2PI, Fit, Fitter
from discover.inference.engine.noise import Noise

CURVES = (0.3, 0.7, 2.0, 6.0, 18.0, 60.0)
"""Sizes of d over the noise."""

STIFFNESS = (2.5, 8.0)
"""Half swings of a run from which on S falls."""

GROWTHS = (0.0, 1.0, 2.0)
"""Powers of the largest shear rate of a run with which its d grows."""

TERMS = (0.0, 0.001, 0.005, 0.025, 0.12)
"""τ."""

_MODES = 20
_THIRD = 1.0 / 3.0

_SHARES = (0.15, 0.5, 1.2, 3.5, 10.0, 30.0, 100.0)
"""Ends of the cells of ρ of which `CURVES` are the middles."""


@dataclass(frozen=True)
class Member:
    """One discrepancy of the grid: its weight, and what the records say of it.

    Attributes
    ----------
    log_weight
        Log of its posterior probability among all of the hypothesis.
    curve, stiffness, growth, terms
        ρ over the noise, half swings, power of the rate, τ.
    noise
        Size of the noise over the records.
    mean, root
        Posterior of all coefficients in units of their priors, shape (n,) and (n, n): covariance
        is noise² root rootᵀ.
    scale
        Prior deviations over the noise, shape (n,).
    """

    log_weight: float
    curve: float
    stiffness: float
    growth: float
    terms: float
    noise: float
    mean: Float[np.ndarray, " n"]
    root: Float[np.ndarray, "n n"]
    scale: Float[np.ndarray, " n"]


class Discrepancy:
    """What the records say beside a hypothesis that none of its constants does.

    Parameters
    ----------
    fitter, fit
        A hypothesis with derivatives, and what fitted it.
    smallest
        What the least effect of the hypothesis takes away over the noise: a discrepancy is as
        likely of any size up to that, and as no larger one.
    """

    def __init__(self, fitter: Fitter, fit: Fit, smallest: float = np.inf):
        assert fit.jacobian is not None
        self.fitter, self.fit, self.smallest = fitter, fit, smallest
        rows = fitter.rows
        self.record = fitter.record(fit)
        pulls = [p.pull(c)[1] for p, c in zip(fit.priors.values(), fit.coordinates, strict=True)]
        widths = np.concatenate([1.0 / np.sqrt(pulls), fitter.widths])
        centres = [p.centre for p in fit.priors.values()]
        off = np.concatenate([fit.coordinates - centres, fit.linear])
        self._constants = len(widths)
        self.names, self.steps = self._others()
        unused = self._signatures(fitter, fit.predicted)
        with np.errstate(divide="ignore"):
            size = np.sqrt(np.mean((unused / rows.size[:, None]) ** 2, axis=0))
            self.shares = np.where(size > 0, _THIRD / np.maximum(size, 1e-300), 0.0)
        self.unused = unused * self.shares
        self.curves = _cosines(rows.run, len(rows.runs)) * rows.size[:, None]
        self._columns = np.column_stack([fit.jacobian * widths, self.unused, self.curves])
        self._left = rows.recorded - self.record + fit.jacobian @ off
        self.growth = np.log(rows.fastest / np.max(rows.fastest))
        self.members, self.log_factor = self._weighed()

    def _others(self) -> tuple[list[str], Float[np.ndarray, " k"]]:
        problem = self.fitter.problem
        names = [e.name for e in problem.candidates if e.name not in self.fit.names]
        return names, np.array([1e-2 * problem.priors((n,))[self._at(n)].width for n in names])

    def _at(self, name: str) -> int:
        return self.fitter.problem.model.positions(name)[0]

    def _signatures(self, fitter: Fitter, predicted) -> Float[np.ndarray, "rows k"]:
        """Return what one of each effect that is not there does to the records, in Pa."""
        thetas = []
        for name, step in zip(self.names, self.steps, strict=True):
            theta = self.fit.theta.copy()
            theta[self._at(name)] += step
            thetas.append(theta)
        found = (fitter.predict(thetas) - predicted).T / self.steps
        return np.where(np.all(np.isfinite(found), axis=0), found, 0.0)

    def _spectrum(self, stiffness: float, growth: float) -> Float[np.ndarray, " curves"]:
        """Return the deviations of the curves' coefficients, for a size of one."""
        k = np.arange(_MODES)
        power = 1.0 / (1.0 + (k / stiffness) ** 4)
        power = np.sqrt(power / np.sum(power) * np.where(k == 0, 1.0, 2.0) / 1.0)
        power /= np.sqrt(np.sum(power**2 * np.where(k == 0, 1.0, 0.5)))
        return np.concatenate([power * np.exp(growth * g) for g in self.growth])

    def _weighed(self) -> tuple[list[Member], float]:
        fitter, fit = self.fitter, self.fit
        sizes, share = _relative_sizes(fitter, fit), fit.noise.share
        n, c, u = len(fitter.noise.kept), self._constants, len(self.names)
        curves = list(product(CURVES, STIFFNESS, GROWTHS))
        scales = np.array([size * self._spectrum(k, g) for size, k, g in curves])
        own = np.log(self._prior_of_curves(curves))
        found, grams = [], {}
        for correlation in sorted({0.0, 0.45, 0.75, fit.noise.correlation}):
            noise = Noise(sizes, 1.0, correlation, share)
            columns = np.column_stack([self._left, self._columns])
            white = fitter.noise.whitened(columns, self.record, noise)
            gram = grams[correlation] = white.T @ white
            base = fitter.noise.log_determinant(self.record, noise)
            base += np.log(0.5) if correlation == 0.0 else np.log(0.5 / 3.0)
            for terms in TERMS:
                scale = np.full(c + u, 1.0 / fit.noise.common)
                scale[c:] *= terms
                prior = np.log(0.5 if not terms else 0.5 / (len(TERMS) - 1))
                # constants and terms first, then the curves beside them
                first = c + (u if terms else 0)
                inner = scale[:first, None] * gram[1 : first + 1, 1 : first + 1] * scale[:first]
                factor = np.linalg.cholesky(np.eye(first) + inner)
                rest = np.r_[0, 1 + c + u : len(gram)]
                along = solve_triangular(
                    factor, scale[:first, None] * gram[1 : first + 1][:, rest], lower=True
                )
                left = gram[np.ix_(rest, rest)] - along.T @ along
                determinant = np.sum(np.log(np.diag(factor)))
                squares = [left[0, 0]]
                determinants = [determinant]
                many = scales[:, :, None] * left[1:, 1:] * scales[:, None, :]
                chol = np.linalg.cholesky(np.eye(many.shape[1]) + many)
                ahead = np.linalg.solve(chol, (scales * left[1:, 0])[..., None])[..., 0]
                squares = np.append(left[0, 0], left[0, 0] - np.sum(ahead**2, axis=1))
                logs = np.log(np.diagonal(chol, axis1=1, axis2=2)).sum(axis=1)
                determinants = np.append(determinant, determinant + logs)
                squares = np.maximum(squares, 1e-300)
                values = base - determinants - 0.5 * n * (np.log(squares / n) + 1.0 + LOG_2PI)
                priors = np.append(np.log(0.1), own) + prior
                for i, (value, square) in enumerate(zip(values, squares, strict=True)):
                    which = None if not i else i - 1
                    found.append((value, value + priors[i], correlation, terms, which, square))
        plain = [one[0] for one in found if one[4] is None and not one[3]]
        some = [one for one in found if one[4] is not None or one[3]]
        none, weights = logsumexp(plain), np.array([one[1] for one in some])
        total = logsumexp(weights)
        members = []
        for at in np.argsort(-weights)[:12]:
            if weights[at] - total < -7.0:
                break
            _, weight, correlation, terms, which, square = some[at]
            scale = np.full(c + u, 1.0 / fit.noise.common)
            scale[c:] *= terms
            width = np.zeros(scales.shape[1]) if which is None else scales[which]
            scale = np.concatenate([scale, width])
            curve, stiffness, growth = (0.0, 1.0, 0.0) if which is None else curves[which]
            members.append(
                Member(
                    float(weight - total), curve, stiffness, growth, terms,
                    float(np.sqrt(square / n)), *_posterior(grams[correlation], scale), scale,
                )
            )  # fmt: skip
        hidden = self._hidden()
        return members, float(logsumexp([total, none + np.log(max(hidden, 1e-300))]) - none)

    def _hidden(self) -> float:
        """Return the prior probability of a discrepancy too small to be seen."""
        return (
            min(1.0, _SHARES[0] / max(self.smallest, 1e-9)) if np.isfinite(self.smallest) else 0.0
        )

    def _prior_of_curves(self, curves: Sequence[tuple[float, float, float]]) -> np.ndarray:
        """Return the prior of each curve, beside what is too small to be seen.

        Sizes are uniform up to what the smallest effect takes away; a fifth asks nothing of them.
        """
        ends, limit = np.array(_SHARES), self.smallest
        share = np.full(len(CURVES), 1.0 / len(CURVES))
        if np.isfinite(limit):
            inside = np.diff(np.minimum(ends, max(limit, ends[0]))) / max(limit, 1e-9)
            share = 0.8 * inside + 0.2 * share
        per = len(STIFFNESS) * len(GROWTHS)
        return np.array([max(share[CURVES.index(size)], 1e-300) / per for size, _, _ in curves])


def _posterior(
    gram: Float[np.ndarray, "n+1 n+1"], scale: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n n"]]:
    """Return mean and root of the covariance of coefficients, for noise of size one."""
    used = np.flatnonzero(scale > 0)
    own = scale[used]
    inner = own[:, None] * gram[1:, 1:][np.ix_(used, used)] * own
    factor = np.linalg.cholesky(np.eye(len(used)) + inner)
    inverse = solve_triangular(factor, np.eye(len(used)), lower=True).T
    mean, root = np.zeros(len(scale)), np.zeros((len(scale), len(used)))
    mean[used] = own * (inverse @ (inverse.T @ (own * gram[1:, 0][used])))
    root[used] = own[:, None] * inverse
    return mean, root


def _relative_sizes(fitter: Fitter, fit: Fit) -> Float[np.ndarray, " runs"]:
    """Return the noise of each run over that of all, as its samples scatter about a smooth curve."""
    rows = fitter.rows
    left = (rows.recorded - fitter.record(fit)) / rows.size
    found, count = [], []
    for i in range(len(rows.runs)):
        own = left[rows.run == i]
        found.append(np.mean(np.diff(own, 2) ** 2) / 6.0 if len(own) > 4 else np.nan)
        count.append(len(own))
    scatter, counts = np.array(found), np.array(count, float)
    usual = np.nanmedian(scatter) if np.any(np.isfinite(scatter)) else 1.0
    scatter = np.where(np.isfinite(scatter), scatter, usual)
    shared = (4.0 * usual + counts * scatter) / (4.0 + counts)
    return np.sqrt(shared / max(float(np.mean(shared)), 1e-300))


def _cosines(run: np.ndarray, runs: int) -> Float[np.ndarray, "rows curves"]:
    """Return cosines along the samples of each run, zero in the others."""
    out = np.zeros((len(run), runs * _MODES))
    for i in range(runs):
        at = np.flatnonzero(run == i)
        x = (np.arange(len(at)) + 0.5) / len(at)
        out[at, i * _MODES : (i + 1) * _MODES] = np.cos(np.pi * np.outer(x, np.arange(_MODES)))
    return out
