"""Discrepancy: what no hypothesis holds, in the law and in the records, with a size.

To first order about a fit the records are

    y = m + J dθ + Σ_i c_i u_i + d_r + ε,    c_i ~ N(0, (τ w_i)²),    d_r = Σ_k b_rk cos(π k x),

with u_i the signatures of all effects and terms that are not in the hypothesis, each a third of the
record at τ = 1 (this is the dense library, and says something of any flow), and d_r a smooth curve
along the samples x of run r, b_rk ~ N(0, ρ² S_k), whose size may grow with the shear rate; or along
the logarithm of the samples since the rate last stepped, where motor, tool and transducer are still
on their way. Or all runs share one curve, b_k: noise as slow does not repeat itself   [Kennedy &
O'Hagan 2001, J. R. Stat. Soc. B 63, 425; MacKay 1992, Neural Comput. 4, 415, for τ by evidence]. ρ,
τ, the stiffness of S and the growth are summed over a grid.
"""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular
from scipy.special import logsumexp

from discover.inference.fits import LOG_2PI, Fit, Fitter
from discover.inference.noise import LEAST, Noise
from discover.inference.smooth_curves import MODES, cosines, half_of, spectrum_of

CURVES = (0.3, 0.7, 2.0, 6.0, 18.0, 60.0)
"""Sizes of d over the noise."""

STIFFNESS = (2.5, 8.0)
"""Half swings of a run from which on S falls."""

GROWTHS = (0.0, 1.0, 2.0)
"""Powers of the largest shear rate of a run with which its d grows."""

TERMS = (0.0, 0.001, 0.005, 0.025, 0.12)
"""τ."""

SCATTERS = (1.0, 6.0)
"""By which runs may differ, over the usual: with a discrepancy or without, it is summed over. A fit
in which they differ by more is one of no sound bench, and the discrepancy is the likelier by that.
"""

_SEEN = 1e-5
"""Length of a direction of the unused terms, over the records, down to which it is seen."""

_TRANSIENT = 0.2
"""Prior share of discrepancies that follow steps of the rate and nothing else."""

_SHARED = 0.2
"""Prior share of discrepancies that are one curve in all runs."""

_TERMS_ALONE = 0.1
"""Prior odds of unused terms without a curve."""

_THIRD = 1.0 / 3.0

_CELLS = (0.15, 0.5, 1.2, 3.5, 10.0, 30.0, 100.0)
"""Ends of the cells of ρ of which `CURVES` are the middles."""

_LIKELY = 7.0
_MOST = 12


class _Curve(NamedTuple):
    """One curve of the grid: ρ, half swings, power of the rate; where it runs, of which runs."""

    size: float
    stiffness: float
    growth: float
    after_a_step: bool = False
    shared: bool = False


@dataclass(frozen=True)
class Member:
    """One discrepancy of the grid.

    `curve`, `growth`: ρ over the noise, zero without a curve, power of the rate. `which`,
    `correlation`: its curve in the grid, and the correlation of the noise beside it. `log_weight`:
    log of its probability among all of the hypothesis. `noise`: size of the noise over the records.
    `mean`, `root`: of the constants and terms, in units of their priors: the covariance is noise²
    root rootᵀ.
    """

    curve: float
    growth: float
    which: int
    correlation: float
    log_weight: float
    noise: float
    mean: Float[np.ndarray, " m"]
    root: Float[np.ndarray, "m used"]


class _Products(NamedTuple):
    """Products of what was left and columns, curves being integrated out; and those with curves.

    `gram`: shape (grid, 1 + m, 1 + m). `log_determinant`: shape (grid,). `cross`, `inner`: of
    curves with the others and with themselves, of each run.
    """

    gram: Float[np.ndarray, "grid n n"]
    log_determinant: Float[np.ndarray, " grid"]
    cross: Float[np.ndarray, "runs k n"]
    inner: Float[np.ndarray, "runs k k"]


