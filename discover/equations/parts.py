"""Laws in parts: a law with a name, a sum of terms, states of the whole fluid."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import ConstitutiveEffect, StateEffect, WrittenState, known_effects
from discover.effects.base import POWERS_OF_TIME
from discover.errors import InputError
from discover.laws import LAWS, AbstractConstitutiveLaw, make_law
from discover.laws.base import AbstractExtendedLaw, State
from discover.laws.each_mode import LawOfEachMode, law_of_mode
from discover.laws.registry import name_of
from tensor_library import CLOSED_FORMS, LawTerm
from tensor_library.algebra import Symmetric
from tensor_library.isotropic_function import IsotropicFunction


@dataclass(frozen=True)
class NamedPart:
    """Law by its name, with dimensionless constants once for all modes, or once for each.

    Raises InputError if there is no such law, or a parameter is missing, unknown or out of range.

    Examples
    --------
    >>> NamedPart("saramito", ({"yield_strain": 0.3}, {"yield_strain": 0.1})).differing
    ('yield_strain',)
    """

    law: str  # key of `discover.laws.LAWS`
    constants: tuple[Mapping[str, float], ...]

    def __post_init__(self):
        if not self.constants:
            raise InputError(f"The law {self.law!r} needs its constants, at least once.")
        for one in self.constants:
            make_law(self.law, one)

    def of_mode(self, mode: int) -> Mapping[str, float]:
        """Return the constants of a mode, counted from 0."""
        return self.constants[mode if len(self.constants) > 1 else 0]

    def built(self) -> AbstractConstitutiveLaw:
        """Return the law; raises InputError if the constants differ from mode to mode."""
        if self.differing:
            raise InputError(
                f"{', '.join(self.differing)} differs from one relaxation mode to the next, so "
                "there is not one law for all. Take one mode at a time: equation.mode(0).law()."
            )
        return make_law(self.law, self.constants[0])

    @property
    def differing(self) -> tuple[str, ...]:
        """Names of the constants that differ from mode to mode."""
        first = self.constants[0]
        return tuple(n for n in first if any(one[n] != first[n] for one in self.constants))

    @property
    def is_written(self) -> bool:
        """Whether somebody said how the law is written."""
        return LAWS[self.law].written is not None

    @property
    def function(self) -> IsotropicFunction:
        """Law written out; raises InputError if nobody said how it is written."""
        written = LAWS[self.law].written
        if written is None:
            raise InputError(
                f"The law {self.law!r} has no written form, so it cannot be exported in "
                "this format. Give register_law its `written`, or use --format json."
            )
        return written()


@dataclass(frozen=True)
class StatePart:
    """Effect with a state by its name, one state for all modes; InputError if it cannot be."""

    effect: str  # name of the effect, one of `dc.effects()` with a state
    values: Mapping[str, float]  # its parameters by name, in their units

    def __post_init__(self):
        self.written  # noqa: B018  # whatever is wrong is said here

    @property
    def own(self) -> StateEffect:
        """The effect."""
        (known,) = known_effects({self.effect: dict(self.values)}, "the law's states")
        if not isinstance(known.effect, StateEffect) or any(v is None for v in known.values):
            raise InputError(f"The effect {self.effect!r} has no state, or a parameter no value.")
        return known.effect

    def of_times(self, factor: float) -> "StatePart":
        """Return it where all times are a factor of those here."""
        units = {one.name: one.unit for one in self.own.parameters}
        values = {
            name: value * factor ** POWERS_OF_TIME.get(units[name], 0)
            for name, value in self.values.items()
        }
        return replace(self, values=values)

    @property
    def written(self) -> WrittenState:
        """The equation of the state."""
        written = self.own.written()
        if written is None:
            raise InputError(
                f"The state of the effect {self.effect!r} has no written form, so the law "
                "cannot be written out. Give its class the method `written`."
            )
        return written

    @property
    def names(self) -> tuple[str, ...]:
        """A name of each level of the state."""
        return self.own.level_names

    @property
    def at_rest(self) -> tuple[float, ...]:
        """Each level at rest."""
        return (self.own.rest,) * self.own.levels

    def spell(
        self, spelled: Callable[[object, Mapping[str, str]], str], letters: Mapping[str, str]
    ) -> tuple[list[str], str, str]:
        """Return the rates of change, and the factors on stress and times, as text.

        `spelled`: writes an expression with texts for its scalars, `letters`.
        """
        import sympy

        written = self.written
        factors = (written.modulus_factor, written.time_factor)
        modulus, time = (spelled(sympy.sympify(one), letters) for one in factors)
        return [spelled(rate, letters) for rate in written.rates], modulus, time


EXPONENTIAL = f"{CLOSED_FORMS.present['exp'].spelling}*sigma"


def law_terms(law: AbstractConstitutiveLaw) -> tuple[LawTerm, ...]:
    """Return h of a law as a sum of terms."""
    terms = law.as_terms()
    if terms is None:
        raise InputError(
            f"A law of the kind {type(law).__name__} is not a sum of library terms and cannot be "
            "written out. Register it under a name with dc.register_law, or give the class the "
            "method as_terms if it is such a sum."
        )
    return combined(terms)


def effect_terms(effect: ConstitutiveEffect, values: np.ndarray) -> tuple[LawTerm, ...]:
    """Return what an effect of these values, shape (p,), adds to h as a sum of terms."""
    terms = effect.as_terms([float(value) for value in values])
    if terms is None:
        raise InputError(
            f"What the effect {effect.name!r} adds is not a sum of library terms, so it cannot "
            "be written out. Its equation and parameters are in loop.json and equations.tex."
        )
    return terms


def combined(terms: tuple[LawTerm, ...]) -> tuple[LawTerm, ...]:
    """Return the sum with equal terms added up, in the order of their first appearance."""
    found: dict[tuple, LawTerm] = {}
    for term in terms:
        key = (term.term, tuple(sorted(term.inner.items())))
        if key in found:
            total = found[key].coefficient + term.coefficient
            found[key] = LawTerm(term.term, total, term.inner)
        else:
            found[key] = term
    return tuple(found.values())


class AugmentedLaw(AbstractExtendedLaw):
    """A law with the extra terms of constitutive effects."""

    base: AbstractConstitutiveLaw  # the declared law
    values: tuple[Float[Array, " _"], ...]
    effects: tuple[ConstitutiveEffect, ...] = eqx.field(static=True)
    linear_relaxation: bool = eqx.field(static=True, default=True)  # as in the declared law

    def trace_relaxation(self, stress: State) -> Float[Array, ""]:
        """Return that of the declared law: at rest what an effect adds may have no derivative."""
        return self.base.trace_relaxation(stress)

    def own_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return the sum of what the effects add."""
        pairs = zip(self.effects, self.values, strict=True)
        added = (effect.extra_term(jnp.asarray(values), stress, rate) for effect, values in pairs)
        return sum(added, jnp.zeros_like(stress))

    def of_terms(self) -> "tuple[AugmentedLaw, tuple[ConstitutiveEffect, ...]]":
        """Return the law with those effects that are sums of library terms, and the others."""
        kept = [
            i for i, one in enumerate(self.effects)
            if one.as_terms(list(map(float, self.values[i]))) is not None
        ]  # fmt: skip
        values, effects = ([of[i] for i in kept] for of in (self.values, self.effects))
        law = replace(self, values=tuple(values), effects=tuple(effects))
        return law, tuple(one for i, one in enumerate(self.effects) if i not in kept)

    def with_named(self, name: str) -> "tuple[AugmentedLaw, str] | None":
        """Law with an effect made part of a declared Maxwell, and its constant; or None."""
        effects = [effect.name for effect in self.effects]
        if name not in effects or self.base.as_terms() != ():
            return None
        at = effects.index(name)
        alone = replace(self, values=(self.values[at],), effects=(self.effects[at],))
        for law, constants in _names_of(alone).items():
            ((constant, value),) = constants.items()
            values, effects = (of[:at] + of[at + 1 :] for of in (self.values, self.effects))
            base = LAWS[law].build(value)
            return replace(self, base=base, values=values, effects=effects), constant
        return None

    def own_terms(self) -> tuple[LawTerm, ...]:
        """Return the terms of the effects."""
        return tuple(
            term
            for effect, values in zip(self.effects, self.values, strict=True)
            for term in effect_terms(effect, np.asarray(values))
        )


