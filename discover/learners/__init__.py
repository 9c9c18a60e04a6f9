"""The learners and the kind of result they share."""

from discover.learners.registry import LearningTask, register_learner
from discover.learners.results.recovered_term import RecoveredTerm
from discover.learners.results.result import LearnerResult

__all__ = ["LearnerResult", "LearningTask", "RecoveredTerm", "register_learner"]
