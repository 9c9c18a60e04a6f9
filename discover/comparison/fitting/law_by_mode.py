"""A law whose constants differ from mode to mode, beside the one law for all modes."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from discover.comparison.fitting.other_law_of_a_mode import OtherLaws, other_laws_of_modes
from discover.comparison.fitting.stresses_by_mode import bands_by_mode
from discover.comparison.outcomes.flows import QUANTITIES, Flow
from discover.dataset import Run
from discover.effects import ConstitutiveEffect, make_effect
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.forward.least_squares import Fit, intervals
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode import constants_by_mode
from discover.inference.constants import ConstantByMode
from discover.inference.degrees import Degree, choose_degrees, one_degree_more
from discover.inference.draws_by_mode import draw_constants
from discover.inference.evidence import INDISTINGUISHABLE
from discover.inference.problem import FitProblem, effect_of
from discover.inference.readings import beside_one_another, fitted_readings, unseen_readings
from discover.inference.small_faults import with_small_faults
from discover.inference.varying_constant import freer_fits
from discover.learners import RecoveredTerm
from discover.learners.tensor_sindy.rough_problem import enough_to_rank
from discover.statistics import LackOfFit
from discover.statistics.misread import Misread, clear_misreading
from discover.statistics.reading_faults import Reading
from discover.statistics.residual import Expectation
from discover.statistics.small_faults import small_faults
from discover.study.declared_model import DeclaredModel

_WITH_A_NAME = {"sigma.sigma": "giesekus_mobility", "tr(sigma)*sigma": "ptt_linear"}
"""Terms that a named effect adds, whose range is the one that its law has."""

_SLIP = "non_affine_motion"
_OWN = ("giesekus_mobility", "ptt_linear", "ptt_exponential")
_NAMED = (*((name,) for name in (*_OWN, _SLIP)), *((name, _SLIP) for name in _OWN))
"""What a rheologist lets differ from mode to mode: the constants of the classical laws in which
modes of a spectrum are independent, with slip of the network and without."""

_OF_THE_SPECTRUM = ("I", "sigma", "gammadot")
"""Terms that change the modulus or the time of a mode at small strain, which the sweep tells."""

_MOST_TERMS = 3

_STILL_IN = 2.0 * INDISTINGUISHABLE
"""Sets that are so far behind the best on few samples are not fitted on all: more samples raise
the evidence against them faster than that for a degree which few samples left open."""

_DRAWS = 40

_ARITHMETIC = 1e-4
"""Relative misfit that finite steps of the fit may leave."""

_STARTS = (1.0, 10.0)
"""Multiples of an effect's first trial, which is the size from which it shows."""


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


@dataclass(frozen=True)
class CoefficientsInModes:
    """What the runs say of each mode where the same coefficients in all of them explain the runs.

    Attributes
    ----------
    constants
        By spelling of the term.
    bands
        Of laws whose coefficients may differ from mode to mode, by the key of the flow.
    others
        Laws of which one mode follows another, that describe the runs as well.
    """

    constants: Mapping[str, ConstantByMode]
    bands: Mapping[str, PredictionBand]
    others: OtherLaws = field(default_factory=OtherLaws)

    @property
    def differ(self) -> bool:
        """Whether evidence asks for one that differs from mode to mode."""
        return any(one.degree for one in self.constants.values())


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
    problem = _problem(model, names, fitted, n_candidates)
    forward = problem.model
    rough, left_out = problem, ""
    few = [enough_to_rank(run) for run in fitted]
    # it has a program of its own to compile
    if not ranks_on_all and 2 * sum(map(len, few)) < sum(map(len, fitted)):
        rough = _problem(model, names, few, n_candidates)
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
            constants, bands = _told(problem, fit, degrees, seen, model, flows)
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