LawParts = tuple[NamedPart | None, tuple[LawTerm, ...]]
"""A law with a name, where one is needed, and a sum of terms."""


def law_parts(law: AbstractConstitutiveLaw) -> LawParts:
    """Return h as a named law, where one is needed, and a sum of terms; InputError if neither."""
    if law.as_terms() is not None:
        return None, law_terms(law)
    core, added = law.split()
    if isinstance(core, LawOfEachMode):
        part = _of_each_mode(core)
    else:
        named = name_of(core)
        if named is None:
            return None, law_terms(core)
        part = NamedPart(named[0], (named[1],))
    return part, combined(added)


def law_parts_by_mode(
    law: AbstractConstitutiveLaw, by_mode: Mapping[str, Sequence[float]], modes: int
) -> LawParts:
    """Return the parts of a law some constants of which differ from mode to mode.

    `by_mode`: values for each mode, by name of a constant, or of an effect that is a law by itself.
    Raises InputError as `law_parts`, or if what differs is no constant of a law with a name, or a
    mode was added.
    """
    if not by_mode:
        return law_parts(law)
    differing = dict(by_mode)
    for name in by_mode:
        moved = law.with_named(name) if isinstance(law, AugmentedLaw) else None
        if moved is not None:
            law, constant = moved
            differing[constant] = differing.pop(name)
    core, added = law.split()
    named = name_of(core)
    known = {} if named is None else named[1]
    # what an effect adds is the same sum in all modes; of a mode added to the declared ones
    # nothing was said
    if (
        named is None
        or set(differing) - set(known)
        or any(len(values) != modes for values in differing.values())
    ):
        raise InputError(
            f"{', '.join(differing)} differs from one relaxation mode to the next, and the law "
            "with it cannot be written out: only constants of a law with a name can, without "
            "an added mode. loop.json has the constants of each mode."
        )
    ranges = LAWS[named[0]].parameters
    constants = tuple(
        # at an end of its range a constant may be beyond it by a rounding
        known | {n: float(np.clip(own[k], *ranges[n])) for n, own in differing.items()}
        for k in range(modes)
    )
    return NamedPart(named[0], constants), added


