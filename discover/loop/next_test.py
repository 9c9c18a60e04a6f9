"""What a closed loop says of the next test: which one would tell its explanations apart."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.identify.design.next_experiment import DECISIVE
from discover.protocols.kinematics import RecordedQuantity


@dataclass(frozen=True)
class NextTest:
    """One test, and what it is expected to decide.

    Attributes
    ----------
    title
        In words, with numbers.
    quantity
        What is recorded.
    nats
        Information that it is expected to give on which explanation is right.
    evidence
        Expected logarithm of the odds between each pair of explanations, shape (e, e).
    samples, curves
        Where each explanation predicts what, shapes (n,) and (e, n): times in s, of a flow curve
        the rates in 1/s.
    """

    title: str
    quantity: RecordedQuantity
    nats: float
    evidence: Float[np.ndarray, "e e"]
    samples: Float[np.ndarray, " n"]
    curves: Float[np.ndarray, "e n"]
    is_flow_curve: bool = False

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of explanations between which it is expected to decide."""
        decided = np.argwhere(np.triu(self.evidence, 1) >= DECISIVE)
        return tuple((int(i), int(j)) for i, j in decided)


@dataclass(frozen=True)
class NextTests:
    """The tests that were weighed, the most telling first.

    Attributes
    ----------
    explanations
        Sets of effects that are to be told apart, the likeliest first; twins each by itself.
    probabilities
        Of each, were it one of them.
    noise
        Relative, with what the explanations leave of the fitted runs.
    tests
        Among those that could be run.
    """

    explanations: tuple[tuple[str, ...], ...] = ()
    probabilities: tuple[float, ...] = ()
    noise: float = 0.0
    tests: tuple[NextTest, ...] = field(default_factory=tuple)

    @property
    def open_nats(self) -> float:
        """What is not known of which explanation is right: the most that a test can tell."""
        return entropy(self.probabilities)

    @property
    def best(self) -> NextTest | None:
        """The test that tells most, if any decides between two of them."""
        decided = (one for one in self.tests if one.pairs)
        return next(decided, None)

    def to_json(self) -> dict[str, Any]:
        """Return what ``loop.json`` holds of them."""
        return {
            "explanations": self.explanations,
            "probabilities": self.probabilities,
            "open_nats": self.open_nats,
            "noise": self.noise,
            "tests": [
                {
                    "test": one.title,
                    "observe": one.quantity,
                    "nats": one.nats,
                    "separates": [
                        [self.explanations[i], self.explanations[j]] for i, j in one.pairs
                    ],
                }
                for one in self.tests
            ],
        }


def entropy(probabilities: Sequence[float]) -> float:
    """Return −Σ p ln p, in nats."""
    p = np.array([one for one in probabilities if one > 0.0])
    return float(-np.sum(p * np.log(p)))
