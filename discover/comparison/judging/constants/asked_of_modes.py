"""Whether the modes of a fluid share their constants, as far as the runs can tell."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from discover.comparison.fitting.coefficients_in_modes import (
    CoefficientsInModes,
    coefficients_in_modes,
)
from discover.comparison.fitting.law_by_mode import LawByMode, SparseLaw, fit_laws_by_mode
from discover.comparison.instrument import Frame
from discover.comparison.judging.constants.modes_apart import said_of_each_mode
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.other_causes.misread_runs import as_misread
from discover.comparison.judging.unseen_runs import hold_against_unseen, misses
from discover.comparison.outcomes.flows import Flow, columns_of
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.inference.by_mode.degrees import lowest_not_refuted
from discover.statistics.residual import Expectation

_LAW = "constants_by_mode"

_BY_MODES_APART = (
    "The runs held out do not follow coefficients that are the same in every mode. Those that "
    "differ, which the fitted runs allow, would, as another law may: fit one of them too."
)


@dataclass(frozen=True)
class OfModes:
    """What was found of the modes.

    Attributes
    ----------
    alike
        What the fitted runs say of each mode where equal coefficients explain them.
    law
        The best law with constants by mode; None where equal ones do as well.
    said
        For a reader; empty where there is one mode, or `law` says it.
    """

    alike: CoefficientsInModes | None = None
    law: LawByMode | None = None
    said: str = ""


def ask_of_modes(
    chosen: LearnerOutcome,
    frame: Frame,
    fitted_explained: bool,
    explanation: Explanation,
    expectation: Expectation,
    n_candidates: int,
    flows: Sequence[Flow],
    thorough: bool = False,
) -> OfModes:
    """Return what the runs say of each mode, and the law by mode where one for all is in doubt.

    It is where the law found explains nothing, or needs several terms: what differs from mode to
    mode looks like a little of many terms.

    Parameters
    ----------
    chosen
        What sparse regression found.
    frame
        In which it did.
    fitted_explained
        Whether its law explains the runs that were fitted.
    explanation
        Whether it explains those held out too.
    expectation
        What a complete law may leave.
    n_candidates
        Number of terms in the library.
    flows
        All flows, with what was recorded in them.
    thorough
        Whether laws by mode are ranked on all samples.
    """
    model, terms = frame.model, chosen.terms
    if len(model.modulus) < 2 or not model.law.linear_relaxation:
        return OfModes()
    alike, said = None, ""
    if fitted_explained:
        if not terms and explanation.in_library:
            return OfModes()
        if terms:
            alike = coefficients_in_modes(model, terms, frame.data.fit.runs, frame.flows)
        if explanation.in_library:
            constants = {} if alike is None else alike.constants
            n_modes = len(model.modulus)
            others = None if alike is None else alike.others
            said = " ".join(
                said_of_each_mode(t.term, constants.get(t.term), n_modes, others) for t in terms
            )
            if alike is not None and len(terms) == 1 and not alike.differ:
                return OfModes(alike, None, said)
        elif alike is not None and _holds(frame, alike, explanation):
            said = _BY_MODES_APART
    law = _law_by_mode(chosen, frame, expectation, n_candidates, flows, thorough)
    return OfModes(alike, law, said if law is None else "")


def _holds(frame: Frame, alike: CoefficientsInModes, explanation: Explanation) -> bool:
    """Return whether every run held out lies in the band of coefficients that differ by mode."""
    noise = explanation.lack_of_fit["tensor_sindy"].noise
    held_out = [flow for flow in frame.flows if flow.kind == "held_out"]
    return bool(held_out) and all(_inside(flow, alike, noise) for flow in held_out)


def _inside(flow: Flow, alike: CoefficientsInModes, noise: float) -> bool:
    band = alike.bands.get(flow.key)
    if band is None or band.reason:
        return False
    return not misses({"sigma12": (band.rivals_low[:, 0], band.rivals_high[:, 0])}, flow, noise)


def _law_by_mode(
    chosen: LearnerOutcome,
    frame: Frame,
    expectation: Expectation,
    n_candidates: int,
    flows: Sequence[Flow],
    thorough: bool,
) -> LawByMode | None:
    model, training = frame.model, [flow for flow in frame.flows if flow.kind == "training"]
    predicted = [chosen.predictions[flow.key] for flow in training]
    seen = [np.asarray(one["sigma12"]) for one in predicted if one is not None]
    if len(seen) < len(predicted):
        return None  # it runs away in a run that it was learned from
    sparse = SparseLaw(
        [term.term for term in chosen.terms],
        sum(1 + len(term.inner) for term in chosen.terms),
        seen,
    )
    runs = frame.data.fit.runs, frame.data.held_out.runs
    path = chosen.details.get("path", ())
    asked = expectation, n_candidates, frame.flows, thorough
    laws = fit_laws_by_mode(model, path, sparse, *runs, *asked)
    held = (
        _held_against_unseen(replace(law, bands=frame.bands(law.bands)), flows, expectation)
        for law in laws
    )
    first = next(held, None)
    if first is None:
        return None
    found = lowest_not_refuted(first, lambda _: next(held, None), lambda law: law.refuted)
    return found if found.explains else first


def _held_against_unseen(
    law: LawByMode, flows: Sequence[Flow], expectation: Expectation
) -> LawByMode:
    """Return the law, which explains nothing where runs held out refute it."""
    nothing = np.zeros(0)
    predictions = {key: columns_of(band.chosen) for key, band in law.bands.items()}
    outcome = LearnerOutcome(_LAW, (), 0.0, (nothing, nothing), predictions=predictions)
    followed = [flow for flow in flows if flow.key in law.bands]
    fitted = Explanation({_LAW: law.left}, expectation=expectation)
    both = hold_against_unseen(fitted, {_LAW: outcome}, followed, law.bands, expectation, _LAW)
    left = both.lack_of_fit[_LAW]
    refuted = law.explains and left.verdict != "explained"
    if left.verdict == "explained" and law.misread is not None:
        left = as_misread(law.misread).of(left)
    return replace(law, left=left, refuted=refuted)
