"""What the data cannot decide, in the flows of a comparison: twins, rivals, structure."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from discover import identify
from discover.comparison.flows import QUANTITIES, Flow, Stresses, relative_errors
from discover.comparison.hypotheses import flow_run, in_flows, terms_of
from discover.comparison.outcome import simulated
from discover.dataset.run import Run
from discover.laws.expansion import law_of_terms
from discover.laws.multimode import Fluid
from discover.loop.loop import SearchOutcome
from discover.study.declared_model import StudyModel
from discover.words import percent_of
from tensor_library import LawTerm, LawTerms, TermLibrary, build_library, parse_term
from tensor_library.law_terms import spell

EXACT = 1e-5
"""Relative difference of σ12 below which two laws count as one: integration error, generously."""

SEPARATED = 1e-2
"""Relative difference that an experiment can be expected to see."""

MOST_RIVALS = 8

_POSSIBLE = 0.01
"""Probability from which on a hypothesis is a rival."""


@dataclass(frozen=True)
class Rival:
    """Law that the data do not distinguish from the chosen one.

    `errors_to_chosen`: largest relative difference of each quantity over training and test flows.
    `separated_by`: protocol and quantity in which they differ most among flows not yet measured.
    """

    law: LawTerms  # its terms, beyond the known part
    reason: str = ""  # why it is a rival, in one sentence
    errors_to_chosen: Mapping[str, float | None] = field(default_factory=dict)
    separated_by: Mapping[str, str] | None = None

    def line(self) -> dict[str, Any]:
        """Return the rival as one line of a table: its law, how far it is off, what would tell."""
        apart = {f"{name}_apart": error for name, error in self.errors_to_chosen.items()}
        separated = dict(self.separated_by or {})
        told_by = " in ".join(separated[key] for key in ("quantity", "protocol") if separated)
        return {"law": spell(self.law.coefficients), **apart, "told_by": told_by}

    def to_json(self) -> dict[str, Any]:
        """Return the rival as the contract spells it."""
        return {
            # each with the inner parameters of the whole law
            "terms": [{**term.to_json(), "inner": self.law.inner} for term in self.law.terms],
            "reason": self.reason,
            "errors_to_chosen": self.errors_to_chosen,
            "separated_by": self.separated_by,
        }


def exact_twins(
    terms: Sequence[LawTerm], model: StudyModel, flows: Sequence[Flow], library: TermLibrary
) -> list[Rival]:
    """Return laws that give the same σ12 in every shear flow as the law found.

    `library`: the terms that were searched; a twin may be outside.
    """
    chosen = LawTerms.of(terms)
    twins = identify.find_twins(library.extended(build_library(degree=1).terms), chosen, model.law)
    twins = [twin for twin in twins if _concerns_shear(twin, len(chosen.coefficients))]
    if not twins:
        return []
    reference = _simulate(chosen, model, flows)
    names = list(dict.fromkeys(name for twin in twins for name in twin.law.coefficients))
    found: dict[frozenset[str], Rival] = {}
    for twin in twins[:MOST_RIVALS]:
        rival = _rival_of(twin, library)
        predictions = _simulate(rival.law, model, flows, names)
        judged = with_differences(rival, reference, predictions, flows)
        if judged is not None and (judged.errors_to_chosen["sigma12"] or 0.0) <= EXACT:
            found.setdefault(frozenset(twin.law.coefficients), judged)
    return list(found.values())


def other_possible_laws(
    found: SearchOutcome, flows: Sequence[Flow], runs: Mapping[str, Run]
) -> list[Rival]:
    """Return the other laws that the posterior holds possible, the likeliest first.

    Those whose effects are no sum of library terms are left out. `runs`: as recorded, by name.
    """
    fits = [(f, p) for f, p in found.posterior.fits if p >= _POSSIBLE][: 1 + MOST_RIVALS]
    named = [(f, p, t) for f, p in fits[1:] if (t := terms_of(f, found)) is not None]
    if not named:
        return []
    best, own = fits[0][0], terms_of(fits[0][0], found)
    asked = [flow_run(flow, found, runs) for flow in flows]
    thetas = [best.theta, *(fit.theta for fit, _, _ in named)]
    told = in_flows(found.posterior.problem.model, thetas, flows, asked)
    rivals = []
    for (_, share, terms), predictions in zip(named, told[1:], strict=True):
        law = LawTerms.of(terms)
        if own is not None and law.coefficients.keys() == LawTerms.of(own).coefficients.keys():
            continue
        reason = f"Its probability given these runs is {percent_of(share)}."
        rival = with_differences(Rival(law, reason), told[0], predictions, flows)
        if rival is not None:
            rivals.append(rival)
    return rivals


def _concerns_shear(twin: identify.Twin, size: int) -> bool:
    """Return whether a twin is no larger than the law, or predicts other normal stresses."""
    no_larger = len(twin.law.coefficients) <= size
    return no_larger or max(twin.difference.N1, twin.difference.N2) > EXACT


def _rival_of(twin: identify.Twin, library: TermLibrary) -> Rival:
    place, reason = None, twin.text
    if twin.separated_by:
        best = max(twin.separated_by, key=lambda s: s.difference)
        place = {"protocol": best.flow, "quantity": best.quantity}
    beyond = [name for name in twin.law.coefficients if parse_term(name) not in library.terms]
    if beyond:
        reason += f" Not in the library searched: {', '.join(beyond)}."
    return Rival(twin.law, reason, separated_by=place)


def _simulate(
    terms: LawTerms, model: StudyModel, flows, names: Iterable[str] = ()
) -> dict[str, Stresses | None]:
    """Return what a law does in each flow, in a program for all laws of terms of these names."""
    whole = LawTerms({**dict.fromkeys(names, 0.0), **terms.coefficients}, terms.inner)
    law = law_of_terms(whole, model.law.linear_relaxation, model.law)
    fluid = Fluid(law, model.modulus, model.relaxation_time, model.solvent_viscosity)
    return simulated(fluid, flows)


def with_differences(rival: Rival, reference, predictions, flows) -> Rival | None:
    """Return a rival with its differences from the law found; None if it cannot be followed."""
    worst: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    separation, place = 0.0, None
    for flow in flows:
        chosen, other = reference[flow.key], predictions[flow.key]
        if chosen is None or other is None:
            continue
        for quantity, error in relative_errors(other, chosen).items():
            if error is None:
                continue
            fitted = flow.kind == "training"
            if fitted or quantity != "sigma12":
                worst[quantity] = max(worst[quantity] or 0.0, error)
            if error > separation and not (fitted and quantity == "sigma12"):
                separation, place = error, {"protocol": flow.name, "quantity": quantity}
    if worst["sigma12"] is None:
        return None
    # among the flows of the comparison if one of them will do
    place = place if separation > SEPARATED else rival.separated_by
    return replace(rival, errors_to_chosen=worst, separated_by=place)
