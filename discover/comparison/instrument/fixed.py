"""Constants of the law itself: fitted with the declared law alone, then held."""

from collections.abc import Sequence
from dataclasses import replace

from discover.dataset import Run
from discover.effects import ConstitutiveEffect, KnownEffect
from discover.errors import InputError
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.inference.least_squares import fit_batch
from discover.laws.registry import make_law
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel, forward_model


def fixed_with_the_law(declared: DeclaredModel, runs: Sequence[Run]) -> DeclaredModel:
    """Return the declared model with numbers for what is to be fitted of its law.

    A learner adds to a law, and could take any of its constants up: these are fitted to the runs
    with the declared law alone, together with all else that is free, and held. Constants of the
    modes and of the instrument stay to be fitted along with each learner.

    Parameters
    ----------
    declared
        The declared model.
    runs
        The runs to fit.

    Raises
    ------
    InputError
        If the declared law cannot be integrated through the runs.
    """
    of_law = [name for name in declared.free if name not in MODE_CONSTANTS]
    of_fluid = [
        known.name
        for known in declared.effects
        if known.free and isinstance(known.effect, ConstitutiveEffect)
    ]
    if not of_law and not of_fluid:
        return declared
    model = AugmentedModel(forward_model(declared), [], data_scales(runs))
    fit = fit_batch(model, make_batch(runs), [model.zero()], [model.free_positions])[0]
    if not fit.usable:
        raise InputError(
            "The declared model cannot be integrated through the fitted runs: its stress runs "
            "away. Check its parameters, modes and units."
        )
    parameters = dict(declared.parameters)
    for i, parameter in enumerate(model.declared.free_parameters):
        parameters[parameter.name] = float(fit.theta[2 + i])

    def valued(known: KnownEffect) -> KnownEffect:
        if known.name not in of_fluid:
            return known
        return replace(known, values=tuple(map(float, fit.theta[model.positions(known.name)])))

    return replace(
        declared,
        law=make_law(declared.law_name, parameters) if of_law else declared.law,
        parameters=parameters,
        effects=tuple(map(valued, declared.effects)),
        free=tuple(name for name in declared.free if name in MODE_CONSTANTS),
    )
