"""What is to be said of N1 and N2, which the learners seldom see: open, or on which condition not.

No data say that the law is in the library. So the best that can be said of a quantity which was
not measured is conditional, and nothing is said where no law of the library explains the data.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from discover.comparison.judging.band_check import BandCheck, check_band, unbounded
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.identifiability import EXACT, SEPARATED, Rival, law_structure
from discover.comparison.outcomes.flows import MEASURED, QUANTITIES, Flow
from discover.identify import Structure
from discover.identify.exact.relations import spell_briefly
from discover.identify.rivals.bands import PredictionBand
from discover.protocols.kinematics import LINEAR_STRAIN, ONLY_STATES
from discover.words import percent_of

Determined = Literal["no", "if_the_law_is_in_the_library"]

IN_LIBRARY: Determined = "if_the_law_is_in_the_library"

_NORMAL_STRESSES = ("N1", "N2")
_TITLES = {
    "sigma12": "σ12",
    "relaxation_time_s": "Declared relaxation time",
    "modulus_Pa": "Declared modulus",
}
_ONLY_EXTENSION = (
    "Only extension was measured, which does not say what a fluid does in shear; what is shown is "
    "the choice of the law that fits."
)
Where = Literal["", "transients", "others", "unbounded"]
_WHERE = {
    "transients": "σ12 in transients",
    "others": "σ12 in other flows",
    "unbounded": "σ12 where laws run away",
}
_UNTESTED = (
    "No run was held out, and no more flows were fitted than the law has terms, so no other flow "
    "tested the law, and {} is not determined. Fit another run, or hold one out."
)
_AS_MANY_TERMS = (
    "The law has {} terms, and no more flows than that were measured, fitted and held out: so many "
    "terms follow so few flows of a fluid that the library does not hold, and {} is not "
    "determined. Fit more runs."
)
_AS_MANY_LOADINGS = (
    "The law has {} terms, and no more than {} flows were measured, fitted and held out. Each is a "
    "loading of its own and tells no level, so it tests half as much, and {} is not determined. "
    "Fit more runs."
)


@dataclass(frozen=True)
class Statement:
    """What the data say of a quantity.

    Attributes
    ----------
    quantity
        ``"N1"``, ``"N2"``; or a declared constant as a study spells it, ``"relaxation_time_s"``.
    determined
        On which condition the data decide it.
    text
        The reason, for a reader.
    brief
        What the verdict says of it; empty where that needs no words of its own.
    where
        Of which flows it is, if not of all: of transients, and not of steady and periodic states;
        of those that were neither fitted nor held out; of those in which no band has an end.
    """

    quantity: str
    determined: Determined
    text: str
    brief: str = ""
    where: Where = ""

    @property
    def title(self) -> str:
        """The quantity as a reader knows it."""
        return _WHERE.get(self.where, _TITLES.get(self.quantity, self.quantity))

    def leaves_open(self, quantity: str, flow: Flow) -> bool:
        """Return whether it says that a quantity is not determined in a flow.

        In extension the recorded stress is none of those that statements are about.
        """
        if not self.undetermined or self.quantity != quantity:
            return False
        if quantity != "sigma12":
            return True
        # without an end a band is none, and says nothing already
        if self.where == "unbounded" or (self.where == "others" and flow.kind in MEASURED):
            return False
        return flow.in_shear and not (self.where == "transients" and flow.is_of_states)

    @property
    def of_law(self) -> bool:
        """Whether it is a quantity that the law predicts, and no declared constant."""
        return self.quantity in QUANTITIES

    @property
    def undetermined(self) -> bool:
        """Whether the data do not decide it at all."""
        return self.determined == "no"

    def to_json(self) -> dict[str, Any]:
        """Return the statement as ``comparison.json`` holds it."""
        return {
            "quantity": self.quantity,
            "undetermined": self.undetermined,
            "determined": self.determined,
            "text": self.text,
        }


def make_statements(
    explanation: Explanation,
    flows: Sequence[Flow],
    rivals: Sequence[Rival],
    structure: Structure | None = None,
    bands: Mapping[str, PredictionBand] | None = None,
    normal_stresses_used: bool = False,
    n_terms: int = 0,
    own_loadings: bool = False,
) -> list[Statement]:
    """Return what the training data say of N1 and N2, with the reason.

    Parameters
    ----------
    explanation
        Whether any law explains the training data. Where no law of the library does, nothing is
        determined.
    flows
        The flows; the training ones say what was measured, the others judge the bands.
    rivals
        From `find_rivals`.
    structure
        From `structure_of`, where the sparse learner ran; it decides what σ12 could say.
    bands
        Of the sparse law, by the key of the flow. Without one nothing is determined.
    normal_stresses_used
        Whether measured normal stresses were part of the fit.
    n_terms
        Of the sparse law.
    own_loadings
        Whether each run is a loading of its own, with a factor on its record.
    """
    if explanation.verdict == "no_signal":
        text = "The records hold no signal, so they say nothing of {}."
        return [Statement(q, "no", text.format(q)) for q in _NORMAL_STRESSES]
    if "tensor_sindy" in explanation.lack_of_fit and not explanation.in_library:
        return [Statement(q, "no", _unexplained(q, explanation)) for q in _NORMAL_STRESSES]
    training = [flow for flow in flows if flow.kind == "training"]
    if training and not any(flow.in_shear for flow in training):
        return [Statement(q, "no", _ONLY_EXTENSION) for q in QUANTITIES]
    states = only_states(flows)
    found = [Statement("sigma12", "no", ONLY_STATES, where="transients")] if states else []
    at = law_structure(structure)
    if at is None:
        return found + _without_structure(explanation, flows, rivals, normal_stresses_used)
    untested = no_flow_left(flows, n_terms)
    few = _few_flows(_flows_measured(flows), n_terms, own_loadings)
    if (untested or few) and not states:
        text = (_UNTESTED if untested else few).format("σ12 in them")
        found = [Statement("sigma12", "no", text, where="others")]
    if not found and (away := unbounded(flows, bands or {})):
        found = [Statement("sigma12", "no", away, where="unbounded")]
    for quantity in at.quantities:
        if quantity.verdict == "measured":
            continue
        determined: Determined = "no"
        text = quantity.text
        if not quantity.open and states:
            text = ONLY_STATES
        elif not quantity.open and untested:
            text = _UNTESTED.format(quantity.quantity)
        elif not quantity.open and few:
            text = few.format(quantity.quantity)
        elif not quantity.open:
            noise = explanation.lack_of_fit["tensor_sindy"].noise
            check = check_band(quantity.quantity, flows, bands or {}, noise)
            determined = IN_LIBRARY if check.holds else "no"
            text = f"{text} {_of_band(quantity.quantity, check)}"
        found.append(Statement(quantity.quantity, determined, text))
    return found


def _few_flows(measured: int, n_terms: int, own_loadings: bool) -> str:
    """Return why so few flows test no law of so many terms, with a place for the quantity."""
    if n_terms > 0 and measured <= n_terms:
        return _AS_MANY_TERMS.format(n_terms, "{}")
    if own_loadings and n_terms > 1 and measured <= 2 * n_terms:
        return _AS_MANY_LOADINGS.format(n_terms, 2 * n_terms, "{}")
    return ""


def no_flow_left(flows: Sequence[Flow], n_terms: int) -> bool:
    """Return whether a law was never asked of another flow than those that its terms take.

    As `discover.loop.runs.why_untested` asks of a loop; a law without terms takes one.
    """
    kinds = {flow.kind for flow in _measured(flows)}
    return kinds == {"training"} and _flows_measured(flows) <= max(n_terms, 1)


def only_states(flows: Sequence[Flow]) -> bool:
    """Return whether all that was measured are steady or periodic states, and no transient."""
    measured = _measured(flows)
    return bool(measured) and all(flow.is_of_states for flow in measured)


def _flows_measured(flows: Sequence[Flow]) -> int:
    """Return how many flows were fitted or held out that a law could fail in.

    Each state of a table is one, but none of an oscillation so small that it is linear.
    """
    return sum(_flows_in(flow) for flow in _measured(flows))


def _flows_in(flow: Flow) -> int:
    if flow.protocol.control == "oscillation":
        return int(np.count_nonzero(np.asarray(flow.strain) > LINEAR_STRAIN))
    return len(flow.times) if flow.is_of_states else 1


def _measured(flows: Sequence[Flow]) -> list[Flow]:
    return [flow for flow in flows if flow.kind in MEASURED]


def claimed(
    bands: Mapping[str, PredictionBand], statements: Sequence[Statement], flows: Sequence[Flow]
) -> dict[str, PredictionBand]:
    """Return the bands without limits of what is not determined: no claim is made there."""
    by_key = {flow.key: flow for flow in flows}
    found = {}
    for key, band in bands.items():
        column = np.array(
            [any(s.leaves_open(name, by_key[key]) for s in statements) for name in QUANTITIES]
        )
        limits = {
            name: np.where(column, np.nan, getattr(band, name))
            for name in ("low", "high", "rivals_low", "rivals_high")
        }
        found[key] = replace(band, **limits)
    return found


def _unexplained(quantity: str, explanation: Explanation) -> str:
    text = (
        f"No law that was tried explains the data, so the {quantity} of the law shown is that of a "
        "law which is known to be incomplete."
    )
    if explanation.by:
        text += (
            " The neural network explains them, but many laws of its kind do, and they differ in "
            f"{quantity}."
        )
    return text


def _of_band(quantity: str, check: BandCheck) -> str:
    beyond = f"A law outside the library may give the same σ12 and another {quantity}."
    if check.half_width is None:
        return f"No band says how far it could lie from the {quantity} shown. {beyond}"
    if check.missed:
        return (
            f"But in {check.missed} the {quantity} known lies outside the band, by "
            f"{percent_of(check.off)}, so the band is not to be believed. {beyond}"
        )
    if not np.isfinite(check.half_width):
        return (
            "But in some flow too many laws within the parameters' intervals run away, so no band "
            f"says how far it could lie from the {quantity} shown. {beyond}"
        )
    if not check.holds:
        return f"But the parameters' intervals leave a band that is wider than {quantity} itself."
    width = f"± {percent_of(max(check.half_width, 1e-5))}"
    of = " of N1" if quantity == "N2" else ""
    return f"Then its 95 % band is {width}{of} at the widest. {beyond}"


def _without_structure(
    explanation: Explanation,
    flows: Sequence[Flow],
    rivals: Sequence[Rival],
    normal_stresses_used: bool,
) -> list[Statement]:
    measured = [flow.reference for flow in flows if flow.kind == "training" and not flow.is_truth]
    seen = {q for q in _NORMAL_STRESSES if normal_stresses_used and any(q in m for m in measured)}
    found = []
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
                + spell_briefly(example.law.coefficients)
                + f" gives the same σ12 but an N2 that differs by "
                f"{percent_of(example.errors_to_chosen['N2'] or 0.0)} of N1."
            )
        found.append(Statement("N2", "no", text))
    if "N1" not in seen:
        text = (
            "N1 was not measured. It follows from the upper convected derivative that the model "
            "assumes together with what was found, and no band says how far else it could lie."
        )
        if explanation.verdict == "unexplained":
            text = "N1 was not measured, and no law found explains σ12."
        found.append(Statement("N1", "no", text))
    return found
