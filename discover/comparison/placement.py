"""Whether a flow lies inside the range of those that were fitted, or beyond it and by how much."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from discover.comparison.flows import Flow

MARGIN = 1.05
"""What exceeds the fitted flows by less than this factor is inside: samples of one cycle hit its
peak to some per cent only."""


_NUMBERS = {"shear rate": "shear rate (Wi)", "frequency": "frequency (De)"}
"""What exceeds, with the number that grows as it does."""


@dataclass(frozen=True)
class Placement:
    """Where a flow lies against the fitted ones.

    `rate`, `strain`: largest shear rate and strain over the largest fitted ones.
    `frequency`: angular frequency over the largest fitted one; None where one of the two does not
        oscillate, for a step of the rate excites every frequency.
    """

    rate: float
    strain: float
    frequency: float | None
    new_flow: str = ""  # which flow it is, where no fitted one is of that kind; empty otherwise
    rate_name: str = "shear rate"  # what the rate is called in this flow

    @property
    def inside(self) -> bool:
        """Whether nothing exceeds the fitted flows, and flows of the kind were fitted."""
        return not (self.beyond or self.new_flow)

    @property
    def beyond(self) -> dict[str, float]:
        """What exceeds the fitted flows, by which factor."""
        factors = {
            self.rate_name: self.rate,
            "strain": self.strain,
            "frequency": self.frequency or 0.0,
        }
        return {name: factor for name, factor in factors.items() if factor > MARGIN}

    @property
    def text(self) -> str:
        """The placement in a few words."""
        if self.inside:
            return "inside the fitted range"
        parts = [
            f"{_NUMBERS.get(name, name)} {factor:.2g} times the largest"
            for name, factor in self.beyond.items()
        ]
        if self.new_flow:
            what = "shear" if self.new_flow == "shear" else f"{self.new_flow} extension"
            parts.insert(0, f"{what}, of which nothing was fitted")
        return f"beyond the fitted range: {', '.join(parts)}"

    def to_json(self) -> dict[str, Any]:
        """Return the placement as ``comparison.json`` holds it."""
        said = {"inside": self.inside, "beyond": self.beyond}
        return said | ({"new_flow": self.new_flow} if self.new_flow else {})


def place(flow: Flow, training: Sequence[Flow]) -> Placement:
    """Return where a flow lies against the fitted ones.

    A slower or smaller flow is inside: there a fluid comes to its linear limit, which the declared
    modes hold. Ratios of rates and of frequencies are those of Wi and De.
    """
    frequencies = [f for other in training if (f := other.frequency) is not None]
    kind = flow.protocol.flow
    alike = [other for other in training if other.protocol.flow == kind]
    oscillates = flow.frequency is not None and len(frequencies) == len(training)
    return Placement(
        _ratio(flow.largest_rate, [f.largest_rate for f in alike or training]),
        _ratio(_largest(flow.strain), [_largest(f.strain) for f in alike or training]),
        _ratio(flow.frequency or 0.0, frequencies) if oscillates else None,
        "" if alike else kind,
        "shear rate" if kind == "shear" else "Hencky rate",
    )


def _largest(values: np.ndarray) -> float:
    # a flow curve says nothing of strain, its states have gone through any
    return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))


def _ratio(value: float, others: Sequence[float]) -> float:
    largest = max(others, default=0.0)
    return value / largest if largest > 0.0 else float("inf") if value > 0.0 else 0.0
