"""What a closed loop says of several explanations."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from discover.closed_loop.results.error_pair import ErrorPair


@dataclass(frozen=True)
class Explanation:
    """A set of effects that may be what the declared model lacks; none of them, if it is empty.

    Attributes
    ----------
    effects
        Their names.
    probability
        That this is the explanation, of those that were carried and of none of them.
    error
        Mean relative errors of the runs fitted and held out.
    parameters
        Values of the parameters of each effect.
    twins
        Other sets that predict these records alike. The probability is theirs together.
    bench
        Small faults that all runs share, beside which it is one: by how much more than told rates,
        relaxation times and stresses are, and the strain of the tool over that of the fluid. Empty
        where the bench is taken for right.
    """

    effects: tuple[str, ...]
    probability: float
    error: ErrorPair
    parameters: Mapping[str, Mapping[str, float]]
    twins: tuple[tuple[str, ...], ...] = ()
    bench: Mapping[str, float] = field(default_factory=dict)

    @property
    def members(self) -> tuple[tuple[str, ...], ...]:
        """The set itself and its twins."""
        return (self.effects, *self.twins)


@dataclass(frozen=True)
class Explanations:
    """Everything that explains the fitted records about as well as what was found.

    Attributes
    ----------
    likeliest_first
        Their probabilities add up to 1 with `unexplained_probability`.
    unexplained_probability
        That it is none of them.
    inclusion, inclusion_by_kind
        Probability that an effect, or some effect of a kind, is in the explanation. Twins share
        that of their class in equal parts.
    """

    likeliest_first: tuple[Explanation, ...] = ()
    unexplained_probability: float = 1.0
    inclusion: Mapping[str, float] = field(default_factory=dict)
    inclusion_by_kind: Mapping[str, float] = field(default_factory=dict)

    def holding(self, effects: Collection[str]) -> Explanation | None:
        """Return the explanation of which these effects, in any order, are a member."""
        asked = set(effects)
        found = (e for e in self.likeliest_first if any(set(m) == asked for m in e.members))
        return next(found, None)

    def doubted(self, unexplained: float) -> "Explanations":
        """Return them with *none of these* no less probable than a number from 0 to 1."""
        if unexplained <= self.unexplained_probability:
            return self
        share = (1.0 - unexplained) / (1.0 - self.unexplained_probability)
        return Explanations(
            tuple(
                replace(one, probability=share * one.probability) for one in self.likeliest_first
            ),
            unexplained,
            {name: share * value for name, value in self.inclusion.items()},
            {kind: share * value for kind, value in self.inclusion_by_kind.items()},
        )

    def to_json(self) -> dict[str, Any]:
        """Return what ``loop.json`` holds of them."""
        return {
            "explanations": self.likeliest_first,
            "unexplained_probability": self.unexplained_probability,
            "inclusion": self.inclusion,
            "inclusion_by_kind": self.inclusion_by_kind,
        }
