"""What these data cannot decide: rivals of the chosen law, and quantities no datum touches.

The statements are of two kinds, and say which: exact facts on simple shear, each checked by
simulation before it is reported, and rivals that the sparse search met on its way.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from discover.comparison.flows import QUANTITIES, Flow, Stresses, predict, relative_errors
from discover.comparison.outcome import law_of_terms
from discover.laws.multimode import Fluid
from discover.learners.result import RecoveredTerm
from discover.study.build import DeclaredModel

EXACT = 1e-5
"""Relative difference of σ12 below which two laws count as one: integration error, generously."""

SEPARATED = 1e-2
"""Relative difference that an experiment can be expected to see."""

MOST_RIVALS = 8

_SLIP = "sigma.gammadot+gammadot.sigma"
_SLIP_TWIN = "tr(sigma)*gammadot"
_PARASITE = {"tr(gammadot.gammadot)*I": 1.0, "gammadot.gammadot": -2.0}
_PARASITE_SIZE = 0.05


@dataclass(frozen=True)
class Rival:
    """A law that the data do not tell from the chosen one.

    Attributes
    ----------
    terms
        Term → coefficient.
    inner
        Inner parameters by name.
    reason
        Why it is a rival, in one sentence.
    errors_to_chosen
        Largest relative difference of each quantity over the training and the test flows.
    separated_by
        ``{"protocol", "quantity"}`` where the two differ most among flows not yet measured; None
        where they differ nowhere that was tried.
    """

    terms: Mapping[str, float]
    inner: Mapping[str, float] = field(default_factory=dict)
    reason: str = ""
    errors_to_chosen: Mapping[str, float | None] = field(default_factory=dict)
    separated_by: Mapping[str, str] | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the rival as the contract spells it."""
        return {
            "terms": [
                {"term": name, "coefficient": value, "inner": dict(self.inner)}
                for name, value in self.terms.items()
            ],
            "reason": self.reason,
            "errors_to_chosen": dict(self.errors_to_chosen),
            "separated_by": None if self.separated_by is None else dict(self.separated_by),
        }


@dataclass(frozen=True)
class Statement:
    """Something the data leave open.

    Attributes
    ----------
    quantity
        ``"N1"``, ``"N2"``.
    undetermined
        True if the data do not decide it at all; False if they do only with an assumption.
    text
        The statement for a reader.
    """

    quantity: str
    undetermined: bool
    text: str


def find_rivals(
    terms: Sequence[RecoveredTerm],
    met: Iterable[Mapping[str, Any]],
    model: DeclaredModel,
    flows: Sequence[Flow],
) -> list[Rival]:
    """Return rivals of a law, closest first.

    Parameters
    ----------
    terms
        The chosen law.
    met
        Rivals that the sparse search met: ``support``, ``coefficients``, ``inner``.
    model
        The known part.
    flows
        Training flows, which the rivals have to fit, and tests, which may separate them.
    """
    inner = {name: value for term in terms for name, value in term.inner.items()}
    chosen = {term.term: term.coefficient for term in terms}
    seen = [flow for flow in flows if flow.kind == "training"]
    unseen = [flow for flow in flows if flow.kind in ("test", "held_out")]
    reference = _simulate(chosen, inner, model, [*seen, *unseen])
    candidates: dict[frozenset[str], Rival] = {}
    for other, reason in _twins(chosen):
        rival = _judge(Rival(other, inner, reason), reference, model, seen, unseen)
        if rival is not None and (rival.errors_to_chosen["sigma12"] or 0.0) <= EXACT:
            candidates.setdefault(frozenset(other), rival)
    for row in met:
        other = dict(zip(row["support"], row["coefficients"], strict=True))
        reason = "The sparse search met it, and the data fit it as well within their noise."
        if row.get("exact"):
            reason = "The sparse search met it, and it fits the data identically."
        if frozenset(other) in candidates or len(candidates) >= MOST_RIVALS:
            continue
        rival = _judge(Rival(other, row["inner"], reason), reference, model, seen, unseen)
        if rival is not None:
            candidates[frozenset(other)] = rival
    return list(candidates.values())


