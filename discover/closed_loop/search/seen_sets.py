"""Every set of effects that a search has fitted, kept for what it says beside the one chosen."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.forward import AugmentedModel
from discover.inference.least_squares import Fit
from discover.statistics.residual import judged_cost


@dataclass(frozen=True)
class SeenSet:
    """A set of effects, as it was fitted.

    Attributes
    ----------
    effects
        In alphabetical order.
    free, values
        Positions of what was fitted, and the values.
    cost
        Sum over the runs that judge of the squared relative errors.
    """

    effects: tuple[str, ...]
    free: tuple[int, ...]
    values: tuple[float, ...]
    cost: float

    def theta(self, model: AugmentedModel) -> Float[np.ndarray, " p"]:
        """Return the parameter vector of the fit."""
        theta = model.zero()
        theta[list(self.free)] = self.values
        return theta


class SeenSets:
    """The sets that were fitted, each with its best fit.

    Parameters
    ----------
    sets, explored
        To begin with.

    Attributes
    ----------
    explored
        Sets to each of which every candidate was added in turn.
    """

    def __init__(self, sets: Iterable[SeenSet] = (), explored: Iterable[Sequence[str]] = ()):
        self._sets = {one.effects: one for one in sets}
        self.explored = {tuple(sorted(effects)) for effects in explored}

    def __iter__(self) -> Iterator[SeenSet]:
        return iter(self._sets.values())

    def note(
        self,
        effects: Sequence[str],
        fit: Fit,
        weight: Float[np.ndarray, "runs n"],
    ) -> None:
        """Keep a set of effects, unless it was fitted better before."""
        name = tuple(sorted(effects))
        cost = judged_cost(fit.residual, weight)
        if not np.isfinite(cost) or (name in self._sets and self._sets[name].cost <= cost):
            return
        values = tuple(float(fit.theta[at]) for at in fit.free)
        free = tuple(int(at) for at in fit.free)
        self._sets[name] = SeenSet(name, free, values, cost)

    def take_over(self, other: "SeenSets", places: Mapping[int, int]) -> None:
        """Keep the sets that were fitted in another model, which has parameters at other places.

        Parameters
        ----------
        other
            The sets.
        places
            Where each parameter of that model stands in this one.
        """
        for one in other:
            moved = tuple(places[at] for at in one.free)
            self._sets[one.effects] = SeenSet(one.effects, moved, one.values, one.cost)
        self.explored |= other.explored

    def to_json(self) -> dict[str, Any]:
        """Return the sets as JSON."""
        return {"sets": [vars(one) for one in self], "explored": sorted(self.explored)}

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> "SeenSets":
        """Return the sets that `to_json` wrote."""
        sets = (
            SeenSet(tuple(one["effects"]), tuple(one["free"]), tuple(one["values"]), one["cost"])
            for one in content.get("sets", ())
        )
        return cls(sets, content.get("explored", ()))
