"""A law that explains records only up to a filter of the instrument explains nothing yet.

Terms of the library that act where the stress changes fast take up part of what a filter does, and
pass for terms of the fluid. So it is asked whether the records follow the law better as through an
instrument that answers late, or averages (`discover.statistics.reading.late_answers`).
"""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from discover.comparison.judging.as_predicted import runs_as_predicted
from discover.comparison.judging.explanation import Explanation, least_seen
from discover.comparison.judging.refutation import Refutation, hold_against
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.protocols.between_samples import sampling_interval
from discover.statistics.reading.late_answers import AGREED, Late, Response, late_answer

_DOES: Mapping[Late, str] = {
    "delay": "told each stress {time} late",
    "lag": "followed the stress with a lag of {time}",
    "mean_since": "told means over the last {time}",
    "mean_about": "told means over {time} about each sample",
}
ADVICE = (
    "look up the filter and the averaging of the instrument's software, and export what is not "
    "averaged; a lag, a delay or a rise time of the rate can be fitted along, under [model] effects"
)


def hold_against_late_answers(
    explanation: Explanation,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Iterable[Flow],
    bands: Mapping[str, PredictionBand],
) -> Explanation:
    """Return what explains the runs as well without a filter of the instrument as with one.

    Parameters
    ----------
    explanation
        What explains the runs, those held out among them.
    outcomes
        By learner, with predictions of the records.
    flows
        Of which fitted and measured runs of σ12 at a given rate, from rest, say something.
    bands
        Of the sparse law, by the key of the flow.
    """
    flows = [flow for flow in flows if tells(flow)]
    return hold_against(
        explanation,
        lambda name: _described_better(explanation, name, outcomes[name], flows, bands),
    )


def _described_better(
    explanation: Explanation,
    name: str,
    outcome: LearnerOutcome,
    flows: Sequence[Flow],
    bands: Mapping[str, PredictionBand],
) -> Refutation | None:
    """Return by which filter a law describes the records better; None if by none."""
    told = runs_as_predicted(explanation, name, outcome, flows, bands)
    runs = [Response(run.times, run.predicted, run.residual, run.columns) for run in told]
    late = late_answer(runs) if runs else None
    if late is None or late.probability > AGREED:
        return None
    if late.size <= least_seen(outcome) or explanation.expectation.excuses(late.size):
        return None
    as_if = does(late.kind, late.time)
    said = f"the records follow the law clearly better as if the instrument {as_if}"
    return Refutation(said, ADVICE)


def tells(flow: Flow) -> bool:
    """Return whether a run shows what an instrument does where the stress changes."""
    return flow.is_record and bool(np.isfinite(sampling_interval(flow.times, flow.protocol)))


def does(kind: Late, time: float) -> str:
    """Return what an instrument does that has such a filter, as a predicate."""
    return _DOES[kind].format(time=f"{time:.2g} s")
