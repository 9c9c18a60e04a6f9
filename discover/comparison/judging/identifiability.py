"""What these data cannot decide, in the words and flows of a comparison.

The findings are those of `discover.identify`: exact twins of the law found, rivals that a test on
the data could not rule out, and the structure of the library at the law found. Here they are put
beside the flows of the comparison.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from discover.comparison.outcomes.flows import QUANTITIES, Flow, Stresses, predict, relative_errors
from discover.dataset.run import Run
from discover.forward.grids.flow_batch import lay_out
from discover.identify import (
    LawStructure,
    Structure,
    Twin,
    analyse_structure,
    check_physics,
    find_twins,
)
from discover.identify.soundness.physics_flows import time_scale
from discover.laws.expansion import law_of_terms
from discover.laws.multimode import Fluid
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerm, LawTerms, spell
from tensor_library.library import TermLibrary, build_library
from tensor_library.terms import parse_term

EXACT = 1e-5
"""Relative difference of σ12 below which two laws count as one: integration error, generously."""

SEPARATED = 1e-2
"""Relative difference that an experiment can be expected to see."""

MOST_RIVALS = 8

FOUND = "the law found"
"""Name of the chosen law among those at which the structure is analysed."""

_PHYSICS_SAMPLES = 201
_PHYSICS_FLOWS = ("training", "held_out", "test")


@dataclass(frozen=True)
class Rival:
    """A law that the data do not tell from the chosen one.

    Attributes
    ----------
    law
        Its terms, beyond the known part.
    reason
        Why it is a rival, in one sentence.
    errors_to_chosen
        Largest relative difference of each quantity over the training and the test flows.
    separated_by
        ``{"protocol", "quantity"}`` where the two differ most among flows not yet measured; None
        where they differ nowhere that was tried.
    """

    law: LawTerms
    reason: str = ""
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


def find_rivals(
    terms: Sequence[LawTerm],
    met: Iterable[Mapping[str, Any]],
    model: DeclaredModel,
    flows: Sequence[Flow],
    library: TermLibrary | None = None,
    predictions: Mapping[str, Stresses | None] | None = None,
) -> list[Rival]:
    """Return rivals of a law: exact twins first, then what the data do not rule out, closest first.

    Parameters
    ----------
    met
        Rivals that the sparse search met: ``support``, ``coefficients``, ``inner``, ``text``.
    model
        The known part.
    flows
        Training flows, which the rivals have to fit, and tests, which may separate them.
    library
        Terms that the search had. Twins are sought beyond them too, in the basis with up to one
        invariant: the fluid need not keep to the library that somebody chose.
    predictions
        Of the chosen law, by the key of the flow, where they are known already.
    """
    chosen = LawTerms.of(terms)
    searched = () if library is None else library.terms
    basis = build_library(degree=1)
    library = basis if library is None else library.extended(basis.terms)
    seen = [flow for flow in flows if flow.kind == "training"]
    unseen = [flow for flow in flows if flow.kind in ("test", "held_out")]
    flows = [*seen, *unseen]
    reference = predictions
    if reference is None:
        reference = _simulate(chosen, model, flows)
    candidates: dict[frozenset[str], Rival] = {}
    twins = find_twins(library, chosen, model.law)
    twins = [twin for twin in twins if _concerns_shear(twin, len(chosen.coefficients))]
    met = list(met)
    # all of them in one program, each with zeros for the terms of the others
    supports = [*(twin.law.coefficients for twin in twins), *(row["support"] for row in met)]
    names = list(dict.fromkeys(name for support in supports for name in support))
    for twin in twins:
        beyond = [name for name in twin.law.coefficients if parse_term(name) not in searched]
        rival = _rival_of(twin, beyond if searched else [])
        predictions = _simulate(rival.law, model, flows, names)
        rival = _judge(rival, reference, predictions, seen, unseen)
        if rival is not None and (rival.errors_to_chosen["sigma12"] or 0.0) <= EXACT:
            candidates.setdefault(frozenset(twin.law.coefficients), rival)
    for row in met:
        other = LawTerms.from_json(row)
        if frozenset(other.coefficients) in candidates or len(candidates) >= MOST_RIVALS:
            continue
        reason = row.get("text") or "The data fit it as well within their noise."
        predictions = _simulate(other, model, flows, names)
        rival = _judge(Rival(other, reason), reference, predictions, seen, unseen)
        if rival is not None:
            candidates[frozenset(other.coefficients)] = rival
    return list(candidates.values())


def _concerns_shear(twin: Twin, size: int) -> bool:
    """Return whether a twin is no larger than the law, or predicts other normal stresses."""
    no_larger = len(twin.law.coefficients) <= size
    return no_larger or max(twin.difference.N1, twin.difference.N2) > EXACT


def _rival_of(twin: Twin, beyond: Sequence[str]) -> Rival:
    place = None
    if twin.separated_by:
        best = max(twin.separated_by, key=lambda s: s.difference)
        place = {"protocol": best.flow, "quantity": best.quantity}
    reason = twin.text
    if beyond:
        reason += f" (The library that was searched does not hold {', '.join(beyond)}.)"
    return Rival(twin.law, reason, separated_by=place)


def _simulate(
    terms: LawTerms, model: DeclaredModel, flows, names: Iterable[str] = ()
) -> dict[str, Stresses | None]:
    """Return what a law does in each flow, in a program for all laws of terms of these names."""
    whole = LawTerms({**dict.fromkeys(names, 0.0), **terms.coefficients}, terms.inner)
    law = law_of_terms(whole, model.law.linear_relaxation, model.law)
    fluid = Fluid(law, model.modulus, model.relaxation_time, model.solvent_viscosity)
    return {flow.key: predict(fluid, flow) for flow in flows}


def _judge(rival: Rival, reference, predictions, seen, unseen) -> Rival | None:
    worst: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    separation, place = 0.0, None
    for flow in [*seen, *unseen]:
        chosen, other = reference[flow.key], predictions[flow.key]
        if chosen is None or other is None:
            continue
        for quantity, error in relative_errors(other, chosen).items():
            if error is None:
                continue
            if flow in seen or quantity != "sigma12":
                worst[quantity] = max(worst[quantity] or 0.0, error)
            if error > separation and (flow not in seen or quantity != "sigma12"):
                separation, place = error, {"protocol": flow.name, "quantity": quantity}
    if worst["sigma12"] is None:
        return None
    # among the flows of the comparison if one of them will do
    place = place if separation > SEPARATED else rival.separated_by
    return replace(rival, errors_to_chosen=worst, separated_by=place)


def law_structure(structure: Structure | None) -> LawStructure | None:
    """Return the structure at the law found, or at the known part where that law runs away."""
    if structure is None or not structure.laws:
        return None
    return next((law for law in structure.laws if law.name == FOUND), structure.laws[0])


def structure_of(
    terms: Sequence[LawTerm],
    runs: Sequence[Run],
    library: TermLibrary,
    model: DeclaredModel,
    use_normal_stresses: bool,
) -> Structure:
    """Return what the flows of these runs determine, at the known part and at the law found."""
    found = LawTerms.of(terms)
    return analyse_structure(
        runs,
        library,
        base=model.law,
        nominal={FOUND: found} if found.coefficients else {},
        modulus=model.modulus,
        relaxation_time=model.relaxation_time,
        solvent_viscosity=model.solvent_viscosity,
        use_normal_stresses=use_normal_stresses,
    )


def physics_of(fluid: Fluid, flows: Sequence[Flow]) -> dict[str, Any]:
    """Return checks of a fluid's physical soundness along the flows, as JSON-able values.

    Parameters
    ----------
    flows
        The flows of the comparison; training ones set the box beyond which the law extrapolates.
    """
    along = [flow for flow in flows if flow.kind in _PHYSICS_FLOWS]
    training = [flow for flow in along if flow.kind == "training"] or along
    time = time_scale(fluid)
    weissenberg = time * max(flow.largest_rate for flow in training)
    deborah = time * max(_frequency(flow) for flow in training)
    protocols = [flow.protocol for flow in along]
    times = [_thinned(flow.times) for flow in along]
    return check_physics(
        fluid,
        lay_out(protocols, times, strain_step=0.2, relaxation_time=fluid.settling_time),
        [flow.title for flow in along],
        weissenberg,
        # a start-up has no frequency; no oscillation tried is larger than a strain of fifty
        max(deborah, weissenberg / 5.0),
    ).to_json()


def _frequency(flow: Flow) -> float:
    """Return the angular frequency of a flow, in rad/s; that of its duration if it has none."""
    if flow.is_of_states:
        return flow.frequency or 0.0
    whole = 2.0 * np.pi / max(float(flow.times[-1]), np.finfo(float).tiny)
    return max(whole, flow.frequency or 0.0)


def _thinned(times: np.ndarray) -> np.ndarray:
    return times[:: max(1, -(-times.size // _PHYSICS_SAMPLES))]
