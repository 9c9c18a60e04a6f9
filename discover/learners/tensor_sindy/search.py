"""Search among supports: a sparse optimiser proposes, the engine fits and weighs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.effects.library_term import library_term
from discover.errors import InputError
from discover.inference.fits import Fit, Fitter
from discover.inference.problem import Problem
from discover.inference.search import Key, Search
from discover.laws import Fluid
from discover.learners.lack_of_fit import declared_as
from discover.learners.settings import ARITHMETIC
from discover.learners.tensor_sindy.optimisers import solve_sparse
from discover.progress import require_wanted
from tensor_library.library import TermLibrary

_STEP = 1e-4
"""Of the width of a prior: step of a difference."""

_NEGLIGIBLE = 1e-6
"""Prior width below which a nuisance is nothing that a coefficient could be mistaken for."""


def library_problem(
    runs: Sequence[Run], library: TermLibrary, known: Fluid, use_normal_stresses: bool
) -> Problem:
    """Return the problem of finding library terms beside a known part, in fluid and noise alone.

    Errors of the known moduli are nuisances; instrument effects are for a closed loop or `compare`.
    `use_normal_stresses`: whether measured N1 and N2 are fitted too. Raises InputError if normal
    stresses would be fitted twice.
    """
    observed = list(runs)
    if use_normal_stresses:
        own = [run.name for run in runs if run.quantity in ("N1", "N2")]
        if own:
            raise InputError(
                f"{own[0]!r} is a record of its own, which use_normal_stresses would fit once "
                "more. Leave out one of the two."
            )
        observed += [run.observing(quantity) for run in runs for quantity in run.also_recorded]
    terms = [library_term(term) for term in library.terms]
    return Problem(declared_as(known), terms, observed, computed=True)


@dataclass(frozen=True)
class LinearModel:
    """y − σ(c₀) + S c₀ ≈ S c: the records near a trial law, linear in the coefficients."""

    # S over the noise, orthogonal to the nuisances, compressed to as many rows as unknowns
    design: Float[np.ndarray, "rows n"]
    target: Float[np.ndarray, " rows"]  # the left-hand side, likewise

    @classmethod
    def at(cls, fitter: Fitter, fit: Fit, names: Sequence[str]) -> "LinearModel":
        """Return the model at a fitted hypothesis, over the amplitudes of the terms named."""
        assert fit.jacobian is not None
        problem = fitter.problem
        at = [problem.model.positions(name)[0] for name in names]
        steps = np.array([_STEP * problem.amplitude(name).width for name in names])
        steps = np.where(fit.theta[at] + steps > problem.model.high[at], -steps, steps)
        thetas = np.tile(fit.theta, (len(at), 1))
        thetas[np.arange(len(at)), at] += steps
        with np.errstate(over="ignore", invalid="ignore"):  # a term that diverges
            columns = (fitter.predict(list(thetas)) - fit.predicted).T / steps
        columns = np.where(np.all(np.isfinite(columns), axis=0), columns, 0.0)
        record = fitter.record(fit)
        target = fitter.rows.recorded - record + columns @ fit.theta[at]
        widths = np.concatenate([fit.priors.widths, fitter.errors.widths(fit.linear)])
        amplitudes = set(at)
        other = [
            i
            for i, width in enumerate(widths)
            if width > _NEGLIGIBLE and not (i < len(fit.free) and fit.free[i] in amplitudes)
        ]
        both = np.column_stack([fit.jacobian[:, other], columns, target])
        white = fitter.noise_of(fit).whitened(both, record, fit.noise)
        if other:
            # nuisances with their priors as further rows, and what they imitate taken out
            prior = np.zeros((len(other), both.shape[1]))
            prior[np.arange(len(other)), np.arange(len(other))] = 1.0 / widths[other]
            white = np.vstack([white, prior])
            basis = np.linalg.qr(white[:, : len(other)])[0]
            white = white[:, len(other) :]
            white = white - basis @ (basis.T @ white)
        triangular = np.asarray(np.linalg.qr(white, mode="r"))
        return cls(triangular[:, :-1], triangular[:, -1])

    def solved(self, support: Sequence[int]) -> Float[np.ndarray, " q"]:
        """Return the least-squares coefficients of some terms."""
        return np.linalg.lstsq(self.design[:, list(support)], self.target, rcond=None)[0]


_BEAM = 3
"""Laws from which one round of the search goes on, the likeliest."""

_MORE = 6
"""Laws with one term more that are fitted, of all that are scored beside others. Beside no term all
are: a known part that misses strong flows by their size scores the right term behind 40 others."""

_SAME = 0.01
"""Difference of predictions over the noise below which no record of these runs tells laws apart."""

_NEAR, _MOST_NEAR = 12.0, 24
"""Log odds below the best, and number, of laws that are fitted to the end."""


class SupportSearch(Search):
    """Search among supports.

    Near a trial law the records are linear in the coefficients: a sparse optimiser proposes
    supports of any size, and every further term is scored. All are fitted, and the search goes on
    from the likeliest until no proposal is likelier. `most`: largest support. `say`: takes a line
    of text.
    """

    def __init__(
        self, fitter: Fitter, library: TermLibrary, optimizer, most: int, say: Callable[[str], None]
    ):
        super().__init__(fitter, min(most, len(library)), say)
        self.library, self.optimizer = library, optimizer
        self.places = {name: i for i, name in enumerate(library.names)}
        self._models: dict[Key, LinearModel] = {}

    def support(self, fit: Fit) -> tuple[int, ...]:
        """Return the positions of the terms of a fit in the library, increasing."""
        return tuple(sorted(self.places[name] for name in fit.names))

    def difference(self, one: Fit, other: Fit) -> float:
        """Return the relative root-mean-square difference of two predictions."""
        rows = self.fitter.rows
        off = (self.fitter.record(one) - self.fitter.record(other)) / rows.size
        return float(np.sqrt(np.mean(off**2)))

    def indistinguishable(self, one: Fit, other: Fit) -> bool:
        """Return whether no record of these runs distinguishes two fits."""
        return self.difference(one, other) <= max(_SAME * other.noise.common, ARITHMETIC)

    def complexity(self, fit: Fit) -> tuple:
        """Return the order in which indistinguishable fits are preferred, the simplest first."""
        terms = [self.library.terms[i] for i in self.support(fit)]
        return (
            len(terms),
            sum(term.complexity for term in terms),
            sum(term.degree for term in terms),
            self.support(fit),
        )

    def add(self, starts: Iterable[Fit], wanted: int | None = None) -> list[Fit]:
        """Fit hypotheses side by side and keep them; of one set the likeliest."""
        require_wanted()
        return super().add(starts, wanted)

    def run(self) -> "SupportSearch":
        """Find supports from the empty one on."""
        (empty,) = self.add([self.fitter.start((), self.problem.zero)])
        asked: set[Key] = set()
        highest = -np.inf
        while self.ranked() and self.rank(self.ranked()[0]) > highest:
            highest = self.rank(self.ranked()[0])
            centres = [fit for fit in self.ranked() if frozenset(fit.names) not in asked][:_BEAM]
            starts: dict[Key, tuple[Fit, Fit]] = {}
            for centre in centres:
                asked.add(frozenset(centre.names))
                for start in self._proposed(centre):
                    key = frozenset(start.names)
                    if key not in self.found:
                        starts.setdefault(key, (start, centre))
            fits = self.add(start for start, _ in starts.values())
            # what diverges where the linear model puts it begins at the law it was made at
            lost = [
                self.fitter.start(fit.names, centre.theta, centre.linear)
                for fit, (_, centre) in zip(fits, starts.values(), strict=True)
                if not np.isfinite(fit.log_posterior)
            ]
            self.add(lost)
            best = self.ranked()[0] if self.ranked() else empty
            self.say(f"{len(self.found)} laws fitted; {', '.join(best.names) or 'no term'}")
        self.backwards()
        self.exchange()
        self.backwards()
        self._finish()
        return self

    def _finish(self) -> None:
        """Fit laws that may be the answer, and the best of each size, to the end."""
        alive = self.ranked()
        near = [fit for fit in alive if self.rank(fit) > self.rank(alive[0]) - _NEAR][:_MOST_NEAR]
        known = {id(fit) for fit in near}
        near += [fit for fit in self.path() if id(fit) not in known]
        self._models.clear()
        self.fitter.fit(near, rounds=2)

    def path(self) -> list[Fit]:
        """Return the best fit of each size, from empty to as dense as was tried."""
        found = []
        for size in range(self.most + 1):
            ranked = [fit for fit in self.ranked() if len(fit.names) == size]
            if not ranked:
                break
            tied = [fit for fit in ranked if self.indistinguishable(fit, ranked[0])]
            found.append(min(tied, key=self.complexity))
        return found

    def model_at(self, fit: Fit) -> LinearModel:
        """Return the linear model at a fit, made once."""
        key = frozenset(fit.names)
        if key not in self._models:
            self._models[key] = LinearModel.at(self.fitter, fit, self.library.names)
        return self._models[key]

    def scored(self, fit: Fit) -> list[Fit]:
        """Return supports with one term more, of each closed form one at most."""
        if len(fit.names) >= self.most:
            return []
        return [start for start in super().scored(fit) if self._is_a_law(start.names)]

    def _is_a_law(self, names: Sequence[str]) -> bool:
        """Return whether a law can be of these terms: of a closed form it has one constant."""
        forms = [self.library.terms[self.places[name]].closed_form for name in names]
        closed = [form for form in forms if form is not None]
        return len(set(closed)) == len(closed)

    def _proposed(self, fit: Fit) -> list[Fit]:
        """Return supports that are promising near a fit, ready to be fitted."""
        if fit.jacobian is None:
            return []
        model, found = self.model_at(fit), []
        for support in solve_sparse(self.optimizer, model.design, model.target, self.most):
            names = tuple(self.library.names[i] for i in support)
            if len(names) > self.most or not self._is_a_law(names):
                continue
            gone = [name for name in fit.names if name not in names]
            theta = self.problem.without(fit.theta, *gone)
            for name, value in zip(names, model.solved(support), strict=True):
                theta[self.problem.model.positions(name)[0]] = value
            found.append(self.fitter.start(names, theta, fit.linear))
        return [*found, *self.scored(fit)[: _MORE if fit.names else None]]
