"""Twins: laws with the same σ12, or σ12 and N1, in every simple-shear history.

Two sources, both exact:

relations
    Combinations of terms that vanish in shear or live on σ33 (`term_relations`).
changes of the hidden stresses
    The normal stresses are never measured, so a law may be rewritten in other hidden variables as
    long as σ12 stays. Whether the outcome is again a law of the library is decided in exact
    arithmetic on the Taylor series (`solve_for_coefficient`), and the change itself is read off
    the two series afterwards.

Every twin is also simulated in random histories before it is reported.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

from discover.identify.exact.exact_series import DEFAULT_ORDER, hidden_change, solve_for_coefficient
from discover.identify.exact.relations import feels_33, term_relations
from discover.identify.side_by_side.histories import SAME, Difference, differences
from discover.identify.side_by_side.laws_side_by_side import joint_library
from discover.identify.side_by_side.separation import Separation, separations
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.notebook_view import NotebookView
from discover.words import percent_of
from tensor_library.law_terms import LawTerms, spell
from tensor_library.library import TermLibrary
from tensor_library.terms import parse_term

Proof = Literal["relation", "series", "histories"]
_Candidate = tuple[LawTerms, Proof, dict[str, str]]

_LARGEST_DENOMINATOR = 10**5
_SHORT_DENOMINATOR = 100
INVISIBLE_SIZE = 0.05
"""Amount of a combination on σ33 that is added to show what it does; any amount would do."""


@dataclass(frozen=True)
class Twin(NotebookView):
    """A law that no shear stress tells from another.

    `proof`: ``"relation"`` or ``"series"``: exact. ``"histories"``: to integration error in random
        histories.
    `order`: order to which the Taylor series agree exactly, where that was the proof. It is given
        at coefficients rounded to short fractions: that the family of twins exists is exact.
    `change`: the twin's σ11, σ22, σ33 in terms of the other law's, in words, where linear.
    """

    law: LawTerms  # the twin, beyond the known part
    proof: Proof
    keeps_N1: bool  # whether N1 is the same too
    difference: Difference  # largest difference of σ12, N1 and N2 in random histories
    separated_by: tuple[Separation, ...] = ()  # experiments that would tell the two apart
    order: int | None = None
    change: Mapping[str, str] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        same = "the same σ12 and the same N1" if self.keeps_N1 else "the same σ12"
        how = {
            "relation": "an identity between tensors in shear",
            "series": f"Taylor series equal to order {self.order} in exact arithmetic",
            "histories": "to integration error in random histories",
        }[self.proof]
        text = (
            f"h = {spell(self.law.coefficients)} gives {same} in every simple-shear history ({how})"
        )
        apart = []
        if not self.keeps_N1:
            apart.append(f"N1 by {percent_of(self.difference.N1)}")
        if self.difference.N2 > SAME:
            apart.append(f"N2 by {percent_of(self.difference.N2)} of N1")
        text += f"; {' and '.join(apart)} apart" if apart else "; N2 is the same too"
        if self.separated_by:
            text += "; " + " or ".join(s.text for s in self.separated_by) + " would tell"
        return text + "."

    def line(self) -> dict[str, Any]:
        """Return the twin as one line of a table: by how much it differs, what would tell."""
        return {
            "law": spell(self.law.coefficients),
            "proof": self.proof,
            "sigma12_apart": self.difference.sigma12,
            "N1_apart": self.difference.N1,
            "N2_apart": self.difference.N2,
            "told_by": " or ".join(experiment.text for experiment in self.separated_by),
        }

    def _shown(self) -> Iterable[Any]:
        yield self.text


def find_twins(
    library: TermLibrary, law: LawTerms, base: AbstractConstitutiveLaw | None = None
) -> list[Twin]:
    """Return the twins of a law, simplest first, checked by simulation.

    Searched are: every other term of the library in place of each term of the law (exact; for a
    polynomial law on UCM), every exchange along a relation that vanishes in shear, and
    every combination that lives on σ33 only (where nothing in the law feels σ33).

    `library`: candidate terms. `law`: the law, beyond the known part. `base`: the known part; by
    default UCM.
    """
    base = UpperConvectedMaxwell() if base is None else base
    library = joint_library(library, [law])
    found: list[_Candidate] = []
    if isinstance(base, UpperConvectedMaxwell):
        found += _by_series(library, law, base.linear_relaxation)
        found += _by_relations(library, law)
    distinct = {_key(law): None}
    unique = []
    for one in found:
        if _key(one[0]) not in distinct:
            distinct[_key(one[0])] = None
            unique.append(one)
    if not unique:
        return []
    laws = [one[0] for one in unique]
    apart = differences(library, law, laws, base)
    kept = [(one, d) for one, d in zip(unique, apart, strict=True) if d.sigma12 <= SAME]
    if not kept:
        return []
    told = separations(library, law, [one[0] for one, _ in kept], base)
    return [
        Twin(
            law=twin,
            proof=proof,
            keeps_N1=d.N1 <= 10.0 * SAME,
            difference=d,
            separated_by=by,
            order=DEFAULT_ORDER if proof == "series" else None,
            change=change,
        )
        for ((twin, proof, change), d), by in zip(kept, told, strict=True)
    ]


def _key(law: LawTerms) -> tuple:
    return tuple(sorted((n, round(v, 6)) for n, v in law.coefficients.items() if v))


def _by_series(
    library: TermLibrary, law: LawTerms, linear_relaxation: bool
) -> Iterator[_Candidate]:
    """Return twins with one term of the law exchanged for another.

    The search runs at a neighbouring law with short fractions, where the arithmetic is fast and a
    rational twin is recognised; what it finds is solved for again at the law itself.
    """
    present = {name: value for name, value in law.coefficients.items() if value}
    if not present or any(parse_term(name).closed_form for name in present):
        return
    short = {n: _fraction(v, _SHORT_DENOMINATOR) for n, v in present.items()}
    exact = {n: _fraction(v, _LARGEST_DENOMINATOR) for n, v in present.items()}
    settings = {"order": DEFAULT_ORDER, "linear_relaxation": linear_relaxation}
    for replaced in present:
        rest = [name for name in present if name != replaced]
        for term in library.terms:
            if term.closed_form or term.name in present:
                continue
            near = {name: short[name] for name in rest}
            at_short = solve_for_coefficient(short, term.name, near, **settings)
            proved = [value for value, is_proved in at_short if is_proved and value]
            if not any(value for value, _ in at_short):
                continue
            change = {}
            if proved:
                twin = {**near, term.name: Fraction(proved[0]).limit_denominator(10**6)}
                change = hidden_change(short, twin, **settings)
            here = {name: exact[name] for name in rest}
            for value, _ in solve_for_coefficient(exact, term.name, here, **settings):
                if value:
                    found = LawTerms({**{n: present[n] for n in rest}, term.name: value})
                    yield found, "series" if proved else "histories", change


def _fraction(value: float, largest_denominator: int) -> Fraction:
    """Return a short fraction near a value, but never zero for what is not."""
    return Fraction(value).limit_denominator(largest_denominator) or Fraction(value)


def _by_relations(library: TermLibrary, law: LawTerms) -> Iterator[_Candidate]:
    present = {name: value for name, value in law.coefficients.items() if value}
    hidden_33 = None
    for relation in term_relations(library):
        shared = [name for name in relation.coefficients if name in present]
        if relation.touches == "nothing":
            for name in shared:
                factor = -present[name] / relation.coefficients[name]
                yield _added(law, relation.coefficients, factor), "relation", {}
            continue
        if hidden_33 is None:
            names = list(present) or ["sigma"]
            hidden_33 = not feels_33(TermLibrary(tuple(parse_term(name) for name in names)))
        if hidden_33:
            # exchanging a term of the law keeps the law small; adding the whole shows the freedom
            for name in shared:
                factor = -present[name] / relation.coefficients[name]
                yield _added(law, relation.coefficients, factor), "relation", {}
            added = _added(law, relation.coefficients, INVISIBLE_SIZE)
            if not feels_33(TermLibrary(tuple(parse_term(n) for n in added.coefficients))):
                yield added, "relation", {}


def _added(law: LawTerms, relation: Mapping[str, int], factor: float) -> LawTerms:
    total = dict(law.coefficients)
    for name, value in relation.items():
        total[name] = total.get(name, 0.0) + factor * value
    # what cancels, cancels exactly: the factor was made from the same coefficient
    return LawTerms({n: v for n, v in total.items() if abs(v) > 1e-14}, law.inner)
