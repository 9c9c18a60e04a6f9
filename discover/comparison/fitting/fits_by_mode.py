"""Effects of the fluid fitted with a constant of their own in every mode."""

from collections.abc import Mapping, Sequence

from discover.comparison.fitting.stresses_by_mode import bands_by_mode
from discover.comparison.outcomes.flows import Flow
from discover.dataset import Run
from discover.effects import ConstitutiveEffect, make_effect
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode.as_fitted import constants_by_mode
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.degrees import Degree, choose_degrees
from discover.inference.by_mode.draws import draw_constants
from discover.inference.by_mode.varying_constant import freer_fits
from discover.inference.fit_uncertainty import intervals
from discover.inference.least_squares import Fit
from discover.inference.problem import FitProblem, effect_of
from discover.inference.small_faults import with_small_faults
from discover.statistics.reading.reading_faults import Reading
from discover.statistics.reading.small_faults import small_faults
from discover.study.declared_model import DeclaredModel

_WITH_A_NAME = {"sigma.sigma": "giesekus_mobility", "tr(sigma)*sigma": "ptt_linear"}
"""Terms that a named effect adds, whose range is the one that its law has."""

OF_THE_SPECTRUM = ("I", "sigma", "gammadot")
"""Terms that change the modulus or the time of a mode at small strain, which the sweep tells."""

_DRAWS = 40

_STARTS = (1.0, 10.0)
"""Multiples of an effect's first trial, which is the size from which it shows."""


def problem_by_mode(
    model: DeclaredModel, names: Sequence[str], fitted: Sequence[Run], n_candidates: int
) -> FitProblem:
    """Return the question which constants effects with these names have in each mode."""
    effects = {name: make_effect(name) for name in names}
    declared = model.without_effects(by_mode=tuple(effects))
    batch = make_batch(fitted)
    forward = AugmentedModel(declared, list(effects.values()), data_scales(fitted), batch)
    return FitProblem(forward, batch, n_candidates)


def fitted_by_mode(problem: FitProblem, names: Sequence[str]) -> tuple[Fit, dict[str, Degree]]:
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


def told_by_mode(
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


def effect_of_term(term: str, coefficient: float) -> str:
    """Return the effect that adds a term with this coefficient."""
    named = _WITH_A_NAME.get(term)
    if named is None:
        return term
    amplitude = make_effect(named).parameters[0]
    return named if amplitude.low <= coefficient <= amplitude.high else term
