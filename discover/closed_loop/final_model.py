"""The final model, as the result of a closed loop holds it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import jax.numpy as jnp
import numpy as np

from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.stages import (
    DeclaredEffect,
    KnownParameter,
    Stage,
)
from discover.closed_loop.search import Search
from discover.effects import ConstitutiveEffect, ModeEffect, StateEffect
from discover.equations import AugmentedLaw, Equation, NamedPart, StatePart, law_parts
from discover.errors import InputError
from discover.forward import MODULUS, RELAXATION_TIME, AugmentedModel, Batch, DeclaredModel
from discover.inference.by_mode.constants import ConstantByMode, StageParameter, ToldTogether
from discover.inference.least_squares import Fit
from discover.inference.told_together import product_or_ratio
from discover.laws import LAWS, Fluid
from discover.laws.each_mode import with_modes

Bounds = Mapping[int, tuple[float, float]]
"""Ends of the 95 % interval of what is fitted, by its position."""


def stage_of(
    search: Search,
    name: str,
    bounds: tuple[Bounds, Bounds],
    error: ErrorPair,
    by_mode: ConstantByMode | None,
    possible: Sequence[np.ndarray],
) -> Stage:
    """Return one effect of the final model, as a stage of the way to it.

    Parameters
    ----------
    bounds
        Intervals given the effects of the final model, and over all explanations.
    error
        Errors once this effect was added.
    by_mode
        Its constant in each mode, where that differs.
    possible
        Constants far from the fit that the runs do not exclude.
    """
    model, fit = search.model, search.fit
    effect = next(e for e in model.effects if e.name == name)
    parameters = {
        p.name: StageParameter(
            float(fit.theta[at]), bounds[1][at], p.unit, ci95_given_effects=bounds[0][at]
        )
        for p, at in zip(effect.parameters, model.positions(name), strict=True)
    }
    if by_mode is not None:
        first = effect.parameters[0].name
        parameters[first] = with_shared_interval(by_mode, parameters[first])
    places = dict(zip(parameters, model.positions(name), strict=True))
    left_open = tuple(
        name
        for name, parameter in parameters.items()
        if parameter.is_open_up_to(float(model.high[places[name]]))
    )
    return Stage(
        effect=name,
        kind=effect.kind,
        parameters=parameters,
        aliases=tuple(
            other
            for other in search.aliases.get(name, ())
            if other not in search.active and other not in search.refused
        ),
        error=error,
        evidence=search.support.get(name, 0.0),
        equation=effect.equation,
        source=effect.source,
        check=effect.check,
        left_open=left_open,
        told_together=told_together(
            search.batch, fit, possible, {name: parameters[name] for name in left_open}, places
        ),
    )


def told_together(
    batch: Batch,
    fit: Fit,
    possible: Sequence[np.ndarray],
    parameters: Mapping[str, StageParameter],
    places: Mapping[str, int],
) -> tuple[ToldTogether, ...]:
    """Return products and ratios that the runs tell of constants that they leave open.

    Parameters
    ----------
    batch, fit, possible
        The fitted runs, the fit, and constants far from it that the runs do not exclude.
    parameters, places
        Constants of an effect that are left open, and where all of them stand.
    """
    found = []
    for first, second in combinations(parameters, 2):
        told = product_or_ratio(batch, fit, possible, places[first], places[second])
        if told is not None:
            is_ratio, value, ends = told
            of_first, of_second = parameters[first].unit, parameters[second].unit
            joined = " ".join(filter(None, (of_first, of_second)))
            unit = f"{of_first or 1}/{of_second}" if is_ratio and of_second else joined
            found.append(ToldTogether((first, second), is_ratio, value, ends, unit))
    return tuple(found)


def with_shared_interval(by_mode: ConstantByMode, shared: StageParameter) -> ConstantByMode:
    """Return a constant by mode with the interval that all modes share, where they share one.

    Parameters
    ----------
    by_mode
        The constant with what is known of each mode.
    shared
        The constant as fitted for all modes: its interval over all explanations is held too, and
        that given the effects takes it that all modes have the same.
    """
    if by_mode.degree:
        return by_mode
    ends = np.array([by_mode.ci95, shared.ci95])
    held = float(ends[:, 0].min()), float(ends[:, 1].max())
    return replace(by_mode, ci95=held, ci95_given_effects=shared.ci95_given_effects)


def declared_parameters(
    declared: DeclaredModel, fit: Fit, bounds: tuple[Bounds, Bounds]
) -> dict[str, StageParameter]:
    """Return the fitted constants of the declared model, in their units."""
    named = {2 + i: p.name for i, p in enumerate(declared.free_parameters)}
    # of several modes only a common factor is fitted, which has no unit
    single = len(declared.modulus) == 1
    constants = {
        0: (MODULUS, declared.modulus[0], "Pa") if single else ("modulus_factor", 1.0, ""),
        1: (RELAXATION_TIME, declared.relaxation_time[0], "s")
        if single
        else ("relaxation_time_factor", 1.0, ""),
    }
    out: dict[str, StageParameter] = {}
    for at in declared.free_positions:
        values = np.array([fit.theta[at], *bounds[1][at], *bounds[0][at]])
        name, scale, unit = constants.get(at) or (named[at], 1.0, "")
        if at in constants:
            # fitted as the logarithm of a factor
            values = scale * np.exp(values)
        value, low, high, *given = (float(v) for v in values)
        out[name] = StageParameter(
            value, (low, high), unit, ci95_given_effects=(given[0], given[1])
        )
    return out


def declared_effects(
    model: AugmentedModel, fit: Fit, bounds: Bounds, by_mode: Mapping[str, ConstantByMode]
) -> tuple[DeclaredEffect, ...]:
    """Return the known effects with their values in the final model."""
    found = []
    for known in model.declared.effects:
        parameters: dict[str, KnownParameter | ConstantByMode] = {
            p.name: KnownParameter(float(fit.theta[at]), bounds.get(at), p.unit)
            for p, at in zip(known.effect.parameters, model.positions(known.name), strict=True)
        }
        if known.name in by_mode:
            parameters[known.effect.parameters[0].name] = by_mode[known.name]
        found.append(DeclaredEffect(known.name, known.effect.kind, parameters))
    return tuple(found)


def declared_law(
    declared: DeclaredModel, fit: Fit, by_mode: Mapping[str, ConstantByMode]
) -> Equation | None:
    """Return the declared law with its modes as fitted; None where it cannot be written out.

    Parameters
    ----------
    declared
        The declared model.
    fit
        The final fit.
    by_mode
        Constants of the law that differ from mode to mode.
    """
    law = declared.law_with(fit.theta[2 : 2 + len(declared.free_parameters)])
    if by_mode and declared.added_modes:
        return None  # one of the modes is that of an effect
    try:
        named, terms = law_parts(law)
        if by_mode:
            named, terms = _named_by_mode(declared, fit, by_mode), ()
    except InputError:
        return None
    return Equation(
        terms,
        tuple(map(float, declared.modulus * np.exp(fit.theta[0]))),
        tuple(map(float, declared.relaxation_time * np.exp(fit.theta[1]))),
        law.linear_relaxation,
        float(declared.solvent_viscosity),
        named=named,
    )


def _named_by_mode(
    declared: DeclaredModel, fit: Fit, by_mode: Mapping[str, ConstantByMode]
) -> NamedPart:
    ranges = LAWS[declared.law_name].parameters
    known = dict(declared.parameters)
    for i, parameter in enumerate(declared.free_parameters):
        known[parameter.name] = float(fit.theta[2 + i])
    of_modes = []
    for number in range(len(declared.modulus)):
        own = known | {name: one.modes[number].value for name, one in by_mode.items()}
        # at an end of its range a constant may be beyond it by a rounding
        of_modes.append({n: float(np.clip(value, *ranges[n])) for n, value in own.items()})
    return NamedPart(declared.law_name, tuple(of_modes))


def states_of(
    model: AugmentedModel, fit: Fit, active: Sequence[str]
) -> tuple[StatePart, ...] | None:
    """Return the states of the whole fluid; None where one of them cannot be written out."""
    parts = []
    for effect in model.effects:
        if effect.name not in active or not isinstance(effect, StateEffect):
            continue
        at = model.positions(effect.name)
        # at an end of its range a constant may be beyond it by a rounding
        values = np.clip(fit.theta[at], model.low[at], model.high[at])
        names = (parameter.name for parameter in effect.parameters)
        try:
            parts.append(StatePart(effect.name, dict(zip(names, map(float, values), strict=True))))
        except InputError:
            return None
    return tuple(parts)


def augmented_fluid(model: AugmentedModel, fit: Fit, active: Sequence[str]) -> Fluid:
    """Return the augmented fluid, without states that no law of one mode can carry."""
    declared = model.declared
    added = [
        (effect, jnp.asarray(fit.theta[model.positions(effect.name)]))
        for effect in model.effects
        if effect.name in active
        and isinstance(effect, ConstitutiveEffect)
        and not isinstance(effect, StateEffect)
    ]
    base = declared.law_with(fit.theta[2 : 2 + len(declared.free_parameters)])
    law = AugmentedLaw(
        base=base,
        values=tuple(values for _, values in added),
        effects=tuple(effect for effect, _ in added),
        linear_relaxation=base.linear_relaxation,
    )
    one = jnp.ones(1)
    viscosity = declared.solvent_viscosity + sum(
        float(effect.instantaneous_stress(values, one)[0]) for effect, values in added
    )
    modes = [effect.mode(values) for effect, values in added if isinstance(effect, ModeEffect)]
    modulus = declared.modulus * np.exp(fit.theta[0])
    relaxation_time = declared.relaxation_time * np.exp(fit.theta[1])
    every_time = np.append(relaxation_time, [float(pair[1]) for pair in modes])
    return Fluid(
        with_modes(law, relaxation_time, every_time),
        np.append(modulus, [float(pair[0]) for pair in modes]),
        every_time,
        viscosity,
    )
