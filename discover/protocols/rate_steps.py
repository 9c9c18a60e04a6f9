"""Steps of a rate that was read in samples: when each happens is known to one interval alone."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.protocols.protocol import FlowProtocol

_NEIGHBOURS = 2
"""Intervals on each side of a step in which the rate stays as it is."""

_STANDS_OUT = 10.0
"""Change of the rate in a step over that in any of these intervals."""

_SMALLEST = 0.01
"""Change of the rate, over the largest rate, that is a step."""


@dataclass(frozen=True)
class RateStep:
    """A step of the rate between two samples.

    `start`, `end`: times of the two samples in s.
    `change`: of the rate in 1/s, from the one to the other.
    `share`: of the interval at whose end the rate steps, if that is not fitted.
    `place`: which of the fitted shares is its own; None if it is not fitted.
    """

    start: float
    end: float
    change: float
    share: float = 0.5
    place: int | None = None

    def at(self, share: float) -> float:
        """Return a time in s from a share of the interval."""
        return self.start + share * (self.end - self.start)


def steps_between_samples(
    protocol: FlowProtocol, time: Float[np.ndarray, " n"], rate: Float[np.ndarray, " n"]
) -> tuple[RateStep, ...]:
    """Return the steps of a rate whose instants its samples do not tell.

    The rate changes from one sample to the next, and hardly before and after. A straight line
    between the two samples stands for a step halfway, which errs by up to half the strain of the
    interval.

    `protocol`: of the record. A rate that was given as a function of time has no such step. `time`,
    `rate`: of the samples in s and 1/s.
    """
    if protocol.control != "rate" or np.any(np.asarray(protocol.amplitudes)) or len(time) < 4:
        return ()
    knots, levels = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
    change = np.diff(rate)
    size, smallest = np.abs(change), _SMALLEST * float(np.max(np.abs(rate)))
    found = []
    for i in np.flatnonzero(size > smallest):
        around = np.r_[size[max(i - _NEIGHBOURS, 0) : i], size[i + 1 : i + 1 + _NEIGHBOURS]]
        first_or_last = i == 0 or i == len(size) - 1
        if first_or_last or _STANDS_OUT * np.max(around) > size[i]:
            continue
        at = int(np.searchsorted(knots, time[i]))
        straight = (
            at + 1 < len(knots)
            and np.array_equal(knots[at : at + 2], time[i : i + 2])
            and np.allclose(levels[at : at + 2], rate[i : i + 2], rtol=0.0, atol=0.1 * size[i])
        )
        if straight:
            found.append(RateStep(float(time[i]), float(time[i + 1]), float(change[i])))
    return tuple(found)
