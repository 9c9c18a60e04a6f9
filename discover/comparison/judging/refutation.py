"""What refutes a law of which the records say that they owe something to more than the fluid."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.explanation import Explanation
from discover.statistics import LackOfFit


@dataclass(frozen=True)
class Refutation:
    """Why a law explains nothing, and what to do about it, each as a clause."""

    reason: str
    advice: str

    def of(self, left: LackOfFit) -> LackOfFit:
        """Return what a law leaves that this refutes."""
        return left.refuted(self.reason, self.advice)


def hold_against(
    explanation: Explanation, refutation_of: Callable[[str], Refutation | None]
) -> Explanation:
    """Return what explains the runs and is not refuted.

    Where the sparse law is refuted, everything is: what it needs something beside the fluid for is
    in the records, which another law has taken for the fluid's.

    Parameters
    ----------
    explanation
        What explains the runs, those held out among them.
    refutation_of
        What refutes the law of a learner; None where nothing does.
    """
    found = dict(explanation.lack_of_fit)
    of_sparse: Refutation | None = None
    for name in sorted(explanation.by, key=lambda one: one != SPARSE):
        left = found[name]
        if explanation.expectation.noise is not None and left.misfit <= left.expected:
            continue  # of a noise that is given only who gives it knows what is in it
        refutation = of_sparse or refutation_of(name)
        if refutation is not None:
            found[name] = refutation.of(left)
        if name == SPARSE:
            of_sparse = refutation
    return replace(explanation, lack_of_fit=found)
