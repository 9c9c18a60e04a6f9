"""The two learners and the kind of result they share."""

from discover.learners.recovered_term import RecoveredTerm
from discover.learners.result import LearnerResult

__all__ = ["LearnerResult", "RecoveredTerm"]
