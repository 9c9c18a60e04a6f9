"""The final model: its constants in their units, its law, its fluid."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from discover.effects import ConstitutiveEffect, ModeEffect, StateEffect
from discover.equations import AugmentedLaw, Equation, StatePart, law_parts_by_mode
from discover.errors import InputError
from discover.forward import MODULUS, RELAXATION_TIME, AugmentedModel, DeclaredModel
from discover.laws import Fluid
from discover.laws.each_mode import with_modes
from discover.loop.parts import (
    ConstantByMode,
    DeclaredEffect,
    KnownParameter,
    StageParameter,
    end_of_range,
)
from discover.programs import on_device

Bounds = Mapping[int, tuple[float, float]]
"""Ends of the 95 % interval of what is fitted, by its position."""

Theta = Float[np.ndarray, " p"]
"""Constants of the model; the clock at zero where relaxation times are not fitted."""


def declared_parameters(
    declared: DeclaredModel, theta: Theta, bounds: Bounds
) -> dict[str, StageParameter]:
    """Return the fitted constants of the declared model, in their units."""
    named = {2 + i: p.name for i, p in enumerate(declared.free_parameters)}
    ends = {2 + i: (p.low, p.high) for i, p in enumerate(declared.free_parameters)}
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
        values = np.array([theta[at], *bounds[at]])
        name, scale, unit = constants.get(at) or (named[at], 1.0, "")
        if at in constants:
            # fitted as the logarithm of a factor
            values = scale * np.exp(values)
        value, low, high = map(float, values)
        end = "" if at not in ends else end_of_range(value, *ends[at])
        out[name] = StageParameter(value, (low, high), unit, at_end=end)
    return out


def declared_effects(
    model: AugmentedModel, theta: Theta, bounds: Bounds, by_mode: Mapping[str, ConstantByMode]
) -> tuple[DeclaredEffect, ...]:
    """Return the known effects with their values in the final model."""
    found = []
    for known in model.declared.effects:
        parameters: dict[str, KnownParameter | ConstantByMode] = {
            p.name: KnownParameter(float(theta[at]), bounds.get(at), p.unit)
            for p, at in zip(known.effect.parameters, model.positions(known.name), strict=True)
        }
        if known.name in by_mode:
            parameters[known.effect.parameters[0].name] = by_mode[known.name]
        found.append(DeclaredEffect(known.name, known.effect.kind, parameters))
    return tuple(found)


def declared_law(
    declared: DeclaredModel, theta: Theta, by_mode: Mapping[str, ConstantByMode]
) -> Equation | None:
    """Return the declared law with its modes as fitted; None where it cannot be written out."""
    law = declared.law_with(theta[2 : 2 + len(declared.free_parameters)])
    differing = {name: one.values for name, one in by_mode.items()}
    try:
        parts = law_parts_by_mode(law, differing, len(declared.modulus))
    except InputError:
        return None
    moduli, times = np.exp(theta[:2, None]) * (declared.modulus, declared.relaxation_time)
    return Equation.of_fluid(Fluid(law, moduli, times, declared.solvent_viscosity), parts)


def states_of(
    model: AugmentedModel, theta: Theta, active: Sequence[str]
) -> tuple[StatePart, ...] | None:
    """Return the states of the whole fluid; None where one of them cannot be written out."""
    parts = []
    for effect in model.effects:
        if effect.name not in active or not isinstance(effect, StateEffect):
            continue
        at = model.positions(effect.name)
        # at an end of its range a constant may be beyond it by a rounding
        values = np.clip(theta[at], model.low[at], model.high[at])
        names = (parameter.name for parameter in effect.parameters)
        try:
            parts.append(StatePart(effect.name, dict(zip(names, map(float, values), strict=True))))
        except InputError:
            return None
    return tuple(parts)


def augmented_fluid(model: AugmentedModel, theta: Theta, active: Sequence[str]) -> Fluid:
    """Return the augmented fluid, without states that no law of one mode can carry."""
    declared = model.declared
    added = [
        (effect, on_device(theta[model.positions(effect.name)]))
        for effect in model.effects
        if effect.name in active
        and isinstance(effect, ConstitutiveEffect)
        and not isinstance(effect, StateEffect)
    ]
    base = declared.law_with(theta[2 : 2 + len(declared.free_parameters)])
    law = AugmentedLaw(
        base=base,
        values=tuple(values for _, values in added),
        effects=tuple(effect for effect, _ in added),
        linear_relaxation=base.linear_relaxation,
    )
    one = on_device(np.ones(1))
    viscosity = declared.solvent_viscosity + sum(
        float(np.asarray(effect.instantaneous_stress(values, one))[0]) for effect, values in added
    )
    modes = [effect.mode(values) for effect, values in added if isinstance(effect, ModeEffect)]
    modulus = declared.modulus * np.exp(theta[0])
    relaxation_time = declared.relaxation_time * np.exp(theta[1])
    every_time = np.append(relaxation_time, [float(pair[1]) for pair in modes])
    return Fluid(
        with_modes(law, relaxation_time, every_time),
        np.append(modulus, [float(pair[0]) for pair in modes]),
        every_time,
        viscosity,
    )
