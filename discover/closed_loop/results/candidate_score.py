"""How a candidate effect did at one stage of a search."""

from dataclasses import dataclass, field

import numpy as np


@dataclass
class CandidateScore:
    """How a candidate effect did at one stage.

    Attributes
    ----------
    effect, kind
        Its name and kind.
    score
        Share of the squared residual that its signature explains to first order, 0 to 1.
    step
        Amplitude to first order.
    reduction
        Share of the squared residual removed by the best trial amplitude, others held.
    aliases
        Candidates whose refit the data cannot tell from this one's.
    error, left_out_error
        Mean relative error on the fitted runs, and on each run left out in turn, after a refit;
        None if it was not refitted.
    evidence
        Lowering of the information criterion by the refit; positive is evidence for the effect.
    start
        Parameter vector to refit from.
    """

    effect: str
    kind: str
    score: float
    step: float
    reduction: float = 0.0
    aliases: tuple[str, ...] = ()
    error: float | None = None
    left_out_error: float | None = None
    evidence: float | None = None
    start: np.ndarray = field(default_factory=lambda: np.zeros(0), repr=False)
