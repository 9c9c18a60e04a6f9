"""The two learners and the kind of result they share."""

from discover.learners.result import LearnerResult, RecoveredTerm

__all__ = ["LearnerResult", "RecoveredTerm"]
