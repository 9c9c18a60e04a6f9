"""A comparison of runs that are loadings of their own: before it is judged, and as it is shown."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from discover.comparison.instrument.known import Known
from discover.comparison.judgement import Judgement
from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.constants_in_bands import law_with_fitted
from discover.comparison.judging.loadings import OwnLoadings
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.own_loadings import with_loadings
from discover.study.data import StudyData


def with_own_loadings(data: StudyData, deviation: float | None) -> StudyData:
    """Return data each of whose runs is a loading of its own; as they are if nothing is said of it.

    Raises
    ------
    InputError
        If loadings cannot differ so, or a stress was imposed.
    """
    parts = {
        name: replace(part, runs=tuple(with_loadings(part.runs, deviation, None)))
        for name in ("dataset", "fit", "held_out")
        for part in [getattr(data, name)]
    }
    return replace(data, **parts)


def loadings_of(known: Known, own: Mapping[str, LearnerOutcome], deviation: float) -> OwnLoadings:
    """Return the factors on the records, by the law of each learner."""
    frames = {name: known.frame(one) for name, one in own.items()}
    seen = {name: frames[name].outcome(one) for name, one in own.items()}
    law = None
    if SPARSE in own and not frames[SPARSE].made:
        law = law_with_fitted(own[SPARSE], frames[SPARSE].model, known.fitted)
    return OwnLoadings.of(seen, known.flows, deviation, law)


def with_records_of_unseen(flows: Sequence[Flow], recorded: Sequence[Flow]) -> list[Flow]:
    """Return flows in which runs held out are as they were recorded."""
    before = {flow.key: flow for flow in recorded if flow.kind == "held_out"}
    return [before.get(flow.key, flow) for flow in flows]


def as_recorded(judgement: Judgement, loadings: OwnLoadings, flows: Sequence[Flow]) -> Judgement:
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