def _twins(chosen: Mapping[str, float]) -> list[tuple[dict[str, float], str]]:
    """Return laws that simple shear cannot tell apart on paper; each is checked afterwards."""
    twins = []
    if set(chosen) == {_SLIP}:
        slip = 2.0 * chosen[_SLIP]
        twins.append(
            (
                {_SLIP_TWIN: slip * (1.0 - slip / 2.0)},
                "Gives the same σ12 and the same N1 in every simple-shear history, without N2.",
            )
        )
    if set(chosen) == {_SLIP_TWIN} and chosen[_SLIP_TWIN] <= 0.5:
        slip = 1.0 - np.sqrt(1.0 - 2.0 * chosen[_SLIP_TWIN])
        twins.append(
            (
                {_SLIP: float(slip / 2.0)},
                "Johnson–Segalman: the same σ12 and the same N1 in every simple-shear history, "
                f"with N2 = −{slip / 2.0:.3g} N1.",
            )
        )
    parasite = dict(chosen)
    for name, value in _PARASITE.items():
        parasite[name] = parasite.get(name, 0.0) + _PARASITE_SIZE * value
    twins.append(
        (
            parasite,
            "The added pair acts on σ33 only, so N2 changes while σ12 and N1 do not; any size "
            "of it fits the data as well.",
        )
    )
    return twins


def _simulate(terms, inner, model: DeclaredModel, flows) -> dict[str, Stresses | None]:
    law = law_of_terms(
        list(terms), list(terms.values()), inner, model.law.linear_relaxation, model.law
    )
    fluid = Fluid(law, model.modulus, model.relaxation_time, model.solvent_viscosity)
    return {flow.key: predict(fluid, flow) for flow in flows}


def _judge(rival: Rival, reference, model, seen, unseen) -> Rival | None:
    predictions = _simulate(rival.terms, rival.inner, model, [*seen, *unseen])
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
    return Rival(
        rival.terms,
        rival.inner,
        rival.reason,
        worst,
        place if separation > SEPARATED else None,
    )


def undetermined_quantities(
    flows: Sequence[Flow], normal_stresses_used: bool, rivals: Sequence[Rival]
) -> list[Statement]:
    """Return what the training data leave open, with the reason.

    Parameters
    ----------
    flows
        The flows; the training ones say what was measured.
    normal_stresses_used
        Whether measured normal stresses were part of the fit.
    rivals
        From `find_rivals`.
    """
    measured = [flow.reference for flow in flows if flow.kind == "training" and not flow.is_truth]
    seen = {q for q in ("N1", "N2") if normal_stresses_used and any(q in m for m in measured)}
    statements = []
    if "N2" not in seen:
        example = next(
            (
                r
                for r in rivals
                if (r.errors_to_chosen.get("N2") or 0.0) > SEPARATED
                and (r.errors_to_chosen.get("sigma12") or 0.0) <= EXACT
            ),
            None,
        )
        text = (
            "N2 was not measured, and σ12 in simple shear does not decide it: terms that act "
            "on σ33 alone leave no trace in σ12 or N1. The N2 shown is that of the simplest law "
            "that fits."
        )
        if example is not None:
            text += (
                " Checked by simulation: "
                + " ".join(f"{value:+.3g} {name}" for name, value in example.terms.items())
                + f" gives the same σ12 but an N2 that differs by "
                f"{100.0 * (example.errors_to_chosen['N2'] or 0.0):.2g} % of N1."
            )
        statements.append(Statement("N2", True, text))
    if "N1" not in seen:
        statements.append(
            Statement(
                "N1",
                False,
                "N1 was not measured. It follows from the upper convected derivative that the "
                "model assumes together with the terms found, and is as good as that assumption.",
            )
        )
    return statements
