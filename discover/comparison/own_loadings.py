"""What was learned, judged and shown: where runs are loadings of their own, without factors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from discover.comparison.fitting.prepared import with_runs
from discover.comparison.instrument import Frame
from discover.comparison.instrument.known import Known
from discover.comparison.judgement import Judgement, judge
from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.bands.constants_in_bands import law_with_fitted
from discover.comparison.judging.other_causes.loadings import OwnLoadings
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.records.repeats import with_loadings
from discover.study.data import StudyData
from discover.study.schema import Study
from tensor_library.library import TermLibrary


def with_own_loadings(data: StudyData, deviation: float | None) -> StudyData:
    """Return data each of whose runs is a loading of its own; as they are if nothing is said of it.

    Raises
    ------
    InputError
        If loadings cannot differ so, or a stress was imposed.
    """
    return with_runs(data, lambda runs: with_loadings(list(runs), deviation, None))


def loadings_of(known: Known, own: Mapping[str, LearnerOutcome], deviation: float) -> OwnLoadings:
    """Return the factors on the records, by the law of each learner."""
    frames = {name: known.frame(one) for name, one in own.items()}
    seen = {name: frames[name].outcome(one) for name, one in own.items()}
    law = None
    if SPARSE in own and not frames[SPARSE].made:
        law = law_with_fitted(own[SPARSE], frames[SPARSE].model, known.fitted)
    return OwnLoadings.of(seen, known.flows, deviation, law)


@dataclass(frozen=True)
class Judged:
    """What is to be believed, and what it was judged in.

    Attributes
    ----------
    judgement
        What is to be believed.
    known
        The known part in the records that were judged.
    frames
        By learner, where it worked.
    flows
        The flows of the page.
    loadings
        The factors on the records; None where all runs are one loading.
    """

    judgement: Judgement
    known: Known
    frames: Mapping[str, Frame]
    flows: list[Flow]
    loadings: OwnLoadings | None = None


def judged(
    study: Study,
    learnt: tuple[Known, Mapping[str, LearnerOutcome]],
    data: tuple[StudyData, StudyData],
    known_in: Callable[[StudyData], Known],
    library: TermLibrary,
    seed: int,
    say: Callable[[str], None],
    deviation: float | None,
) -> Judged:
    """Return what is to be believed of what was learned, from records without their factors.

    Parameters
    ----------
    study, library, seed, say
        As `judge` takes them.
    learnt
        The known part, and what each learner found.
    data
        The data, and those before instants of steps of the rate were fitted.
    known_in
        Returns the known part in other data.
    deviation
        Standard deviation by which loadings are said to differ; None where all runs are one.
    """
    known, own = learnt
    if deviation is None:
        frames = {name: known.frame(one) for name, one in own.items()}
        return Judged(
            judge(study, known, library, own, frames, seed, say, data[1]),
            known,
            frames,
            known.flows,
        )
    loadings = loadings_of(known, own, deviation)
    recorded, model = known.flows, known.before.model
    known = known_in(loadings.taken_out(data[0]))
    if known.along is None:  # constants of the declared law are those with which was learned
        known = replace(known, before=replace(known.before, model=model))
    frames = {name: loadings.frame(name, known.frame(one)) for name, one in own.items()}
    undated = loadings.taken_out(data[1])
    found = judge(study, known, library, own, frames, seed, say, undated, loadings)
    flows = _with_records_of_unseen(known.flows, recorded)
    if not found.explanation.in_library:
        loadings = loadings.without_intervals()
    return Judged(_as_recorded(found, loadings, flows), known, frames, flows, loadings)


def _with_records_of_unseen(flows: Sequence[Flow], recorded: Sequence[Flow]) -> list[Flow]:
    """Return flows in which runs held out are as they were recorded."""
    before = {flow.key: flow for flow in recorded if flow.kind == "held_out"}
    return [before.get(flow.key, flow) for flow in flows]


def _as_recorded(judgement: Judgement, loadings: OwnLoadings, flows: Sequence[Flow]) -> Judgement:
    """Return a judgement whose predictions and bands of runs held out are those of the records."""
    following, law = judgement.next_measurement, judgement.by_mode
    if law is not None:
        law = replace(law, bands=loadings.bands_of_records(law.bands, flows))
    return replace(
        judgement,
        outcomes=loadings.as_recorded(judgement.outcomes, flows),
        next_measurement=replace(
            following, bands=loadings.bands_of_records(following.bands, flows)
        ),
        by_mode=law,
    )
