"""The declared law with the terms that were found."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import ConstitutiveEffect
from discover.equations.from_law import effect_terms, law_terms
from discover.laws import LAWS, AbstractConstitutiveLaw
from discover.laws.base import AbstractExtendedLaw, State, as_state, stress_in
from tensor_library.algebra import Symmetric
from tensor_library.law_terms import LawTerm


class AugmentedLaw(AbstractExtendedLaw):
    """A law with the extra terms of constitutive effects.

    `base`: the declared law.
    `linear_relaxation`: as in the declared law.
    """

    base: AbstractConstitutiveLaw
    values: tuple[Float[Array, " _"], ...]
    effects: tuple[ConstitutiveEffect, ...] = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def trace_relaxation(self, stress: State) -> Float[Array, ""]:
        """Return that of the declared law: at rest what an effect adds may have no derivative."""
        return self.base.trace_relaxation(stress)

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h of the declared law plus the terms of the effects."""
        extra, own = self.base.extra_term(stress, rate), stress_in(stress)
        for effect, values in zip(self.effects, self.values, strict=True):
            extra = extra + as_state(effect.extra_term(jnp.asarray(values), own, rate), stress)
        return extra

    def as_terms(self) -> tuple[LawTerm, ...] | None:
        """Return the terms of the declared law, then those of the effects.

        None if the declared law is no sum of library terms.

        Raises InputError if what an effect adds is none.
        """
        below = self.base.as_terms()
        return None if below is None else below + self._added_terms()

    def split(self) -> tuple[AbstractConstitutiveLaw, tuple[LawTerm, ...]]:
        """Return the declared law, and the terms of the effects.

        Raises InputError if what an effect adds is no sum of library terms.
        """
        core, terms = self.base.split()
        return core, terms + self._added_terms()

    def with_named(self, name: str) -> "tuple[AugmentedLaw, str] | None":
        """Return the law with an effect made part of the declared one, and that one's constant.

        None where no law with a name has the term of the effect alone, with its amplitude for the
        only constant, as Giesekus's law has its mobility; or where the declared law has terms.
        """
        effects = [effect.name for effect in self.effects]
        if name not in effects or self.base.as_terms() != ():
            return None
        at = effects.index(name)
        value = self.values[at][0]
        alone = effect_terms(self.effects[at], np.asarray(self.values[at]))
        for law in LAWS.values():
            if len(law.parameters) != 1 or len(self.values[at]) != 1:
                continue
            built = law.build(value)
            if (built.as_terms() or ()) and law_terms(built) == alone:
                values = self.values[:at] + self.values[at + 1 :]
                others = self.effects[:at] + self.effects[at + 1 :]
                whole = AugmentedLaw(
                    base=built,
                    values=values,
                    effects=others,
                    linear_relaxation=self.linear_relaxation,
                )
                return whole, next(iter(law.parameters))
        return None

    def _added_terms(self) -> tuple[LawTerm, ...]:
        return tuple(
            term
            for effect, values in zip(self.effects, self.values, strict=True)
            for term in effect_terms(effect, np.asarray(values))
        )
