"""Known effects of the fluid as part of its law, its modes or its solvent."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from discover.effects import ConstitutiveEffect, KnownEffect, ModeEffect, SeriesElement, StateEffect
from discover.errors import InputError
from discover.laws.each_mode import with_modes
from discover.laws.expansion import law_of_terms
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

ONLY_LOOP = (
    "Leave it out of [model] effects, or, where it comes from an earlier result, give it an "
    "amplitude of 0 there; discover close-loop knows it."
)
"""What to do with an effect that no learner can be told of."""
_RATES = (1.0, 2.0)


def absorbed(declared: DeclaredModel) -> DeclaredModel:
    """Return the declared model with the known effects of the fluid in its law, modes and solvent.

    What is left among its effects is of the instrument.

    `declared`: the declared model; its effects of the fluid have values. Raises InputError if a
    learner cannot be given an effect as something known.
    """
    # at zero amplitude an effect is none
    declared = replace(declared, effects=tuple(k for k in declared.effects if k.values[0] != 0.0))
    for known in declared.effects:
        if isinstance(known.effect, StateEffect):
            raise InputError(
                f"compare cannot take {known.name} as known: it gives the fluid a state that no "
                f"law of stress and rate carries. {ONLY_LOOP}"
            )
        if isinstance(known.effect, SeriesElement):
            raise InputError(
                f"compare cannot take {known.name} as known: the rate that the fluid feels would "
                f"depend on the law that is looked for. {ONLY_LOOP}"
            )
        if isinstance(known.effect, ConstitutiveEffect):
            declared = _with_effect(declared, known, known.effect)
    instrument = (k for k in declared.effects if not isinstance(k.effect, ConstitutiveEffect))
    return replace(declared, effects=tuple(instrument))


def _with_effect(
    declared: DeclaredModel, known: KnownEffect, effect: ConstitutiveEffect
) -> DeclaredModel:
    values = jnp.asarray([value for value in known.values if value is not None])
    assert len(values) == len(known.values)  # what was to be fitted has a value by now
    terms = effect.as_terms([float(value) for value in values])
    if terms is None:
        raise InputError(
            f"compare cannot take {known.name} as known: what it adds to the law is no sum of "
            f"library terms. {ONLY_LOOP}"
        )
    law = declared.law
    for term in terms:
        base = None if isinstance(law, UpperConvectedMaxwell) else law
        law = law_of_terms(LawTerms.of([term]), law.linear_relaxation, base)
    beside = np.asarray(effect.instantaneous_stress(values, jnp.asarray(_RATES)))
    if not np.isclose(beside[1], _RATES[1] * beside[0], rtol=1e-9):
        raise InputError(
            f"compare cannot take {known.name} as known: learners know no stress besides the "
            f"modes but a solvent's. {ONLY_LOOP}"
        )
    modulus, relaxation_time = declared.modulus, declared.relaxation_time
    if isinstance(effect, ModeEffect):
        extra = [float(value) for value in effect.mode(values)]
        modulus, relaxation_time = (
            np.append(column, value)
            for column, value in zip((modulus, relaxation_time), extra, strict=True)
        )
        law = with_modes(law, declared.relaxation_time, relaxation_time)
    return replace(
        declared,
        law=law,
        law_name=f"{declared.law_name} with {known.text}" if terms else declared.law_name,
        modulus=modulus,
        relaxation_time=relaxation_time,
        solvent_viscosity=declared.solvent_viscosity + float(beside[0]),
    )
