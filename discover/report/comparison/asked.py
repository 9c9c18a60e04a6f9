"""What more than one answer of a comparison's verdict asks of it."""

from discover.comparison.comparison import Comparison
from discover.comparison.fitting.sampled_rates import coarse_rates_of
from discover.dataset.records.rates import CoarseRates
from discover.report.wording import (
    learner_as_subject,
)


def law_of(learner: str) -> str:
    """Return the law of a learner as it stands within a sentence."""
    return f"{within_a_sentence(learner)}'s law"


def within_a_sentence(learner: str) -> str:
    """Return a learner as it stands within a sentence."""
    name = learner_as_subject(learner)
    return name[:1].lower() + name[1:]


def coarse_rates(comparison: Comparison) -> CoarseRates | None:
    """Return what rates read in too few samples leave open of the first law that they do."""
    for name, outcome in comparison.outcomes.items():
        coarse = coarse_rates_of(outcome)
        # intervals of a law that explains nothing are no claim, whatever moves them
        if coarse is not None and (coarse.shows or name in comparison.explanation.by):
            return coarse
    return None


def left_open(comparison: Comparison) -> str:
    """Return the quantities that the data leave open, in words; empty if none."""
    return " and ".join(s.title for s in comparison.statements if s.undetermined and s.of_law)
