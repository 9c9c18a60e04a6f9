"""Search of the support space: proposals of a sparse optimiser, then moves until none helps."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float

from discover.learners.tensor_sindy.linear_model import (
    LinearModel,
    additions,
    all_of_size,
    distinct,
    removals,
    swaps,
)
from discover.learners.tensor_sindy.optimisers import solve_sparse
from discover.learners.tensor_sindy.refit import POLISHING, SCREENING, Fit, refit
from discover.learners.tensor_sindy.selection import choose_by_bic, extended_bic
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.statistics import noise_model

_HORIZONS = (0.2, 0.5)
_ROUNDS = 3
BREADTH = 8
"""Supports refitted in one move of the search."""

_FEWEST_SLOTS = 5

# Of each size, what a rough grid ranks first is fitted again: at least so many, and those that
# leave little more. Laws may rival the one chosen up to so many times its misfit, so many at most.
_FEWEST_TAKEN, _CLOSE_BEHIND, _WITHIN, _MOST_NEAR = 3, 1.01, 1.5, 24


class SupportSearch:
    """Every support that was refitted, and the moves between them.

    Sparse proposals come from a linear model of the trajectory, which is good near the law at
    which it was made. So each proposal is refitted on the integrated trajectories, the model is
    made again at the best of them, and this goes on until no proposal is new. Early models are
    made on the beginning of each run only, where even a wrong law has not strayed far.

    Parameters
    ----------
    problem
        Data, known physics and library.
    optimizer
        As in `solve_sparse`.
    max_terms
        Largest support.
    floor
        Relative misfit below which data are reproduced as well as the integration allows.
    rough
        The same on a rougher grid, on which supports are ranked; only the best are then fitted on
        `problem`. None to fit all of them there.
    """

    def __init__(
        self,
        problem: TrajectoryProblem,
        optimizer,
        max_terms: int,
        floor: float,
        rough: TrajectoryProblem | None = None,
    ):
        self.problem = problem
        self.scout = None if rough is None else SupportSearch(rough, optimizer, max_terms, floor)
        self.optimizer = optimizer
        self.n_terms = len(problem.library)
        self.largest = min(max_terms, self.n_terms)
        # never fewer, so that searches of small supports share a compilation
        self.slots = max(self.largest, _FEWEST_SLOTS)
        self.floor = floor
        self.fits: dict[tuple[int, ...], Fit] = {}
        self.history: list[tuple[tuple[int, ...], float]] = []
        self.scale: Float[np.ndarray, " n"] = np.ones(self.n_terms)
        self.n_independent = float(problem.records.n_observations)
        self._far: set[tuple[int, ...]] = set()
        self._models: dict[tuple[int, ...], LinearModel] = {}
        self._sparse: dict[tuple[int, ...], list[tuple[int, ...]]] = {}

    def complexity(self, support: tuple[int, ...]) -> tuple:
        """Return the order in which indistinguishable supports are preferred.

        Fewer terms, then lower complexity, then fewer invariants (a constant coefficient before
        a state-dependent one), then the order of the library.
        """
        terms = [self.problem.library.terms[i] for i in support]
        return (
            len(terms),
            sum(term.complexity for term in terms),
            sum(term.degree for term in terms),
            support,
        )

    def criterion(self, fit: Fit) -> float:
        """Return the extended BIC of a fit, on as many observations as are independent."""
        used = {self.problem.library.terms[i].closed_form for i in fit.support} - {None}
        return extended_bic(
            max(fit.misfit, self.floor),
            self.n_independent,
            len(fit.support),
            len(used),
            self.n_terms,
        )

    def of_size(self, size: int) -> list[Fit]:
        """Return the fits of one size, best first; exact ties in order of complexity.

        Best by the criterion and not by the misfit: a closed form has an inner parameter more
        than its polynomial limit, and so always fits as well.
        """
        ranked = sorted(
            (f for f in self.fits.values() if len(f.support) == size),
            key=lambda f: (self.criterion(f), f.misfit),
        )
        if not ranked:
            return []
        tied = [f for f in ranked if self.indistinguishable(f, ranked[0])]
        tied.sort(key=lambda f: self.complexity(f.support))
        return tied + [f for f in ranked if not self.indistinguishable(f, ranked[0])]

    def indistinguishable(self, first: Fit, second: Fit) -> bool:
        """Return whether two laws predict the same of every observation, to the floor."""
        return float(np.linalg.norm(first.predicted - second.predicted)) <= self.floor

    @property
    def n_refitted(self) -> int:
        """Number of supports that were fitted, on either grid."""
        return len(self.fits if self.scout is None else {*self.fits, *self.scout.fits})

    def run(self, say: Callable[[str], None]) -> list[Fit]:
        """Return the path: the best fit of each size, from empty to as dense as is of use.

        Parameters
        ----------
        say
            Called with a line of text now and then.
        """
        (self.scout or self)._explore(say)
        if self.scout is not None:
            self._take_over(self.scout)
        return self.polish()

    def _explore(self, say: Callable[[str], None]) -> None:
        """Fit supports of growing size until more terms are of no use."""
        empty = self._refit([()], {}, tolerance=POLISHING)[0]
        seeds = self._grow_horizon(empty, say)
        risen = 0
        for size in range(1, self.largest + 1):
            if size > 1:
                self._rescale(self.model_at(self.of_size(size - 1)[0]))
            parents = self.of_size(size - 1)[:2]
            breadth = 2 * BREADTH if size == 1 else BREADTH
            self._try(size, parents, seeds.get(size, {}), limit=breadth)
            for _ in range(_ROUNDS):
                before = self.of_size(size)[0].support
                if not self._try(size, self.of_size(size)[:1], {}, limit=BREADTH):
                    break
                if self.of_size(size)[0].support == before:
                    break
            if size > 1:
                # a redundant early pick leaves here
                best = self.of_size(size)[0]
                unseen = [s for s in removals(best.support) if s not in self.fits]
                self._refit(unseen, {s: best for s in unseen})
            best, previous = self.of_size(size)[0], self.of_size(size - 1)[0]
            say(
                f"{size} terms: misfit {best.misfit:.3g}, "
                + ", ".join(self.problem.library.names[i] for i in best.support)
            )
            risen = risen + 1 if self.criterion(best) >= self.criterion(previous) else 0
            if best.misfit <= self.floor or risen == 2:
                break

    def _take_over(self, scout: "SupportSearch") -> None:
        """Fit again, on the grid of this search, the best of each size that another one found."""
        self.history, self.scale = list(scout.history), scout.scale
        chosen: list[tuple[int, ...]] = [()]
        for size in range(1, max(map(len, scout.fits)) + 1):
            ranked = scout.of_size(size)
            limit = _CLOSE_BEHIND * ranked[0].misfit
            close = sum(fit.misfit <= limit for fit in ranked)
            chosen += [fit.support for fit in ranked[: min(max(close, _FEWEST_TAKEN), BREADTH)]]
        self._refit(chosen, {s: scout.fits[s] for s in chosen})

    def bring_near(self, chosen: Fit) -> None:
        """Fit on the grid of this search every law that may rival a chosen one."""
        if self.scout is None or chosen.support not in self.scout.fits:
            return
        limit = _WITHIN * self.scout.fits[chosen.support].misfit
        self._far = {s for s, fit in self.scout.fits.items() if fit.misfit > limit}
        near = [
            fit
            for fit in self.scout.fits.values()
            if fit.support not in self.fits
            and len(fit.support) <= len(chosen.support) + 1
            and fit.misfit <= limit
        ]
        near.sort(key=lambda fit: fit.misfit)
        self._refit([f.support for f in near[:_MOST_NEAR]], {f.support: f for f in near})

    def n_ruled_out(self, size: int) -> int:
        """Return how many laws up to a size fitted so badly on the rough grid that none rivals."""
        return sum(len(support) <= size for support in self._far - {*self.fits})

    def polish(self) -> list[Fit]:
        """Refit the best of each size, and its near ties, to a tight tolerance."""
        # where runs are costly, to far less than what a coefficient is known to
        tolerance = POLISHING if self.scout is None else SCREENING**2
        largest = max(len(s) for s in self.fits)
        chosen: list[tuple[int, ...]] = []
        for size in range(1, largest + 1):
            ranked = self.of_size(size)
            # what may turn out an exact tie once both are at their minimum
            limit = 1.001 * ranked[0].misfit + 10.0 * self.floor
            near = [f.support for f in ranked if f.misfit <= limit]
            chosen += near[: BREADTH if size == 1 else 4]
        self._refit(chosen, {s: self.fits[s] for s in chosen}, tolerance=tolerance)
        self._count_independent([self.of_size(size)[0] for size in range(largest + 1)])
        # read again: the criterion decides between closed forms and polynomials of one size
        return [self.of_size(size)[0] for size in range(largest + 1)]

    def _count_independent(self, path: Sequence[Fit]) -> None:
        """Count what the observations are worth, one number for the whole path.

        In correlated noise each further sample tells little, and a criterion that counts it whole
        takes terms that follow the noise. Counted first by what the densest law leaves, for that
        of a law that lacks a term is correlated for another reason; but terms that follow the noise
        take its slow part away, so then by what the chosen law leaves, as long as that is less.
        """
        worth = self._independent_in(path[-1])
        while worth < self.n_independent:
            self.n_independent = worth
            chosen = path[choose_by_bic(np.array([self.criterion(fit) for fit in path]))]
            worth = self._independent_in(chosen)

    def _independent_in(self, fit: Fit) -> float:
        records = self.problem.records
        if fit.misfit <= self.floor:
            return float(records.n_observations)
        left = fit.predicted - records.weighted_record
        rows = records.sequences()
        return noise_model([left[row] for row in rows], len(fit.support)).effective_samples

    def model_at(self, fit: Fit) -> LinearModel:
        """Return the linear model at a fit, made once."""
        if fit.support not in self._models:
            self._models[fit.support] = LinearModel.at(self.problem, fit)
        return self._models[fit.support]

    def _proposals(self, fit: Fit) -> list[tuple[int, ...]]:
        """Return the supports that the sparse optimiser proposes near a fit, found once."""
        if fit.support not in self._sparse:
            model = self.model_at(fit)
            solutions = solve_sparse(self.optimizer, model.design, model.target, self.largest)
            self._sparse[fit.support] = [s.support for s in solutions]
        return self._sparse[fit.support]

    def _grow_horizon(
        self, empty: Fit, say: Callable[[str], None]
    ) -> dict[int, dict[tuple[int, ...], Fit]]:
        """Return supports found on the beginnings of the runs, with their fits, by size."""
        order = np.asarray(self.problem.order_of_time)
        seeds: dict[int, dict[tuple[int, ...], Fit]] = {}
        current = empty
        for horizon in (*_HORIZONS, 1.0):
            keep = order <= horizon
            model = LinearModel.at(self.problem, current, keep)
            self._rescale(model)
            candidates = self._ranked(model, 1, all_of_size(1, self.n_terms))[: BREADTH // 2]
            if self.largest > 1:
                candidates += self._ranked(model, 2, all_of_size(2, self.n_terms))[:2]
            proposals = solve_sparse(self.optimizer, model.design, model.target, self.largest)
            small = [p.support for p in proposals if len(p.support) <= self.largest]
            candidates = distinct([*small, *candidates])[:BREADTH]
            fits = self._refit(candidates, {s: empty for s in candidates}, keep=keep)
            for fit in fits:
                seeds.setdefault(len(fit.support), {})[fit.support] = fit
            sane = [f for f in fits if f.misfit < 100.0]
            if sane:
                current = min(sane, key=self.criterion)
            say(f"first {horizon:.0%} of each run: misfit {current.misfit:.3g}")
        self._rescale(LinearModel.at(self.problem, current))
        return seeds

    def _rescale(self, model: LinearModel) -> None:
        """Take the size of coefficients from the present law: an early one may be far off."""
        self.scale = 1.0 / np.where(model.norms > 0, model.norms, 1.0)

    def _ranked(self, model: LinearModel, size: int, supports) -> list[tuple[int, ...]]:
        if not supports or size > self.n_terms:
            return []
        scores = model.scores(supports)
        return [supports[i] for i in np.argsort(scores, kind="stable")]

    def _try(self, size: int, centres: list[Fit], seeds: dict, limit: int) -> bool:
        """Refit the most promising unseen supports of a size; return whether there were any."""
        starts: dict[tuple[int, ...], Fit] = dict(seeds)
        candidates = [s for s in seeds if s not in self.fits]
        share = max(2, (limit - len(candidates)) // max(len(centres), 1))
        for centre in centres:
            model = self.model_at(centre)
            moves = additions if len(centre.support) < size else swaps
            near = self._ranked(model, size, distinct(moves(centre.support, self.n_terms)))
            far = self._ranked(model, size, all_of_size(size, self.n_terms)) if size <= 2 else []
            sparse = [s for s in self._proposals(centre) if len(s) == size]
            # by turns, so that no source of proposals crowds out another
            wanted = distinct(
                s for turn in zip(near, far[: len(near)] or near, strict=False) for s in turn
            )
            fresh = [s for s in distinct([*sparse, *wanted]) if s not in self.fits]
            for support in fresh[:share]:
                if support not in candidates:
                    candidates.append(support)
                    starts[support] = centre
        self._refit(candidates, starts)
        self._retry(candidates)
        return bool(candidates)

    def _retry(self, supports: list[tuple[int, ...]]) -> None:
        """Refit again, from the fits of their parts, supports that may have missed their minimum.

        Those are what fits worse than a part of itself, and closed forms: an inner parameter
        that an early fit drove to its bound has no slope there to come back by.
        """
        again = [
            (support, self.fits[part])
            for support in supports
            for part in removals(support)
            if part in self.fits
            and (
                self.fits[part].misfit < self.fits[support].misfit * (1.0 - 1e-6)
                or any(self.problem.library.terms[i].closed_form for i in support)
            )
        ]
        # from each such part: several may lead to different minima
        self._refit([s for s, _ in again], [fit for _, fit in again])

    def _refit(
        self,
        supports: list[tuple[int, ...]],
        starts: dict[tuple[int, ...], Fit] | list[Fit],
        keep: Bool[np.ndarray, "runs samples"] | None = None,
        tolerance: float = SCREENING,
    ) -> list[Fit]:
        """Refit supports; remember those that were fitted on all samples."""
        default = (np.zeros(self.n_terms), self.problem.library.inner_default)

        known = [starts.get(s) for s in supports] if isinstance(starts, dict) else starts
        begin = [default if k is None else (k.dense(self.n_terms), k.inner) for k in known]

        fits = refit(
            self.problem,
            supports,
            begin,
            self.scale,
            self.slots,
            None if keep is None else [keep] * len(supports),
            tolerance,
        )
        for fit in fits:
            if keep is None:
                old = self.fits.get(fit.support)
                if old is None or fit.misfit <= old.misfit:
                    self.fits[fit.support] = fit
                    self._models.pop(fit.support, None)
                self.history.append((fit.support, fit.misfit))
        return fits
