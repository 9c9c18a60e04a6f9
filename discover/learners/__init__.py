"""The learners and the kind of result they share."""

from discover.learners.registry import LearningTask, register_learner
from discover.learners.results import LearnerResult, RecoveredTerm

__all__ = ["LearnerResult", "LearningTask", "RecoveredTerm", "register_learner"]
