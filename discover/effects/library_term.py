"""Terms of the tensor library as effects."""

from dataclasses import dataclass

from discover.effects.base import ConstitutiveEffect, EffectParameter
from tensor_library import CandidateTerm, LawTerm, build_library

# Terms that are an effect with a name already, or the base law's own
_NAMED = ("sigma.sigma", "sigma.gammadot+gammadot.sigma", "tr(sigma)*sigma")

_SIMPLEST = 16
_ORDER_ONE = (
    "with stresses over the modulus and rates times the relaxation time, the coefficients of known "
    "laws are of order one (Bird, Armstrong & Hassager 1987, ch. 7); ten times leaves room"
)


@dataclass(frozen=True)
class LibraryTerm(ConstitutiveEffect):
    """Adds c · term to the law, for one candidate term of the tensor library."""

    term: CandidateTerm = None  # type: ignore[assignment]  # fields of the base have defaults

    def extra_term(self, values, stress, rate):
        """Return c · term, of a closed form with its inner parameter."""
        return values[0] * self.term.evaluate(stress, rate, self._inner(values))

    def as_terms(self, values):
        return (LawTerm(self.name, values[0], self._inner(values)),)

    def _inner(self, values):
        form = self.term.form
        return {} if form is None else {form.inner_name: values[1]}


def library_term(term: CandidateTerm) -> LibraryTerm:
    """Return the effect that adds this term with a free coefficient, and inner parameter."""
    form = term.form
    free = [
        EffectParameter("coefficient", "c", "", -10.0, 10.0, "one", 0.01, range_source=_ORDER_ONE)
    ]
    if form is not None:
        own = form.inner_name, form.inner_name, "", *form.inner_bounds, "one", form.inner_default
        free.append(EffectParameter(*own, range_source=form.source))
    return LibraryTerm(
        name=term.name,
        parameters=tuple(free),
        equation=rf"h \mathrel{{+}}= c\,{term.latex()}",
        source="Smith 1971, Int. J. Eng. Sci. 9, 899: isotropic functions of two tensors",
        check="A flow of another kind, such as step strain or extension.",
        complexity=2 + term.complexity,
        explicit_rate="gammadot" in term.name,
        term=term,
    )


def simplest_terms() -> list[LibraryTerm]:
    """Return the sixteen simplest terms of the library: a law too flexible to be believed."""
    simple = (term for term in build_library(degree=1).terms if term.closed_form is None)
    return [library_term(term) for term in simple][:_SIMPLEST]


def library_effects(degree: int = 1) -> tuple[LibraryTerm, ...]:
    """Return the library terms up to a degree of the invariants that no named effect covers."""
    terms = build_library(degree=degree).terms
    return tuple(library_term(term) for term in terms if term.name not in _NAMED)
