"""The declared law with the terms that were found."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import ConstitutiveEffect
from discover.equations import effect_terms, law_terms
from discover.laws import AbstractConstitutiveLaw
from tensor_library.algebra import Symmetric
from tensor_library.terms import TermShare


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

    def as_terms(self) -> tuple[TermShare, ...]:
        """Return the terms of the declared law, then those of the effects.

        Raises
        ------
        InputError
            If one of them is no sum of library terms.
        """
        found = law_terms(self.base)
        for effect, values in zip(self.effects, self.values, strict=True):
            found += effect_terms(effect, np.asarray(values))
        return tuple(TermShare(t.term, t.coefficient, t.inner) for t in found)