def coefficients_in_modes(
    model: DeclaredModel,
    terms: Sequence[RecoveredTerm],
    fitted: Sequence[Run],
    flows: Sequence[Flow] = (),
) -> CoefficientsInModes | None:
    """Return what the runs say of each mode's coefficients, where equal ones explain them.

    A mode that the flow hardly stretches may have any, which the intervals of common coefficients
    take no account of. None where a term changes what the sweep tells, or cannot be fitted.

    Parameters
    ----------
    model
        The known part: two modes or more.
    terms
        Of the law that explains the runs.
    fitted
        Runs without what a known instrument did.
    flows
        In which laws with coefficients by mode predict.
    """
    if any(term.term in _OF_THE_SPECTRUM or term.inner for term in terms):
        return None
    names = {_effect_of(term.term, term.coefficient): term.term for term in terms}
    problem = _problem(model, [*names], fitted, 1)
    fit, degrees = _fitted(problem, [*names])
    if not fit.usable:
        return None
    seen = fitted_readings(problem.model, problem.batch, fitted, fit)
    constants, bands = _told(problem, fit, degrees, seen, model, flows)
    if set(constants) != set(names):
        return None
    others = OtherLaws()
    if len(names) == 1:
        ((name, constant),) = constants.items()
        told = [one.relaxation_time_s for one in constant.told if one.ci95 is not None]
        others = other_laws_of_modes(model, name, told, fitted, flows)
    bands = others.held_by(bands)
    return CoefficientsInModes({names[name]: one for name, one in constants.items()}, bands, others)


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


def _told(
    problem: FitProblem,
    fit: Fit,
    degrees: Mapping[str, Degree],
    seen: Sequence[Reading],
    model: DeclaredModel,
    flows: Sequence[Flow],
) -> tuple[dict[str, ConstantByMode], dict[str, PredictionBand]]:
    """Return the constants of a fit by name, and its bands by the key of the flow."""
    forward = problem.model
    freer = freer_fits(forward, problem.batch, fit, degrees)
    bounds = intervals(forward, problem.batch, fit)
    small = small_faults(seen)
    count = len(fit.free)  # factors of loadings come after the constants
    beside = None if small is None else small.about_the_fit[:count, :count]
    bounds = with_small_faults(bounds, fit, forward, small)
    constants = constants_by_mode(forward, problem.batch, fit, bounds, degrees, freer, beside)
    drawn = draw_constants(problem, fit, degrees, freer, _DRAWS, beside=beside)
    if drawn is None:
        return constants, {}
    found = (effect_of(forward, name) for name in drawn.names)
    effects = [effect for effect in found if isinstance(effect, ConstitutiveEffect)]
    inner = {name: fit.theta[forward.positions(name)[1:]] for name in drawn.names}
    return constants, bands_by_mode(drawn, effects, inner, model.fluid, flows)


def _without_n2(band: PredictionBand) -> PredictionBand:
    known = np.where(np.arange(3) == QUANTITIES.index("N2"), np.nan, 1.0)
    names = ("chosen", "low", "high", "rivals_low", "rivals_high")
    return replace(band, **{name: known * getattr(band, name) for name in names})


def _problem(
    model: DeclaredModel, names: Sequence[str], fitted: Sequence[Run], n_candidates: int
) -> FitProblem:
    effects = {name: make_effect(name) for name in names}
    declared = model.without_effects(by_mode=tuple(effects))
    forward = AugmentedModel(declared, list(effects.values()), data_scales(fitted))
    return FitProblem(forward, make_batch(fitted), n_candidates)


def _candidate_sets(path: Sequence[Mapping[str, Any]]) -> list[tuple[str, ...]]:
    """Return the sets of effects to try: those of the classical laws, and those of the path."""
    sets: list[tuple[str, ...]] = [*_NAMED]
    for row in path:
        terms = row["support"]
        if not 0 < len(terms) <= _MOST_TERMS or set(terms) & {*_OF_THE_SPECTRUM} or row["inner"]:
            continue
        sets.append(tuple(map(_effect_of, terms, row["coefficients"])))
    return list(dict.fromkeys(sets))


def _effect_of(term: str, coefficient: float) -> str:
    """Return the effect that adds a term with this coefficient."""
    named = _WITH_A_NAME.get(term)
    if named is None:
        return term
    amplitude = make_effect(named).parameters[0]
    return named if amplitude.low <= coefficient <= amplitude.high else term


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
    found = [_fitted(problem, of_set) for of_set in sets]
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


def _fitted(problem: FitProblem, names: Sequence[str]) -> tuple[Fit, dict[str, Degree]]:
    """Return the fit of these effects, each with the degree that evidence asks for."""
    model = problem.model
    free = [position for name in names for position in model.positions(name)]
    starts = []
    for factor in _STARTS:
        start = model.zero()
        for name in names:
            amplitude = effect_of(model, name).parameters[0]
            start[model.positions(name)[0]] = factor * amplitude.first_trial
        starts.append(start)
    fit = problem.best_fit(starts, free)
    degrees = {name: Degree() for name in names}
    return choose_degrees(problem, fit, degrees) if fit.usable else (fit, degrees)


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
