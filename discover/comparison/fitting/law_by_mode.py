"""A law whose constants differ from mode to mode, beside the one law for all modes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from discover.comparison.fitting.fits_by_mode import (
    OF_THE_SPECTRUM,
    effect_of_term,
    fitted_by_mode,
    problem_by_mode,
    told_by_mode,
)
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.dataset import Run
from discover.forward import AugmentedModel, make_batch
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.degrees import Degree, choose_degrees, one_degree_more
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem
from discover.inference.readings import beside_one_another, fitted_readings, unseen_readings
from discover.learners.tensor_sindy.rough_problem import enough_to_rank
from discover.statistics import LackOfFit
from discover.statistics.reading.misread import Misread, clear_misreading
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel

_SLIP = "non_affine_motion"
_OWN = ("giesekus_mobility", "ptt_linear", "ptt_exponential")
_NAMED = (*((name,) for name in (*_OWN, _SLIP)), *((name, _SLIP) for name in _OWN))
"""What a rheologist lets differ from mode to mode: the constants of the classical laws in which
modes of a spectrum are independent, with slip of the network and without."""

_MOST_TERMS = 3

_STILL_IN = 2.0 * INDISTINGUISHABLE
"""Sets that are so far behind the best on few samples are not fitted on all: more samples raise
the evidence against them faster than that for a degree which few samples left open."""

_ARITHMETIC = 1e-4
"""Relative misfit that finite steps of the fit may leave."""


@dataclass(frozen=True)
class SparseLaw:
    """The law of sparse regression, as the one law for all modes to compare with.

    Attributes
    ----------
    terms
        Its terms.
    n_constants
        Coefficients and inner constants.
    predicted
        What it predicts of each fitted run.
    """

    terms: Sequence[str]
    n_constants: int
    predicted: Sequence[np.ndarray]


@dataclass(frozen=True)
class LawByMode:
    """A law whose constants are smooth functions of the relaxation time.

    Attributes
    ----------
    constants
        By name of the effect, or by spelling of the term.
    left
        What it leaves of the fitted runs.
    gain
        By how much the information criterion is below that of the law of sparse regression; both
        pay for the choice of their terms.
    errors
        Relative errors of σ12 in runs that no fit saw, by name; None where it runs away.
    bands
        What it predicts, by the key of the flow; N2 is nan where terms without a name, which σ12
        alone spoke for, leave it open.
    refuted
        Whether it explains the fitted runs, and runs held out speak against it.
    misread
        How else the runs were read, if it describes them clearly better so.
    left_out
        What was not fitted, to save time, in words; empty for nothing.
    """

    constants: Mapping[str, ConstantByMode]
    left: LackOfFit
    gain: float
    errors: Mapping[str, float | None]
    bands: Mapping[str, PredictionBand] = field(default_factory=dict)
    refuted: bool = False
    misread: Misread | None = None
    left_out: str = ""

    @property
    def explains(self) -> bool:
        """Whether what it leaves is noise, in runs held out too."""
        return self.left.verdict == "explained"

    @property
    def rivals_sparse(self) -> bool:
        """Whether it is worth about as much as the law of sparse regression, or more."""
        return self.gain > -INDISTINGUISHABLE

    @property
    def n_constants(self) -> int:
        """Number of constants fitted."""
        return sum(one.n_constants for one in self.constants.values())

    def to_json(self) -> dict[str, Any]:
        """Return the law as ``comparison.json`` holds it."""
        return {
            "constants": {name: asdict(one) for name, one in self.constants.items()},
            "misfit": self.left.misfit,
            "verdict": self.left.verdict,
            "reason": self.left.reason,
            "criterion_below_sparse": self.gain,
            "errors": dict(self.errors),
            "bands": {key: band.to_json() for key, band in self.bands.items()},
        }


def fit_laws_by_mode(
    model: DeclaredModel,
    path: Sequence[Mapping[str, Any]],
    sparse: SparseLaw,
    fitted: Sequence[Run],
    held_out: Sequence[Run],
    expectation: Expectation,
    n_candidates: int,
    flows: Sequence[Flow] = (),
    ranks_on_all: bool = False,
) -> Iterator[LawByMode]:
    """Return the best law with constants by mode, then the same with more degrees in log λ.

    None where no constant of the best differs from mode to mode. Of more degrees none is returned
    that runs away in a run held out. The terms are those of the path of
    sparse regression up to three, and those of Giesekus, of both laws of Phan-Thien and Tanner and
    of Johnson and Segalman. Each constant has the degree in log λ that evidence asks for, so that
    one constant for all modes stays where nothing speaks against it; then one degree more as often
    as a law is asked for.

    To save time the terms are ranked on as few samples as sparse regression ranks its own, and
    those that stay are fitted on all.

    Parameters
    ----------
    model
        The known part: two modes or more.
    path
        Rows of the path of sparse regression: ``support``, ``coefficients``, ``inner``.
    sparse
        The law that it chose, to compare with.
    fitted, held_out
        Runs without what a known instrument did.
    expectation
        What a complete law may leave.
    n_candidates
        Number of terms in the library, the choice among which every term pays for.
    flows
        In which it predicts.
    ranks_on_all
        Whether every set of terms is fitted on all samples.
    """
    sets = _candidate_sets(path)
    names = [name for of_set in sets for name in of_set]
    problem = problem_by_mode(model, names, fitted, n_candidates)
    forward = problem.model
    rough, left_out = problem, ""
    few = [enough_to_rank(run) for run in fitted]
    # it has a program of its own to compile
    if not ranks_on_all and 2 * sum(map(len, few)) < sum(map(len, fitted)):
        rough = problem_by_mode(model, names, few, n_candidates)
        ranked = _best_first(rough, sets)
        kept = [tuple(one.degrees) for one in ranked if one.behind < _STILL_IN]
        sets, left_out = kept, _left_out(len(sets) - len(kept), len(sets), max(map(len, few)))
    best = next(iter(_best_first(problem, sets)), None)
    if best is None or not any(one.degree for one in best.degrees.values()):
        return
    fit, degrees, effective = best.fit, best.degrees, best.effective
    worth = _worth_of(sparse, problem, fitted, effective)
    is_first = True
    while fit.usable:
        errors = _errors(forward, fit, held_out)
        # one of more degrees that runs away in runs held out is no better answer than the first
        if is_first or None not in errors.values():
            seen = fitted_readings(forward, problem.batch, fitted, fit)
            constants, bands = told_by_mode(problem, fit, degrees, seen, model, flows)
            left = problem.lack_of_fit(fit, fitted, expectation)
            if tuple(degrees) not in _NAMED:
                bands = {key: _without_n2(band) for key, band in bands.items()}
            yield LawByMode(
                constants,
                left,
                worth - problem.worth(fit, [*degrees], effective),
                errors,
                bands,
                misread=_misread(problem, fit, left, seen, held_out, expectation),
                left_out=left_out,
            )
        is_first = False
        least = one_degree_more(forward, degrees)
        before = degrees
        if not least:
            return
        fit, degrees = choose_degrees(rough, fit, degrees, least)
        if all(degrees[name].degree == one.degree for name, one in before.items()):
            return
        fit = problem.fit(fit.theta, fit.free)


def _misread(
    problem: FitProblem,
    fit: Fit,
    left: LackOfFit,
    seen: Sequence[Reading],
    held_out: Sequence[Run],
    expectation: Expectation,
) -> Misread | None:
    """Return how else the runs were read, if a law by mode describes them clearly better so."""
    known = expectation.noise is not None and left.misfit <= left.expected
    if left.verdict != "explained" or known:
        return None
    model = problem.model
    sets = [seen]
    if held_out:
        unseen = unseen_readings(model, make_batch(held_out), held_out, fit, fit.theta)
        own, others = beside_one_another(seen, unseen, len(fit.free))
        sets.append([*own, *others])
    return clear_misreading(sets, expectation, _ARITHMETIC)


def _without_n2(band: PredictionBand) -> PredictionBand:
    known = np.where(np.arange(3) == QUANTITIES.index("N2"), np.nan, 1.0)
    names = ("chosen", "low", "high", "rivals_low", "rivals_high")
    return replace(band, **{name: known * getattr(band, name) for name in names})


def _candidate_sets(path: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return the sets of effects to try: those of the classical laws, and those of the path."""
    sets: list[tuple[str, ...]] = [*_NAMED]
    for row in path:
        terms = row["support"]
        if not 0 < len(terms) <= _MOST_TERMS or set(terms) & {*OF_THE_SPECTRUM} or row["inner"]:
            continue
        sets.append(tuple(map(effect_of_term, terms, row["coefficients"])))
    return list(dict.fromkeys(sets))


