"""The declared law with the terms that were found."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import ConstitutiveEffect
from discover.equations import EquationTerm, combined, effect_terms, law_terms
from discover.laws import AbstractConstitutiveLaw
from tensor_library.algebra import Symmetric


class AugmentedLaw(AbstractConstitutiveLaw):
    """A law with the extra terms of constitutive effects.

    Attributes
    ----------
    base
        The declared law.
    values
        Parameters of each effect.
    effects
        The effects.
    linear_relaxation
        As in the declared law.
    """

    base: AbstractConstitutiveLaw
    values: tuple[Float[Array, " _"], ...]
    effects: tuple[ConstitutiveEffect, ...] = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h of the declared law plus the terms of the effects."""
        extra = self.base.extra_term(stress, rate)
        for effect, values in zip(self.effects, self.values, strict=True):
            extra = extra + effect.extra_term(jnp.asarray(values), stress, rate)
        return extra


@law_terms.register
def _(law: AugmentedLaw) -> tuple[EquationTerm, ...]:
    terms = law_terms(law.base)
    for effect, values in zip(law.effects, law.values, strict=True):
        terms += effect_terms(effect, np.asarray(values))
    return combined(terms)