def _of_each_mode(law: LawOfEachMode) -> NamedPart:
    count = len(jax.tree.leaves(law)[0])
    found = [_names_of(law_of_mode(law, number)) for number in range(count)]
    common = [name for name in found[0] if all(name in of for of in found)]
    if not common:
        raise InputError(
            "The law differs from one relaxation mode to the next and has no name, so it cannot be "
            "written out. loop.json and comparison.json have the constants of each mode."
        )
    return NamedPart(common[0], tuple(of[common[0]] for of in found))


def _names_of(law: AbstractConstitutiveLaw) -> dict[str, dict[str, float]]:
    """Return the laws with a name that are the law of a mode, with their constants."""
    named = name_of(law)
    if named is not None:
        return dict([named])
    if not isinstance(law, AugmentedLaw) or law.base.as_terms() != ():
        return {}
    if any(len(values) != 1 for values in law.values):
        return {}
    terms = law_terms(law)
    values = [float(values[0]) for values in law.values]
    found = {}
    for name, other in LAWS.items():
        if len(other.parameters) != len(values):
            continue
        for order in permutations(values):
            built = other.build(*order)
            if (built.as_terms() or ()) and _same(law_terms(built), terms):
                found[name] = dict(zip(other.parameters, order, strict=True))
    return found


def _same(terms: tuple[LawTerm, ...], others: tuple[LawTerm, ...]) -> bool:
    if len(terms) != len(others) or any(t.inner for t in (*terms, *others)):
        return terms == others
    sizes = {t.term: t.coefficient for t in others}
    return all(
        t.term in sizes and bool(np.isclose(t.coefficient, sizes[t.term], rtol=1e-9)) for t in terms
    )