class DiscrepancyModel:
    """What the records say beside a hypothesis that none of its constants does.

    `fitter`, `fit`: a hypothesis with derivatives, and what fitted it. `smallest`: what the least
    effect of the hypothesis takes away over the noise: a discrepancy is as likely of any size up to
    that. `names`: effects and terms that are not in the hypothesis. `log_factor`: log of how many
    times likelier the records are with a discrepancy than without. `members`: the likeliest of the
    grid.
    """

    def __init__(self, fitter: Fitter, fit: Fit, smallest: float = np.inf):
        assert fit.jacobian is not None
        self.fitter, self.fit, self.smallest = fitter, fit, smallest
        rows = fitter.rows
        self.record = fitter.record(fit)
        stiff = fit.priors.pulls(fit.coordinates)[:, 1]
        self.widths = np.concatenate([1.0 / np.sqrt(stiff), fitter.errors.usual_widths])
        self.offset = np.concatenate([fit.coordinates - fit.priors.centres, fit.linear])
        problem = fitter.problem
        self.names = [e.name for e in problem.candidates if e.name not in fit.names]
        self._steps = np.array([1e-2 * problem.amplitude(name).width for name in self.names])
        unused = self._signatures() / rows.size[:, None]
        size = np.sqrt(np.mean(unused**2, axis=0))
        unused *= np.where(size > 0, _THIRD / np.maximum(size, 1e-300), 0.0)
        # many are alike: amplitudes that are as likely in all directions are so along these too
        directions, lengths, _ = np.linalg.svd(unused, full_matrices=False)
        unused = (directions * lengths)[:, TERMS[-1] * lengths > _SEEN] * rows.size[:, None]
        self.columns = np.column_stack([fit.jacobian * self.widths, unused])
        self.left = rows.recorded - self.record + fit.jacobian @ self.offset
        self.growth = np.log(rows.fastest / np.max(rows.fastest))
        # over the values predicted: those recorded would bring their noise, which it explains then
        self._curves = cosines(rows) * rows.sizes_of(self.record)[:, None]
        curves = [
            *product(CURVES, STIFFNESS, GROWTHS),
            *product(CURVES, STIFFNESS[-1:], GROWTHS[:1], (True,)),
        ]
        if len(rows.runs) > 1:
            curves += product(CURVES, STIFFNESS, GROWTHS[:1], (False,), (True,))
        # none first
        self._grid = [_Curve(0.0, STIFFNESS[0], 0.0), *(_Curve(*one) for one in curves)]
        self._kept: dict[float, _Products] = {}
        self.members, self.log_factor = self._weighed()

    def _signatures(self) -> Float[np.ndarray, "rows k"]:
        """Return what one of each effect that is not there does to records, in Pa."""
        fitter, fit = self.fitter, self.fit
        at = [fitter.problem.model.positions(name)[0] for name in self.names]
        thetas = np.tile(fit.theta, (len(at), 1))
        thetas[np.arange(len(at)), at] += self._steps
        with np.errstate(over="ignore", invalid="ignore"):  # an effect that runs away
            found = (fitter.predict(thetas) - fit.predicted).T / self._steps
        return np.where(np.all(np.isfinite(found), axis=0), found, 0.0)

    # the grid ---------------------------------------------------------------------------------

    def _scale(self, terms: float, scatter: float) -> tuple[Float[np.ndarray, " m"], float]:
        """Return the prior deviations of constants and terms, over the noise.

        And the log of how likely it is that runs differ by that.
        """
        scale, first, log = np.ones(self.columns.shape[1]), len(self.fit.priors), 0.0
        for at, known in self.fitter.errors.deviations:
            if np.isfinite(known.known):
                scale[first + at.start : first + at.stop] = scatter
                log += known.log_odds_of_size(scatter * known.size)
        scale[len(self.widths) :] *= terms
        return scale / self.fit.noise.common, log

    def _swings(self, curve: _Curve) -> Float[np.ndarray, " runs"]:
        """Return the size of a curve in each run, over the noise."""
        return curve.size * np.exp(curve.growth * self.growth)

    def _noise(self, correlation: float) -> Noise:
        """Return noise of size one with a correlation."""
        return Noise(self.sizes_of_noise, 1.0, correlation, self.fit.noise.share)

    def _products(self, correlation: float) -> "_Products":
        """Return products of what was left, columns and curves of each run, whitened."""
        if correlation not in self._kept:
            noise = self._noise(correlation)
            both = np.column_stack([self.left, self.columns, self._curves])
            white = self.fitter.noise.whitened(both, self.record, noise)
            run = self.fitter.rows.run[self.fitter.noise.kept]
            plain, cross, inner, width = [], [], [], 2 * MODES
            for i in range(len(self.growth)):
                own, curve = white[run == i, :-width], white[run == i, -width:]
                plain.append(own.T @ own)
                cross.append(curve.T @ own)
                inner.append(curve.T @ curve)
            of_curves = np.array(cross), np.array(inner)
            grams, logs = self._without_curves(np.sum(plain, axis=0), *of_curves)
            base = self.fitter.noise.log_determinant(self.record, noise)
            self._kept[correlation] = _Products(grams, base - logs, *of_curves)
        return self._kept[correlation]

    def _without_curves(
        self,
        plain: Float[np.ndarray, "n n"],
        cross: Float[np.ndarray, "runs k n"],
        inner: Float[np.ndarray, "runs k k"],
    ) -> tuple[Float[np.ndarray, "grid n n"], Float[np.ndarray, " grid"]]:
        """Return products with each curve of the grid integrated out, and half log determinants.

        Curves of one spectrum differ in size alone, so that one
        decomposition S K S = Q Λ Qᵀ of each run, or of all together, serves all of these.
        """
        kinds, grams, logs = {}, [], []
        for curve in self._grid:
            kind = curve._replace(size=1.0, growth=0.0)
            if kind not in kinds:
                half, spectrum = half_of(curve.after_a_step), spectrum_of(curve.stiffness)
                own, along = inner[:, half, half], cross[:, half]
                if curve.shared:
                    own, along = (np.sum(one, axis=0)[None] for one in (own, along))
                values, vectors = np.linalg.eigh(spectrum[:, None] * own * spectrum)
                along = np.swapaxes(vectors, 1, 2) @ (spectrum[:, None] * along)
                kinds[kind] = np.maximum(values, 0.0), along
            values, along = kinds[kind]
            squares = self._swings(curve)[: len(values), None] ** 2
            taken = np.sqrt(squares / (1.0 + squares * values))[..., None] * along
            taken = taken.reshape(-1, len(plain))
            grams.append(plain - taken.T @ taken)
            logs.append(0.5 * float(np.sum(np.log1p(squares * values))))
        return np.array(grams), np.array(logs)

    @property
    def sizes_of_noise(self) -> Float[np.ndarray, " runs"]:
        """Noise of each run over that of all, as samples scatter about a smooth curve."""
        rows = self.fitter.rows
        left = (rows.recorded - self.record) / rows.size
        own = [left[rows.run == i] for i in range(len(rows.runs))]
        found = np.array([np.mean(np.diff(x, 2) ** 2) / 6.0 if len(x) > 4 else np.nan for x in own])
        usual = np.nanmedian(found) if np.any(np.isfinite(found)) else 1.0
        count = np.array([len(x) for x in own], float)
        shared = (4.0 * usual + count * np.where(np.isfinite(found), found, usual)) / (4.0 + count)
        shared += LEAST**2
        return np.sqrt(shared / np.mean(shared))

    def _weighed(self) -> tuple[list[Member], float]:
        n, own = len(self.fitter.noise.kept), self._priors()
        some, plain = [], []
        for correlation in sorted({0.0, 0.45, 0.75, self.fit.noise.correlation}):
            total, logs, *_ = self._products(correlation)
            known = np.log(0.5 if correlation == 0.0 else 0.5 / 3.0)
            least = self.fitter.noise.least(self.record, self._noise(correlation))
            parts: dict[bool, np.ndarray] = {}  # with terms, and without
            for terms, scatter in product(TERMS, SCATTERS):
                scale, differ = self._scale(terms, scatter)
                # what was left last: its pivot is the square that columns and curves do not take
                used = np.append(np.flatnonzero(scale) + 1, 0)
                scale = np.append(scale[scale > 0], 1.0)
                if bool(terms) not in parts:
                    parts[bool(terms)] = total[:, used[:, None], used]
                matrix = scale[:, None] * parts[bool(terms)] * scale
                at = np.arange(len(used) - 1)
                matrix[:, at, at] += 1.0
                matrix[:, -1, -1] += least
                pivots = np.diagonal(np.linalg.cholesky(matrix), axis1=1, axis2=2)
                squares = pivots[:, -1] ** 2
                values = logs + known - np.sum(np.log(pivots[:, :-1]), axis=1)
                values -= 0.5 * n * (np.log(squares / n) + 1.0 + LOG_2PI)
                values += differ
                prior = np.log(0.5 if not terms else 0.5 / (len(TERMS) - 1))
                for which, (value, square) in enumerate(zip(values, squares, strict=True)):
                    if which or terms:
                        log = value + prior + own[which]
                        some.append(
                            (log, correlation, (terms, scatter), which, np.sqrt(square / n))
                        )
                    else:
                        plain.append(value)
        weights = np.array([one[0] for one in some])
        none, total = (float(np.asarray(logsumexp(logs))) for logs in (plain, weights))
        members = []
        for at in np.argsort(-weights)[:_MOST]:
            weight, correlation, terms, which, noise = some[at]
            if weight - total < -_LIKELY:
                break
            scale, _ = self._scale(*terms)
            mean, root = _posterior(self._products(correlation).gram[which], scale)
            curve, log = self._grid[which], float(weight - total)
            members.append(
                Member(curve.size, curve.growth, which, correlation, log, float(noise), mean, root)
            )
        return members, total - none

    def _priors(self) -> Float[np.ndarray, " grid"]:
        """Return the log prior of each curve of the grid, and of none beside unused terms.

        Sizes are uniform up to what the smallest effect takes away, and a fifth asks nothing of
        them. What is too small to be seen is no discrepancy.
        """
        ends, limit = np.array(_CELLS), self.smallest
        share = np.full(len(CURVES), 1.0 / len(CURVES))
        if np.isfinite(limit):
            inside = np.diff(np.minimum(ends, max(limit, ends[0]))) / max(limit, 1e-9)
            share = 0.8 * inside + 0.2 * share
        curves = self._grid[1:]
        kinds = [(one.after_a_step, one.shared) for one in curves]
        known = {(True, False): _TRANSIENT, (False, True): _SHARED}
        of_kind = {kind: known.get(kind, 0.0) for kind in kinds}
        of_kind[False, False] = 1.0 - sum(of_kind.values())
        each = [of_kind[kind] * len(CURVES) / kinds.count(kind) for kind in kinds]
        known = [share[CURVES.index(c.size)] * p for c, p in zip(curves, each, strict=True)]
        return np.log([_TERMS_ALONE, *known])

    def sizes(self, draws: int, lot: np.random.Generator) -> Float[np.ndarray, "draws runs"]:
        """Return draws of the root mean square of the discrepancy of each run, over its size."""
        rows, c = self.fitter.rows, len(self.widths)
        weights = np.exp([member.log_weight for member in self.members])
        chosen = lot.choice(len(weights), draws, p=weights / np.sum(weights))
        found = np.zeros((draws, len(self.growth)))
        for number, member in enumerate(self.members):
            at = np.flatnonzero(chosen == number)
            if not len(at):
                continue
            normal = lot.standard_normal((len(at), member.root.shape[1]))
            own = member.mean + member.noise * normal @ member.root.T
            off = own[:, c:] @ self.columns[:, c:].T
            if member.curve:
                off = off + self._drawn_curves(member, own, lot)
            for i in range(len(self.growth)):
                part = off[:, rows.run == i] / rows.size[rows.run == i]
                found[at, i] = np.sqrt(np.mean(part**2, axis=1))
        return found

    def _drawn_curves(self, member: Member, own: np.ndarray, lot: np.random.Generator):
        """Return draws of the curves of all runs, given constants and terms, in Pa."""
        products, rows = self._products(member.correlation), self.fitter.rows
        curve, out = self._grid[member.which], np.zeros((len(own), len(self.left)))
        half, spectrum = half_of(curve.after_a_step), spectrum_of(curve.stiffness)
        swings = self._swings(curve)
        for runs in [np.arange(len(swings))] if curve.shared else np.arange(len(swings))[:, None]:
            d, size = swings[runs], len(spectrum)
            inner = np.einsum("r,rij->ij", d**2, products.inner[runs, half, half])
            cross = np.einsum("r,rin->in", d, products.cross[runs, half])
            inner = np.eye(size) + spectrum[:, None] * inner * spectrum
            right = spectrum[:, None] * (cross[:, :1] - cross[:, 1:] @ own.T)
            middle = np.linalg.solve(inner, right).T
            normal = lot.standard_normal(middle.shape)
            spread = member.noise * np.linalg.solve(np.linalg.cholesky(inner).T, normal.T).T
            there = np.isin(rows.run, runs)
            along = self._curves[there, half] * swings[rows.run[there], None]
            out[:, there] = ((middle + spread) * spectrum) @ along.T
        return out


def _posterior(
    gram: Float[np.ndarray, "one_more one_more"], scale: Float[np.ndarray, " m"]
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
