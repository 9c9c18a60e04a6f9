"""Steps of the rate between two samples, whose instants are fitted, or were."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from discover.dataset import Run

_NEVER = -1.0


class RateSteps(eqx.Module):
    """Steps of the rate between two samples, with a leading axis of runs.

    `start`, `end`: times of the samples in s; padding lies before any record. `share`: of the
    interval at whose end the rate steps, where not fitted. `place`: of its fitted share; −1 where
    not fitted.
    """

    start: Float[np.ndarray, "*runs steps"]
    end: Float[np.ndarray, "*runs steps"]
    change: Float[np.ndarray, "*runs steps"]  # of the rate in 1/s
    share: Float[np.ndarray, "*runs steps"]
    place: Int[np.ndarray, "*runs steps"]

    def in_rate(
        self,
        rate: Float[np.ndarray, "runs m"],
        times: Float[np.ndarray, "runs m"],
        fitted: Float[np.ndarray, "fitted vectors 1 1"],
    ) -> Float[np.ndarray, "vectors runs m"]:
        """Return the rate of runs with its steps where they happen.

        Between the two samples Simpson's rule gives the strain of each step of the integration, so
        that rates change smoothly with the instant. `rate`, `times`: at ends and middles of steps
        in turn, in 1/s and s, with a straight line where the rate steps. `fitted`: the fitted
        shares.
        """
        share = np.broadcast_to(self.share, (fitted.shape[1], *self.share.shape))
        if len(fitted):
            share = np.where(self.place < 0, share, np.moveaxis(fitted[self.place, :, 0, 0], -1, 0))
        ends = times[:, ::2]
        first, last = ends[:, :-1], ends[:, 1:]
        # of the two steps that meet at an end; beyond those of the record there is none
        reach = np.pad(ends[:, 2:] - ends[:, :-2], ((0, 0), (1, 1)), constant_values=1.0)
        total = np.broadcast_to(rate, (len(share), *rate.shape)).copy()
        for k in range(self.start.shape[1]):
            start, end, change = (of[:, k, None] for of in (self.start, self.end, self.change))
            instant = start + share[:, :, k, None] * (end - start)
            at_ends = np.clip(0.5 + (ends - instant) / reach, 0.0, 1.0)
            at_ends = np.where(ends <= start, 0.0, np.where(ends >= end, 1.0, at_ends))
            strain = np.clip((last - instant) / (last - first), 0.0, 1.0)
            stepped = np.zeros_like(total)
            stepped[..., ::2] = at_ends
            stepped[..., 1::2] = 1.5 * strain - 0.25 * (at_ends[..., :-1] + at_ends[..., 1:])
            straight = np.clip((times - start) / (end - start), 0.0, 1.0)
            between = (times > start) & (times < end)
            total += change * np.where(between, stepped - straight, 0.0)
        return total

    def padded(self, count: int) -> "RateSteps":
        """Return as many steps of each run as asked for; those beyond its own never happen."""
        beyond = ((0, 0), (0, count - self.start.shape[1]))
        columns = (self.start, self.end, self.change, self.share, self.place)
        fills = (_NEVER - 1.0, _NEVER, 0.0, 0.5, -1)
        return RateSteps(
            *(
                np.pad(np.asarray(column), beyond, constant_values=fill)
                for column, fill in zip(columns, fills, strict=True)
            )
        )


def rate_steps(runs: Sequence[Run]) -> RateSteps | None:
    """Return the steps of runs whose instants are fitted or were; None where there is none."""
    most = max(len(run.rate_steps) for run in runs)
    if not most:
        return None
    rows = np.full((len(runs), most, 4), [_NEVER - 1.0, _NEVER, 0.0, 0.5])
    place = np.full((len(runs), most), -1)
    for i, run in enumerate(runs):
        for k, step in enumerate(run.rate_steps):
            rows[i, k] = step.start, step.end, step.change, step.share
            place[i, k] = -1 if step.place is None else step.place
    start, end, change, share = np.moveaxis(rows, -1, 0)
    return RateSteps(start, end, change, share, place)