def _left_out(count: int, total: int, samples: int) -> str:
    if not count:
        return ""
    return (
        f"{count} of {total} sets of terms were ranked on at most {samples} samples of a run and "
        "fitted no further, to save time (recipe 'thorough' fits all on all)."
    )


@dataclass(frozen=True)
class _Ranked:
    """A set of effects as it was fitted, and by how much its criterion is above the least."""

    fit: Fit
    degrees: Mapping[str, Degree]
    behind: float
    effective: float


def _best_first(problem: FitProblem, sets: Sequence[Sequence[str]]) -> list[_Ranked]:
    """Return the sets of effects that can be fitted, those of the least criterion first."""
    found = [fitted_by_mode(problem, of_set) for of_set in sets]
    usable = [(fit, degrees) for fit, degrees in found if fit.usable]
    if not usable:
        return []
    effective = problem.independent_samples(min((fit for fit, _ in usable), key=problem.cost))
    worth = [problem.worth(fit, [*degrees], effective) for fit, degrees in usable]
    ranked = [
        _Ranked(*one, behind, effective)
        for one, behind in zip(usable, np.array(worth) - min(worth), strict=True)
    ]
    return sorted(ranked, key=lambda one: one.behind)


def _worth_of(law: SparseLaw, problem: FitProblem, runs: Sequence[Run], effective: float) -> float:
    """Return the criterion of a law by what it leaves of the fitted runs."""
    off = (
        run.weight * (predicted - run.recorded) / run.sizes(run.recorded)
        for predicted, run in zip(law.predicted, runs, strict=True)
    )
    cost = sum(float(np.mean(one**2)) for one in off)
    return problem.criterion(cost, range(law.n_constants), law.terms, effective)


def _errors(model: AugmentedModel, fit: Fit, runs: Sequence[Run]) -> dict[str, float | None]:
    if not runs:
        return {}
    with np.errstate(over="ignore", invalid="ignore"):
        # a law may run away in a held-out flow
        residual = model.residuals([fit.theta], make_batch(runs))[0]
        errors = np.sqrt(np.sum(residual**2, axis=1))
    return {
        run.name: float(error) if np.isfinite(error) else None
        for run, error in zip(runs, errors, strict=True)
    }
