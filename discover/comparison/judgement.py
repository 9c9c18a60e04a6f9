"""What is to be believed of what the learners found: one judgement from all checks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from discover.comparison.at_once import at_once
from discover.comparison.fitting.classical import CLASSICAL, ClassicalFit, fit_classical_laws
from discover.comparison.fitting.further_laws import fit_further_laws
from discover.comparison.fitting.law_by_mode import (
    LawByMode,
    SparseLaw,
    coefficient_in_modes,
    fit_law_by_mode,
)
from discover.comparison.fitting.named_effects import NamedExplanation, fit_named_effects
from discover.comparison.instrument import Frame, classical_along
from discover.comparison.instrument.known import Known
from discover.comparison.judging.declared_constants import (
    OtherConstant,
    other_constants,
    with_other_constants,
    with_other_gain,
)
from discover.comparison.judging.dense_library import (
    DENSE,
    open_where_dense_is_wide,
    with_gain_in_dense,
    without_refuted_bands,
)
from discover.comparison.judging.disagreement import contested, disagreements, open_where_contested
from discover.comparison.judging.explanation import Explanation, explain, what_it_leaves
from discover.comparison.judging.identifiability import (
    Rival,
    find_rivals,
    structure_of,
)
from discover.comparison.judging.modes_apart import open_where_modes_differ, said_of_each_mode
from discover.comparison.judging.modes_error import left_open_by_modes
from discover.comparison.judging.named_bands import with_named_effects
from discover.comparison.judging.next_measurement import NextMeasurement, next_measurement
from discover.comparison.judging.small_strain import with_small_strain_told
from discover.comparison.judging.statements import (
    ONLY_STATES,
    Statement,
    claimed,
    make_statements,
    only_states,
)
from discover.comparison.judging.unseen_runs import hold_against_unseen
from discover.comparison.outcomes.expected import expectation_of
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.repeats import repeats_among
from discover.identify import Structure
from discover.identify.rivals.bands import PredictionBand
from discover.progress import Progress
from discover.statistics.residual import Expectation
from discover.study.data import StudyData
from discover.study.schema import Study
from tensor_library.library import TermLibrary


@dataclass(frozen=True)
class Judgement:
    """What is to be believed, and what stays open.

    Attributes
    ----------
    explanation
        Whether the laws found explain the data.
    outcomes
        What the learners found, without the claims that the data do not bear.
    rivals, structure
        Laws that the data do not rule out, and what the sparse law's terms leave open.
    statements
        What is determined, quantity by quantity.
    next_measurement
        What to measure next, and the bands of what is determined.
    classical
        The classical laws fitted to the same runs.
    warnings
        Where predictions of laws that fit disagree.
    by_mode
        The best law whose constants differ from mode to mode; None where none was asked for, or
        one constant for all modes does as well.
    """

    explanation: Explanation
    outcomes: dict[str, LearnerOutcome]
    rivals: Sequence[Rival]
    structure: Structure | None
    statements: Sequence[Statement]
    next_measurement: NextMeasurement
    classical: Sequence[ClassicalFit]
    warnings: tuple[str, ...]
    by_mode: LawByMode | None = None


def judge(
    study: Study,
    known: Known,
    library: TermLibrary,
    own: Mapping[str, LearnerOutcome],
    frames: Mapping[str, Frame],
    seed: int,
    say: Callable[[str], None],
    undated: StudyData | None = None,
) -> Judgement:
    """Return what is to be believed of what each learner found.

    Parameters
    ----------
    study, known, library
        The study, the known part with the flows of the page, and the terms that were searched.
    own, frames
        What each learner found, and the frame in which it did.
    seed
        Of the draws.
    say
        Called with what is going on.
    undated
        The data before instants of steps of the rate were fitted; by default those at hand.
    """
    flows, normal = known.flows, study.compare.use_normal_stresses
    outcomes = {name: frames[name].outcome(outcome) for name, outcome in own.items()}
    repeats = repeats_among(list(known.before.data.dataset))
    expectation = expectation_of(study, known.before.model, repeats)
    explanation = explain(outcomes, flows, expectation, normal, repeats)
    chosen, frame = own.get("tensor_sindy"), frames.get("tensor_sindy", known.before)
    fitted = [flow for flow in flows if flow.kind == "training"]
    judged = [flow for flow in flows if flow.kind in ("test", "held_out")] or fitted
    following = NextMeasurement()
    beside = _Beside((), None, ())
    if explanation.verdict != "no_signal":
        beside = _beside(study, known, library, chosen, frame, say)
    rivals, structure = beside.rivals, beside.structure
    others: list[OtherConstant] = []
    own_bands: Mapping[str, PredictionBand] = {}
    if chosen is not None and explanation.in_library:
        # where a quantity is said to be determined, its band says how well
        keys = {flow.key for flow in (*judged, *fitted)}
        banded = [flow for flow in frame.flows if flow.key in keys]
        # bands and experiments take it that the law, or a rival, is the fluid's
        left = explanation.lack_of_fit["tensor_sindy"]
        # outliers are no noise of the next experiment
        misfit = left.misfit if left.outliers else None
        following = next_measurement(
            chosen, rivals, frame.model.fluid, banded, study.compare.next, seed, misfit
        )
        others = other_constants(chosen.terms, frame.model)
        own_bands = following.bands if normal else with_other_gain(following.bands, others)
        following = replace(following, bands=frame.bands(own_bands))
    explanation = hold_against_unseen(explanation, outcomes, flows, following.bands, expectation)
    if not explanation.in_library:
        following, own_bands, others = NextMeasurement(), {}, []
    outcomes = {name: _told(outcome, explanation) for name, outcome in outcomes.items()}
    outcomes = with_gain_in_dense(with_small_strain_told(outcomes, explanation, others), others)
    outcomes, refuted = without_refuted_bands(outcomes, flows, expectation, normal)
    bands, silent_records = following.bands, explanation.verdict == "no_signal"
    if DENSE in outcomes and not (silent_records or normal or study.compare.quick):
        say("effects with a name beside the dense library")
        frame_of_dense = frames[DENSE]
        # what a known instrument did is taken out of the data at hand alone
        data = frame_of_dense.data if known.effects or undated is None else undated
        named = _named(frame_of_dense, data, flows, expectation)
        left = what_it_leaves(outcomes[DENSE], fitted, expectation, normal) if fitted else None
        outcomes, told = with_named_effects(outcomes, flows, named, left)
        refuted = [*refuted, *told]
    statements = make_statements(explanation, frame.flows, rivals, structure, own_bands, normal)
    if not silent_records:
        statements = open_where_contested(statements, contested(outcomes, judged, bands))
        statements = open_where_dense_is_wide(statements, outcomes, judged)
    by_mode, one_for_all = None, ""
    # of normal stresses that were fitted too a law by mode says nothing
    if not (chosen is None or silent_records or normal or study.compare.quick):
        say("constants that differ from mode to mode")
        by_mode, one_for_all = _by_mode(chosen, frame, explanation, expectation, len(library))
        statements = open_where_modes_differ(statements, by_mode, explanation.in_library)
    if chosen is not None:
        statements = with_other_constants(statements, chosen.terms, others, frame.model)
    apart = [*refuted, *disagreements(outcomes, judged, bands)]
    if known.along is not None and known.along.constants.moves_modes:
        statements = [replace(s, text=f"{s.text} {_MODES_NOT_IN_BANDS}") for s in statements]
    return Judgement(
        explanation,
        outcomes,
        rivals,
        structure,
        statements,
        replace(following, bands=claimed(bands, statements, flows)),
        () if silent_records else beside.classical,
        ()
        if silent_records
        else (
            *_of_modes(outcomes, explanation, expectation),
            *((one_for_all,) if one_for_all else ()),
            *((ONLY_STATES,) if explanation.by and only_states(flows) else ()),
            *apart,
        ),
        by_mode,
    )


def _named(
    frame: Frame, data: StudyData, flows: Sequence[Flow], expectation: Expectation
) -> Sequence[NamedExplanation]:
    """Return what explains the runs and has a name; of a law that does not relax nothing is."""
    if frame.made or not frame.model.law.linear_relaxation:
        return ()
    runs = data.fit.runs, data.held_out.runs
    return fit_named_effects(frame.model, *runs, flows, expectation)


class _Beside(NamedTuple):
    """What is looked at beside the laws found, for the fields of `Judgement` of the same names."""

    rivals: Sequence[Rival]
    structure: Structure | None
    classical: Sequence[ClassicalFit]


def _beside(
    study: Study,
    known: Known,
    library: TermLibrary,
    chosen: LearnerOutcome | None,
    frame: Frame,
    say: Callable[[str], None],
) -> _Beside:
    """Return rivals, structure and classical laws, which need nothing of one another."""

    def classical(tell: Progress) -> Sequence[ClassicalFit]:
        tell("fitted to the same runs", 0.0)
        # the criterion of the sparse law counts these, and both stand in one column
        return _classical(study, known, chosen and chosen.details.get("n_independent"))

    def rivals(tell: Progress) -> Sequence[Rival]:
        assert chosen is not None
        tell("simulating laws that the data do not rule out", 0.0)
        met, model = chosen.details.get("rivals", ()), frame.model
        return find_rivals(chosen.terms, met, model, frame.flows, library, chosen.predictions)

    def structure(tell: Progress) -> Structure:
        assert chosen is not None
        tell("what the runs can tell of it", 0.0)
        runs, normal = frame.data.fit.runs, study.compare.use_normal_stresses
        return structure_of(chosen.terms, runs, library, frame.model, normal)

    parts: dict[str, Callable[[Progress], Any]] = {"the classical laws": classical}
    if chosen is not None:
        parts |= {"rivals": rivals, "the library": structure}
    found = at_once(parts, lambda text, _: say(text))
    return _Beside(found.get("rivals", ()), found.get("the library"), found["the classical laws"])


def _by_mode(
    chosen: LearnerOutcome,
    frame: Frame,
    explanation: Explanation,
    expectation: Expectation,
    n_candidates: int,
) -> tuple[LawByMode | None, str]:
    """Return the best law with constants by mode, where one for all modes is in doubt.

    It is where the law found explains nothing, or needs several terms: what differs from mode to
    mode looks like a little of many terms. Of one term that explains the runs, the second is a
    sentence on what they say of each mode.
    """
    model, training = frame.model, [flow for flow in frame.flows if flow.kind == "training"]
    predicted = [chosen.predictions[flow.key] for flow in training]
    n_modes = len(model.modulus)
    if n_modes < 2 or not model.law.linear_relaxation:
        return None, ""
    if explanation.in_library and not chosen.terms:
        return None, ""
    if explanation.in_library and len(chosen.terms) == 1:
        (term,) = chosen.terms
        alike = coefficient_in_modes(model, term, frame.data.fit.runs)
        if alike is None or not alike.degree:
            return None, said_of_each_mode(term.term, alike, n_modes)
    seen = [np.asarray(one["sigma12"]) for one in predicted if one is not None]
    if len(seen) < len(predicted):
        return None, ""  # it runs away in a run that it was learned from
    sparse = SparseLaw(
        [term.term for term in chosen.terms],
        sum(1 + len(term.inner) for term in chosen.terms),
        seen,
    )
    runs = frame.data.fit.runs, frame.data.held_out.runs
    path = chosen.details.get("path", ())
    return fit_law_by_mode(model, path, sparse, *runs, expectation, n_candidates), ""


def _of_modes(
    outcomes: Mapping[str, LearnerOutcome], explanation: Explanation, expectation: Expectation
) -> tuple[str, ...]:
    """Return what the sweep's error leaves open of a sparse law that explains the runs."""
    chosen = outcomes.get("tensor_sindy")
    if chosen is None or not explanation.in_library:
        return ()
    misfit = explanation.lack_of_fit["tensor_sindy"].misfit
    path = chosen.details.get("path", ())
    network = "tbnn_ude" in outcomes
    error = expectation.linear_error
    said = left_open_by_modes(path, len(chosen.terms), misfit, error, network)
    return (said,) if said else ()


