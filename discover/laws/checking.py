"""Whether a law of a user's own computes what a law must."""

import jax
import jax.numpy as jnp

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.each_mode import law_of_mode


def check_law(law: AbstractConstitutiveLaw) -> None:
    """Check that a law gives a rate of stress with as many components as the stress.

    A term of another shape would be spread over all components without a word.
    """
    law = law_of_mode(law, 0)
    name = type(law).__name__
    stress, rate = law.rest(), jnp.zeros(())
    try:
        made = [jax.eval_shape(law.stress_rate, stress, rate)]
        if type(law).stress_rate is AbstractConstitutiveLaw.stress_rate:
            made.append(jax.eval_shape(law.extra_term, stress, stress[:4]))
    except Exception as error:  # whatever a user's own code raises
        text = str(error).partition("\n")[0] or "no reason given"
        raise InputError(
            f"The law {name} cannot be computed: {type(error).__name__}, {text} Its extra_term "
            "takes σ and γ̇ with four components each and returns h with four, in jax.numpy."
        ) from error
    for part in made:
        shape = getattr(part, "shape", None)
        if shape != stress.shape:
            raise InputError(
                f"The law {name} must return the four components 11, 22, 33, 12; got "
                f"{'no array' if shape is None else f'the shape {shape}'}."
            )
