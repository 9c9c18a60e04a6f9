"""What is to be believed of what the learners found: one judgement from all checks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from discover.comparison.beside import Beside, look_beside
from discover.comparison.fitting.classical import ClassicalFit
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.fitting.named_effects import NamedExplanation, fit_named_effects
from discover.comparison.instrument import Frame
from discover.comparison.instrument.known import Known
from discover.comparison.judging.bands.constants_in_bands import (
    law_with_fitted,
    with_fitted_constants,
)
from discover.comparison.judging.bands.dense_library import (
    DENSE,
    open_where_dense_is_wide,
    with_gain_in_dense,
    without_refuted_bands,
)
from discover.comparison.judging.bands.named_bands import (
    holding_named_effects,
    with_named_effects,
    with_named_told,
)
from discover.comparison.judging.bands.one_term_in_bands import holding_one_term_more
from discover.comparison.judging.bands.rates_in_bands import holding_rate_errors
from discover.comparison.judging.bands.second_normal_stress import with_any_second_normal_stress
from discover.comparison.judging.constants.asked_of_modes import OfModes, ask_of_modes
from discover.comparison.judging.constants.beside_other_constants import with_other_coefficients
from discover.comparison.judging.constants.declared_constants import (
    OtherConstant,
    other_constants,
    with_other_constants,
    with_other_gain,
)
from discover.comparison.judging.constants.modes_apart import (
    holding_modes_apart,
    open_where_modes_differ,
    with_intervals_of_modes,
)
from discover.comparison.judging.constants.modes_error import left_open_by_modes
from discover.comparison.judging.constants.small_strain import with_small_strain_told
from discover.comparison.judging.disagreement import contested, disagreements, open_where_contested
from discover.comparison.judging.explanation import Explanation, explain
from discover.comparison.judging.identifiability import Rival
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.next_measurement import (
    NextMeasurement,
    bands_of_law,
    next_measurement,
)
from discover.comparison.judging.other_causes.late_answers import hold_against_late_answers
from discover.comparison.judging.other_causes.loadings import OwnLoadings
from discover.comparison.judging.other_causes.misread_runs import hold_against_misreading
from discover.comparison.judging.other_causes.other_records import holding_other_records
from discover.comparison.judging.statements import (
    Statement,
    claimed,
    make_statements,
    only_states,
)
from discover.comparison.judging.unseen_runs import hold_against_unseen
from discover.comparison.outcomes.expected import expectation_of
from discover.comparison.outcomes.flows import DRAWN, Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.records.repeats import repeats_among
from discover.identify import Structure
from discover.identify.rivals.bands import PredictionBand
from discover.protocols.kinematics import ONLY_STATES
from discover.statistics.residual import Expectation
from discover.study.data import StudyData
from discover.study.schema import Study
from tensor_library.library import TermLibrary

_OF_MODES = "constants that differ from mode to mode"


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
    loadings: OwnLoadings | None = None,
) -> Judgement:
    """Return what is to be believed of what each learner found.

    Parameters
    ----------
    study, known, library
        The study, the known part with the flows of the page, and the terms that were searched.
    own, frames
        What each learner found, and the frame in which it did.
    say
        Called with what is going on.
    undated
        The data before instants of steps of the rate were fitted; by default those at hand.
    loadings
        The factors on the records of runs that are loadings of their own, which are taken out of
        `known`; None where all are one loading.
    """
    flows, normal = known.flows, study.compare.use_normal_stresses
    outcomes = {name: frames[name].outcome(outcome) for name, outcome in own.items()}
    repeats = repeats_among(list(known.before.data.dataset))
    expectation = expectation_of(study, known.before.model, repeats)
    at_first = explain(outcomes, flows, expectation, normal, repeats)
    if loadings is not None:
        at_first = loadings.held_against(at_first)
    chosen, frame = own.get("tensor_sindy"), frames.get("tensor_sindy", known.before)
    law = None if chosen is None else law_with_fitted(chosen, frame.model, known.fitted)
    is_silent = at_first.verdict == "no_signal"
    # of normal stresses that were fitted too a law by mode says nothing
    asks = not (chosen is None or is_silent or normal or study.compare.quick)

    def modes(explanation: Explanation) -> OfModes:
        assert chosen is not None
        seen = at_first.in_library, explanation, expectation, len(library), flows
        return ask_of_modes(chosen, frame, *seen, study.compare.recipe == "thorough")

    # what does not explain its own runs is asked whatever those held out say of it
    early = asks and not at_first.in_library
    beside = Beside((), None, ())
    if not is_silent:
        parts = {_OF_MODES: lambda: modes(at_first)} if early else {}
        beside = look_beside(study, known, library, chosen, frame, say, parts)
    tested = _tested(study, known, chosen, law, frame, outcomes, at_first, beside.rivals, seed)
    explanation = tested.explanation
    of_modes = beside.further.get(_OF_MODES, OfModes())
    if asks and not early:
        say(_OF_MODES)
        of_modes = modes(explanation)
    if of_modes.alike is not None and explanation.in_library:
        outcomes = with_intervals_of_modes(outcomes, of_modes.alike)
        tested = replace(tested, bands=holding_modes_apart(tested.bands, of_modes.alike))
    if explanation.in_library:
        left = explanation.lack_of_fit["tensor_sindy"]
        wider = holding_one_term_more(tested.bands, beside.structure, left, frame.flows)
        tested = replace(tested, bands=wider)
    outcomes = with_other_coefficients(outcomes, tested.others)
    of_records: tuple[str, ...] = ()
    if chosen is not None and law is not None and explanation.in_library and not normal:
        seen = outcomes, tested.bands, chosen, law, frame.flows, expectation
        outcomes, bands, of_records = holding_other_records(
            *seen, corrected=bool(frame.made), computed=study.data.synthetic is not None
        )
        runs = frame.data.dataset
        tested = replace(tested, bands=holding_rate_errors(bands, law, frame.flows, runs))
    outcomes = {name: _told(outcome, explanation) for name, outcome in outcomes.items()}
    outcomes = with_small_strain_told(outcomes, explanation, tested.others)
    outcomes = with_gain_in_dense(outcomes, tested.others)
    outcomes, refuted = without_refuted_bands(outcomes, flows, expectation, normal)
    behind_instrument = DENSE in frames and bool(known.effects and frames[DENSE].made)
    named: tuple[NamedExplanation, ...] = ()
    if DENSE in outcomes and not (is_silent or normal or study.compare.quick or behind_instrument):
        say("effects with a name beside the dense library")
        # what a known instrument did is taken out of the data at hand alone
        data = None if known.effects else undated
        named = _named(frames[DENSE], data, flows, expectation)
        outcomes = with_named_effects(outcomes, flows, named)
    beside_sparse = named if explanation.in_library and not frame.made else ()
    if beside_sparse:
        noise = explanation.lack_of_fit["tensor_sindy"].noise
        wider = holding_named_effects(tested.bands, flows, beside_sparse, noise)
        tested = replace(tested, bands=wider)
    if not normal:
        outcomes = with_any_second_normal_stress(outcomes, flows, explanation)
    bands = frame.bands(tested.bands)
    statements = _statements(study, known, chosen, frame, outcomes, tested, beside, of_modes)
    statements = with_named_told(statements, beside_sparse)
    warnings = [
        *_of_modes(outcomes, explanation, expectation),
        *((of_modes.said,) if of_modes.said else ()),
        *of_records,
        *((ONLY_STATES,) if explanation.by and only_states(flows) else ()),
        *refuted,
        *disagreements(outcomes, _judged(flows), bands),
    ]
    return Judgement(
        explanation,
        outcomes,
        beside.rivals,
        beside.structure,
        statements,
        replace(tested.following, bands=claimed(bands, statements, flows)),
        () if is_silent else beside.classical,
        () if is_silent else tuple(warnings),
        of_modes.law,
    )


def _named(
    frame: Frame, data: StudyData | None, flows: Sequence[Flow], expectation: Expectation
) -> tuple[NamedExplanation, ...]:
    """Return what has a name and explains the runs.

    Of a law that does not relax by itself nothing is tried.
    """
    if not frame.model.law.linear_relaxation:
        return ()
    data = frame.data if data is None else data
    runs = data.fit.runs, data.held_out.runs
    return fit_named_effects(frame.model, *runs, flows, expectation)


def _judged(flows: Sequence[Flow]) -> list[Flow]:
    """Return the flows in which laws are judged: those that no fit saw, or else those fitted."""
    unseen = [flow for flow in flows if flow.kind in ("test", "held_out")]
    return unseen or [flow for flow in flows if flow.kind == "training"]


@dataclass(frozen=True)
class _Tested:
    """What runs held out leave of a law that explains those fitted.

    Attributes
    ----------
    explanation
        Whether it explains both.
    bands
        Of the sparse law in its own frame, by the key of the flow; empty where it does not.
    others
        Declared constants that its linear terms amount to.
    following
        What to measure next.
    """

    explanation: Explanation
    bands: Mapping[str, PredictionBand] = field(default_factory=dict)
    others: Sequence[OtherConstant] = ()
    following: NextMeasurement = field(default_factory=NextMeasurement)


def _tested(
    study: Study,
    known: Known,
    chosen: LearnerOutcome | None,
    law: MovedLaw | None,
    frame: Frame,
    outcomes: Mapping[str, LearnerOutcome],
    at_first: Explanation,
    rivals: Sequence[Rival],
    seed: int,
) -> _Tested:
    flows, normal = known.flows, study.compare.use_normal_stresses
    fluid, bands, others = frame.model.fluid, {}, []
    laws = [rival.law for rival in rivals]
    if chosen is not None and law is not None and at_first.in_library:
        # where a quantity is said to be determined, its band says how well
        keys = {flow.key for flow in flows if flow.kind in DRAWN}
        banded = [flow for flow in frame.flows if flow.key in keys]
        # bands take it that the law, or a rival, is the fluid's
        bands = bands_of_law(chosen, laws, fluid, banded, seed)
        bands = with_fitted_constants(bands, law, frame.flows)
        others = other_constants(chosen.terms, frame.model)
        bands = bands if normal else with_other_gain(bands, others)
    seen = frame.bands(bands)
    explanation = hold_against_unseen(at_first, outcomes, flows, seen, at_first.expectation)
    if not frame.made:  # what a known instrument does is in the predictions already
        explanation = hold_against_late_answers(explanation, outcomes, flows, seen)
        explanation = hold_against_misreading(explanation, outcomes, flows, seen, law)
    if chosen is None or not explanation.in_library:
        return _Tested(explanation)
    left = at_first.lack_of_fit["tensor_sindy"]
    # outliers are no noise of the next experiment
    misfit = left.misfit if left.outliers else None
    options = study.compare.next
    following = next_measurement(chosen, laws, fluid, options, seed, misfit)
    return _Tested(explanation, bands, others, following)


def _statements(
    study: Study,
    known: Known,
    chosen: LearnerOutcome | None,
    frame: Frame,
    outcomes: Mapping[str, LearnerOutcome],
    tested: _Tested,
    beside: Beside,
    of_modes: OfModes,
) -> list[Statement]:
    """Return what is determined, quantity by quantity."""
    explanation, judged = tested.explanation, _judged(known.flows)
    found = make_statements(
        explanation,
        frame.flows,
        beside.rivals,
        beside.structure,
        tested.bands,
        study.compare.use_normal_stresses,
        0 if chosen is None else len(chosen.terms),
        study.compare.loading is not None,
    )
    if explanation.verdict != "no_signal":
        apart = contested(outcomes, judged, frame.bands(tested.bands))
        found = open_where_dense_is_wide(open_where_contested(found, apart), outcomes, judged)
    found = open_where_modes_differ(found, of_modes.law, explanation.in_library, judged)
    if chosen is not None:
        found = with_other_constants(found, chosen.terms, tested.others, frame.model)
    return list(found)


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
