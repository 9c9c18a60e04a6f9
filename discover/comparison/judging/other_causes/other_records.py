"""Intervals and bands that hold whatever the records owe to the instrument and to the session."""

from collections.abc import Mapping, Sequence

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.filters_for_terms import holding_filters
from discover.comparison.judging.other_causes.misread_runs import (
    holding_misreading,
    readings_of,
    with_further_modes,
)
from discover.comparison.judging.other_causes.small_faults import holding_small_faults
from discover.comparison.judging.other_causes.smaller_laws import holding_smaller_laws
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.statistics.residual import Expectation


def holding_other_records(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    chosen: LearnerOutcome,
    law: MovedLaw,
    flows: Sequence[Flow],
    expectation: Expectation,
    *,
    corrected: bool,
    computed: bool,
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand], tuple[str, ...]]:
    """Return outcomes and bands that hold behind a filter, and as read otherwise, and what is said.

    Parameters
    ----------
    outcomes, bands, chosen, law, flows, expectation
        As in `holding_filters` and `holding_misreading`.
    corrected
        Whether what a known instrument did is taken out of the records: no other one is asked for.
    computed
        Whether a law made the records: what no instrument read has no small faults of reading.
    """
    wider, held, said = dict(outcomes), dict(bands), ()
    fitted = readings_of(law, [flow for flow in flows if flow.kind == "training"])
    if not corrected:
        wider, held, of_filters = holding_filters(wider, held, chosen, law.declared, flows)
        asked = with_further_modes(fitted, law, [flow for flow in flows if flow.kind == "training"])
        seen = wider, held, chosen, law, flows, asked
        wider, held, of_readings = holding_misreading(*seen, expectation)
        said = (*of_filters, *of_readings)
        if not computed:
            wider, held, of_benches = holding_smaller_laws(wider, held, law, flows)
            said = (*said, *of_benches)
    if not computed:
        wider, held = holding_small_faults(
            wider, held, law, flows, fitted, expectation.repeat_error
        )
    return wider, held, said
