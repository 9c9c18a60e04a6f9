"""Intervals and bands that hold whatever the records owe to the instrument and to the session."""

from collections.abc import Mapping, Sequence

from discover.comparison.judging.constants_in_bands import law_with_fitted
from discover.comparison.judging.filters_for_terms import holding_filters
from discover.comparison.judging.misread_runs import holding_misreading, readings_of
from discover.comparison.judging.small_faults import holding_small_faults
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.statistics.residual import Expectation
from discover.study.declared_model import DeclaredModel


def holding_other_records(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    chosen: LearnerOutcome,
    model: DeclaredModel,
    fitted: Sequence[str],
    flows: Sequence[Flow],
    expectation: Expectation,
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand], tuple[str, ...]]:
    """Return outcomes and bands that hold behind a filter, and as read otherwise, and what is said.

    They allow for faults of reading that are too small to be seen, too.

    Parameters
    ----------
    outcomes, bands, chosen, flows, expectation
        As in `holding_filters` and `holding_misreading`.
    model, fitted
        The known part, and names of its constants that were fitted along.
    """
    wider, bands, of_filters = holding_filters(outcomes, bands, chosen, model, flows)
    law = law_with_fitted(chosen, model, fitted)
    runs = readings_of(law, [flow for flow in flows if flow.kind == "training"])
    seen = wider, bands, chosen, law, flows, runs
    wider, bands, of_readings = holding_misreading(*seen, expectation)
    wider, bands = holding_small_faults(wider, bands, law, flows, runs)
    return wider, bands, (*of_filters, *of_readings)
