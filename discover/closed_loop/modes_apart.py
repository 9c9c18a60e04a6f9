"""What the runs say of each mode's constant, where one constant for all modes explains them.

One constant that meets the noise does not show that the modes share it. A mode that the flow hardly
stretches may have any, and the interval of the common one, which takes it for granted, says nothing
of that.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from discover.closed_loop.search import Search
from discover.effects import AbstractEffect, make_effect
from discover.forward import AugmentedModel
from discover.inference.by_mode.as_fitted import constants_by_mode
from discover.inference.by_mode.constants import ConstantByMode, ModeConstant
from discover.inference.by_mode.degrees import Degree, choose_degrees
from discover.inference.by_mode.other_law_of_a_mode import ONE_CONSTANT, laws_as_good
from discover.inference.by_mode.varying_constant import freer_fits
from discover.inference.fit_uncertainty import intervals
from discover.inference.least_squares import Fit, Prior
from discover.inference.modulus_errors import modulus_shifts
from discover.inference.problem import FitProblem, effect_of


def modes_apart(
    search: Search, names: Sequence[str], scales: Mapping[str, float]
) -> dict[str, ConstantByMode]:
    """Return what a search left open of constants by mode, by name; empty if that has no fit.

    The interval of each mode holds those of one constant for all modes and of one that is linear in
    log λ. Beside the effects that were found there are no others in the model: a program of those
    alone compiles fast.

    Parameters
    ----------
    search
        A finished search in a fluid of several modes, none of whose constants may differ so far.
    names
        Of free parameters of the law, and of effects in the model that may differ by mode.
    scales
        Of the data, as the model of the search has them.
    """
    active = [effect_of(search.model, name) for name in search.active]
    problem, fit = _fitted_again(search, names, active, scales)
    model = problem.model
    if not fit.usable:
        return {}
    _, chosen = choose_degrees(problem, fit, {name: Degree() for name in names})
    alike = {name: Degree(0, one.evidence) for name, one in chosen.items()}
    shifts = modulus_shifts(model, fit.theta, search.batch)
    bounds = intervals(model, search.batch, fit, shifts)
    freer = freer_fits(model, search.batch, fit, alike, problem.prior)
    return constants_by_mode(model, search.batch, fit, bounds, alike, freer)


def with_other_laws(
    search: Search, found: Mapping[str, ConstantByMode], scales: Mapping[str, float]
) -> dict[str, ConstantByMode]:
    """Return constants by mode, those left open whose mode may follow another law.

    It is asked where one classical law of one constant explains the runs, beside whatever else.

    Parameters
    ----------
    search
        A finished search in a fluid of several modes.
    found
        What it left open of each mode.
    scales
        Of the data, as the model of the search has them.
    """
    told = dict(found)
    laws = [name for name in found if name in ONE_CONSTANT]
    known = {one.name for one in search.model.declared.effects}
    if len(laws) != 1 or known & set(ONE_CONSTANT) or laws[0] not in search.active:
        return told
    (name,) = laws
    effects = {one: effect_of(search.model, one) for one in search.active}
    effects |= {one: make_effect(one) for one in ONE_CONSTANT if one not in effects}
    problem, same = _fitted_again(search, ONE_CONSTANT, list(effects.values()), scales)
    if same.usable:
        modes = tuple(
            one if one.ci95 is None else _open_to(one, laws_as_good(problem, same, name, at))
            for at, one in enumerate(told[name].modes)
        )
        told[name] = replace(told[name], modes=modes)
    return told


def _fitted_again(
    search: Search,
    names: Sequence[str],
    effects: Sequence[AbstractEffect],
    scales: Mapping[str, float],
) -> tuple[FitProblem, Fit]:
    """Return what a search found, fitted where constants with these names may differ by mode.

    They do not differ in the fit. The effects hold those that the search found.
    """
    before = search.model
    # one declared mode has another beside it that was found, or known
    added = 1 if len(before.declared.modulus) == 1 else 0
    declared = replace(before.declared, by_mode=tuple(names), added_modes=added)
    model = AugmentedModel(declared, list(effects), scales)
    places = places_in(before, model, search.active)
    problem = FitProblem(model, search.batch, 1, prior_in(search.prior, places))
    start = model.zero()
    start[[*places.values()]] = search.fit.theta[[*places]]
    return problem, problem.fit(start, [places[at] for at in search.fit.free])


def _open_to(mode: ModeConstant, others: Mapping[str, Fit]) -> ModeConstant:
    """Return a mode that may follow other laws; if there are any, its constant says nothing."""
    if not others:
        return mode
    return replace(mode, ci95=None, left_open=True, other_laws=tuple(others))


def places_in(
    before: AugmentedModel, model: AugmentedModel, active: Sequence[str]
) -> dict[int, int]:
    """Return where each parameter of a model stands in one with constants by mode.

    Parameters
    ----------
    before, model
        The two models.
    active
        Effects whose parameters are asked for, beside those of the declared model.
    """
    first = 2 + len(before.declared.free_parameters)
    places = {at: at for at in range(first)}
    for name in [*(known.name for known in before.declared.effects), *active]:
        places |= dict(zip(before.positions(name), model.positions(name), strict=True))
    instants = range(before.instants.start, before.instants.stop)
    places |= dict(zip(instants, range(model.instants.start, model.instants.stop), strict=True))
    return places


def prior_in(prior: Prior, places: Mapping[int, int]) -> Prior:
    """Return what is known of parameters where they stand at other places."""
    kept = [i for i, at in enumerate(prior.positions) if at in places]
    return Prior(
        tuple(places[prior.positions[i]] for i in kept),
        tuple(prior.mean[i] for i in kept),
        tuple(prior.weight[i] for i in kept),
    )
