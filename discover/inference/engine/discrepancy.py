"""Discrepancy: what no hypothesis holds, in the law and in the records, with a size.

To first order about a fit the records are

    y = m + J dθ + Σ_i c_i u_i + d_r + ε,    c_i ~ N(0, (τ w_i)²),    d_r = Σ_k b_rk cos(π k x),

with u_i the signatures of all effects and terms that are not in the hypothesis, each a third of the
record at τ = 1 (this is the dense library, and says something of any flow), and d_r a smooth curve
along the samples of run r, b_rk ~ N(0, ρ² S_k), whose size may grow with the shear rate   [Kennedy
& O'Hagan 2001, J. R. Stat. Soc. B 63, 425; MacKay 1992, Neural Comput. 4, 415, for τ by evidence].
ρ, τ, the stiffness of S and the growth are summed over a grid.
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

_CELLS = (0.15, 0.5, 1.2, 3.5, 10.0, 30.0, 100.0)
"""Ends of the cells of ρ of which `CURVES` are the middles."""

_LIKELY = 7.0
_MOST = 12
_JUDGED = 24
"""Samples of a run left out by which members are judged."""


@dataclass(frozen=True)
class Member:
    """One discrepancy of the grid.

    Attributes
    ----------
    curve, stiffness, growth, terms
        ρ over the noise, half swings, power of the rate, τ.
    log_weight
        Log of its probability among all of the hypothesis.
    noise
        Size of the noise over the records.
    mean, root
        Of the constants and terms, in units of their priors: the covariance is noise² root rootᵀ.
    """

    curve: float
    stiffness: float
    growth: float
    terms: float
    log_weight: float
    noise: float
    mean: Float[np.ndarray, " m"]
    root: Float[np.ndarray, "m m"]


class Discrepancy:
    """What the records say beside a hypothesis that none of its constants does.

    Parameters
    ----------
    fitter, fit
        A hypothesis with derivatives, and what fitted it.
    smallest
        What the least effect of the hypothesis takes away over the noise: a discrepancy is as
        likely of any size up to that.

    Attributes
    ----------
    names, shares
        Effects and terms that are not in the hypothesis, and the amplitude of each that changes
        the records by a third.
    log_factor
        Log of how many times likelier the records are with a discrepancy than without.
    members
        The likeliest of the grid.
    """

    def __init__(self, fitter: Fitter, fit: Fit, smallest: float = np.inf):
        assert fit.jacobian is not None
        self.fitter, self.fit, self.smallest = fitter, fit, smallest
        rows = fitter.rows
        self.record = fitter.record(fit)
        pulls = [p.pull(c)[1] for p, c in zip(fit.priors.values(), fit.coordinates, strict=True)]
        self.widths = np.concatenate([1.0 / np.sqrt(pulls), fitter.widths])
        centres = np.array([p.centre for p in fit.priors.values()])
        self.offset = np.concatenate([fit.coordinates - centres, fit.linear])
        self.names, self._steps = self._others()
        unused = self.signatures(fitter, fit.predicted)
        size = np.sqrt(np.mean((unused / rows.size[:, None]) ** 2, axis=0))
        self.shares = np.where(size > 0, _THIRD / np.maximum(size, 1e-300), 0.0)
        self.columns = np.column_stack([fit.jacobian * self.widths, unused * self.shares])
        self.left = rows.recorded - self.record + fit.jacobian @ self.offset
        self.growth = np.log(rows.fastest / np.max(rows.fastest))
        self._curves = _cosines(rows.run, len(rows.runs)) * rows.size[:, None]
        self._grid = list(product(CURVES, STIFFNESS, GROWTHS))
        self._kept: dict[float, tuple[np.ndarray, np.ndarray]] = {}
        self.members, self.log_factor = self._weighed()

    def _others(self) -> tuple[list[str], Float[np.ndarray, " k"]]:
        problem = self.fitter.problem
        names = [e.name for e in problem.candidates if e.name not in self.fit.names]
        return names, np.array([1e-2 * problem.priors((n,))[self._at(n)].width for n in names])

    def _at(self, name: str) -> int:
        return self.fitter.problem.model.positions(name)[0]

    def signatures(
        self, fitter: Fitter, predicted: Float[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "rows k"]:
        """Return what one of each effect that is not there does to records, in Pa."""
        thetas = []
        for name, step in zip(self.names, self._steps, strict=True):
            theta = self.fit.theta.copy()
            theta[self._at(name)] += step
            thetas.append(theta)
        found = (fitter.predict(thetas) - predicted).T / self._steps
        return np.where(np.all(np.isfinite(found), axis=0), found, 0.0)

    # the grid ---------------------------------------------------------------------------------

    def _scale(self, terms: float) -> Float[np.ndarray, " m"]:
        """Return the prior deviations of constants and terms, over the noise."""
        scale = np.full(self.columns.shape[1], 1.0 / self.fit.noise.common)
        scale[len(self.widths) :] *= terms
        return scale

    def _deviations(self) -> Float[np.ndarray, "grid runs k"]:
        """Return the deviations of the curves of each run, for each curve of the grid."""
        k = np.arange(_MODES)
        found = []
        for size, stiffness, growth in self._grid:
            power = 1.0 / (1.0 + (k / stiffness) ** 4)
            # a cosine has half of the square of its size, a constant all of it
            power /= np.sqrt(np.sum(power**2 * np.where(k == 0, 1.0, 0.5)))
            found.append(size * power * np.exp(growth * self.growth)[:, None])
        return np.array(found)

    def _grams(self, correlation: float) -> tuple[np.ndarray, np.ndarray]:
        """Return products of [left, columns] of each run, its curve being integrated out.

        Returns
        -------
        Shape (1 + grid, runs, 1 + m, 1 + m), without a curve first, and log determinants of shape
        (1 + grid,).
        """
        if correlation in self._kept:
            return self._kept[correlation]
        noise = Noise(self._sizes(), 1.0, correlation, self.fit.noise.share)
        both = np.column_stack([self.left, self.columns, self._curves])
        white = self.fitter.noise.whitened(both, self.record, noise)
        run, runs = self.fitter.rows.run[self.fitter.noise.kept], len(self.growth)
        m = 1 + self.columns.shape[1]
        inner, cross, plain = [], [], []
        for i in range(runs):
            own = white[run == i, :m]
            curve = white[run == i, m + i * _MODES : m + (i + 1) * _MODES]
            plain.append(own.T @ own)
            cross.append(curve.T @ own)
            inner.append(curve.T @ curve)
        d = self._deviations()
        chol = np.linalg.cholesky(
            np.eye(_MODES) + d[..., :, None] * np.array(inner) * d[..., None, :]
        )
        along = np.linalg.solve(chol, d[..., None] * np.array(cross))
        grams = np.array(plain) - np.swapaxes(along, -1, -2) @ along
        logs = np.sum(np.log(np.diagonal(chol, axis1=-2, axis2=-1)), axis=(-1, -2))
        base = self.fitter.noise.log_determinant(self.record, noise)
        found = np.concatenate([np.array(plain)[None], grams]), base - np.append(0.0, logs)
        self._kept[correlation] = found
        return found

    def _sizes(self) -> Float[np.ndarray, " runs"]:
        """Return the noise of each run over that of all, as samples scatter about a smooth curve."""
        rows = self.fitter.rows
        left = (rows.recorded - self.record) / rows.size
        own = [left[rows.run == i] for i in range(len(rows.runs))]
        found = np.array([np.mean(np.diff(x, 2) ** 2) / 6.0 if len(x) > 4 else np.nan for x in own])
        usual = np.nanmedian(found) if np.any(np.isfinite(found)) else 1.0
        usual = max(float(usual), 1e-300)
        count = np.array([len(x) for x in own], float)
        shared = (4.0 * usual + count * np.where(np.isfinite(found), found, usual)) / (4.0 + count)
        return np.sqrt(shared / np.mean(shared))

    def _weighed(self) -> tuple[list[Member], float]:
        n, own = len(self.fitter.noise.kept), self._priors()
        some, plain = [], []
        for correlation in sorted({0.0, 0.45, 0.75, self.fit.noise.correlation}):
            grams, logs = self._grams(correlation)
            total, known = np.sum(grams, axis=1), np.log(0.5 if correlation == 0.0 else 0.5 / 3.0)
            for terms in TERMS:
                scale = self._scale(terms)
                used = scale > 0
                matrix = scale[used, None] * total[:, 1:, 1:][:, used][:, :, used] * scale[used]
                chol = np.linalg.cholesky(np.eye(matrix.shape[1]) + matrix)
                ahead = np.linalg.solve(chol, (scale * total[:, 0, 1:])[:, used, None])[..., 0]
                squares = np.maximum(total[:, 0, 0] - np.sum(ahead**2, axis=1), 1e-300)
                values = logs + known - np.sum(np.log(np.diagonal(chol, axis1=1, axis2=2)), axis=1)
                values -= 0.5 * n * (np.log(squares / n) + 1.0 + LOG_2PI)
                prior = np.log(0.5 if not terms else 0.5 / (len(TERMS) - 1))
                for which, (value, square) in enumerate(zip(values, squares, strict=True)):
                    if which or terms:
                        log = value + prior + (own[which - 1] if which else np.log(0.1))
                        some.append((log, correlation, terms, which, np.sqrt(square / n)))
                    else:
                        plain.append(value)
        none, weights = logsumexp(plain), np.array([one[0] for one in some])
        total = logsumexp(weights)
        members = []
        for at in np.argsort(-weights)[:_MOST]:
            weight, correlation, terms, which, noise = some[at]
            if weight - total < -_LIKELY:
                break
            gram = np.sum(self._grams(correlation)[0][which], axis=0)
            members.append(self._member(gram, which, terms, float(weight - total), float(noise)))
        return members, float(np.logaddexp(total, none + np.log(self._hidden())) - none)

    def _member(self, gram, which: int, terms: float, log_weight: float, noise: float) -> Member:
        mean, root = _posterior(gram, self._scale(terms))
        kind = self._grid[which - 1] if which else (0.0, STIFFNESS[0], 0.0)
        return Member(*kind, terms, log_weight, noise, mean, root)

    def _hidden(self) -> float:
        """Return the prior probability of a discrepancy too small to be seen."""
        if not np.isfinite(self.smallest):
            return 1e-300
        return 0.8 * min(1.0, _CELLS[0] / max(self.smallest, 1e-9))

    def _priors(self) -> Float[np.ndarray, " grid"]:
        """Return the log prior of each curve, beside what is too small to be seen.

        Sizes are uniform up to what the smallest effect takes away; a fifth asks nothing of them.
        """
        ends, limit = np.array(_CELLS), self.smallest
        share = np.full(len(CURVES), 1.0 / len(CURVES))
        if np.isfinite(limit):
            inside = np.diff(np.minimum(ends, max(limit, ends[0]))) / max(limit, 1e-9)
            share = 0.8 * inside + 0.2 * share
        per = len(STIFFNESS) * len(GROWTHS)
        return np.log([share[CURVES.index(size)] / per for size, _, _ in self._grid])

    # what it is worth ---------------------------------------------------------------------------

    def candidates(self) -> list[tuple[int, float]]:
        """Return curves and terms of the grid that a prediction may rest on."""
        stiff = self.members[0].stiffness if self.members else STIFFNESS[0]
        curves = [0, *(i + 1 for i, one in enumerate(self._grid) if one[1] == stiff)]
        return [(which, terms) for which in curves for terms in TERMS]

    def left_out(
        self, which: int, terms: float
    ) -> tuple[Float[np.ndarray, " judged"], Float[np.ndarray, " judged"]]:
        """Return errors and deviations of each run as the others predict it, over its size.

        To first order about the fit to all runs; of each run some samples.
        """
        rows = self.fitter.rows
        grams, _ = self._grams(self.fit.noise.correlation)
        total, scale = np.sum(grams[which], axis=0), self._scale(terms)
        size, _, growth = self._grid[which - 1] if which else (0.0, 0.0, 0.0)
        errors, deviations = [], []
        for i, at in enumerate(self.judged):
            if not len(at):
                continue
            gram = total - grams[which][i]
            n = len(rows) - np.count_nonzero(rows.run == i)
            mean, root = _posterior(gram, scale)
            square = gram[0, 0] - gram[0, 1:] @ mean
            noise = np.sqrt(max(float(square), 1e-300) / max(n, 1))
            columns = self.columns[at]
            spread = np.sum((columns @ root) ** 2, axis=1) / rows.size[at] ** 2
            level = self.fitter.noise.deviation(self.record, self.fit.noise.share)[at]
            own = (size * np.exp(growth * self.growth[i])) ** 2 + (level / rows.size[at]) ** 2
            errors.append((self.left[at] - columns @ mean) / rows.size[at])
            deviations.append(noise * np.sqrt(spread + own))
        return np.concatenate(errors), np.concatenate(deviations)

    @property
    def judged(self) -> list[np.ndarray]:
        """Rows of each run by which predictions of runs left out are judged."""
        run = self.fitter.rows.run
        return [
            np.unique(np.linspace(at[0], at[-1], _JUDGED).astype(int))
            for at in (np.flatnonzero(run == i) for i in range(len(self.growth)))
        ]

    def member(self, which: int, terms: float) -> Member:
        """Return a member of the grid, by all fitted runs."""
        grams, _ = self._grams(self.fit.noise.correlation)
        gram = np.sum(grams[which], axis=0)
        mean, _ = _posterior(gram, self._scale(terms))
        square = max(float(gram[0, 0] - gram[0, 1:] @ mean), 1e-300)
        noise = np.sqrt(square / len(self.fitter.noise.kept))
        return self._member(gram, which, terms, 0.0, float(noise))


def _posterior(
    gram: Float[np.ndarray, "m+1 m+1"], scale: Float[np.ndarray, " m"]
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m used"]]:
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


def stacked(
    errors: Float[np.ndarray, "members samples"], deviations: Float[np.ndarray, "members samples"]
) -> tuple[Float[np.ndarray, " members"], float]:
    """Return weights of predictions by what runs left out say, and the factor on their deviations.

    The weights maximise the log density of samples that were left out under the mixture: what is
    right where no hypothesis is   [Yao, Vehtari, Simpson & Gelman 2018, Bayesian Anal. 13, 917].
    The factor is that at which 95 % of them lie within two deviations.

    Parameters
    ----------
    errors, deviations
        Of samples of runs left out, by each prediction.
    """
    logs = -0.5 * (errors / deviations) ** 2 - np.log(deviations)
    densities = np.exp(logs - np.max(logs, axis=0))
    weights = np.full(len(errors), 1.0 / len(errors))
    for _ in range(300):
        share = weights[:, None] * densities
        weights = np.mean(share / np.sum(share, axis=0), axis=1)
    middle = weights @ errors
    spread = np.sqrt(weights @ ((errors - middle) ** 2 + deviations**2))
    reach = float(np.quantile(np.abs(middle) / spread, 0.95)) / 1.96
    return weights, reach


def _cosines(run: np.ndarray, runs: int) -> Float[np.ndarray, "rows curves"]:
    """Return cosines along the samples of each run, zero in the others."""
    out = np.zeros((len(run), runs * _MODES))
    for i in range(runs):
        at = np.flatnonzero(run == i)
        x = (np.arange(len(at)) + 0.5) / len(at)
        out[at, i * _MODES : (i + 1) * _MODES] = np.cos(np.pi * np.outer(x, np.arange(_MODES)))
    return out