_MODES_NOT_IN_BANDS = (
    "A factor on the modes was fitted along, and its interval is in no band of N1 or N2."
)


def _classical(study: Study, known: Known, independent: float | None) -> Sequence[ClassicalFit]:
    """Return the classical laws, with the same constants fitted along as the learners have.

    Behind them those that the study names, with the constants that the known part alone has.
    """
    before = known.before
    further = [name for name in study.compare.laws if name not in CLASSICAL]
    fits = fit_further_laws(
        further, before.model, before.data.fit.runs, before.flows, before.recorded, independent
    )
    if known.along is None:
        relaxes = study.model.known_relaxation
        return [*fit_classical_laws(before.model, known.flows, relaxes, independent), *fits]
    each = [
        known.frame_of(known.along.constants.raw(known.along.before.classical[law].theta))
        for law in CLASSICAL
    ]
    return [*classical_along(known.along, each, known.flows, independent), *fits]


def _told(outcome: LearnerOutcome, explanation: Explanation) -> LearnerOutcome:
    """Return an outcome without the claims that its data do not bear."""
    if explanation.verdict == "no_signal":
        message = "The records hold no signal, so what was fitted to them is no law"
        return replace(outcome, terms=(), message=message, details={})
    if outcome.learner == "tensor_sindy" and not explanation.in_library:
        tested = int(outcome.details.get("tested") or 0)
        text = f"{tested} other laws were tried. " if tested else ""
        text += (
            "No law that was tried explains these data, so ruling out others says nothing; the "
            "laws below are those that describe the data about as well as the best."
        )
        return replace(outcome, details={**outcome.details, "rivals_text": text})
    return outcome
