"""Records of runs as one sequence of rows: what was recorded, when, in which run, of what size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from discover.dataset import Run
from discover.forward import Batch, make_batch
from discover.protocols.kinematics import MODULI

_CURVES = ("steady", "oscillation")
"""Controls of which each value is an experiment of its own, without a neighbour in time."""


TORQUE = "torque"


def transducer_of(run: Run) -> str:
    """Return what reads a record: the torque's transducer, or one for each other quantity."""
    return TORQUE if run.quantity in ("sigma12", *MODULI) else run.quantity


_RUNAWAY = 1e12
"""Of the largest record, the size from which on a prediction has run away."""


@dataclass(frozen=True)
class Rows:
    """What was recorded in runs, the samples of one after those of the other.

    `runs`, `batch`: the runs, and their layout for prediction. `seen`: where the rows stand among
    the padded records, shape (runs, n). `recorded`: in Pa, or of creep a strain, shape (rows,).
    `size`: of each value: the root mean square of its record, or the value itself in a curve.
    `time`: over the duration of the run. `run`: which run each row belongs to. `gap`: samples since
    the one before in the same run; zero where there is none. `fastest`: largest shear rate of each
    run, in 1/s, shape (runs,).
    """

    runs: tuple[Run, ...]
    batch: Batch
    seen: Bool[np.ndarray, "runs n"]
    recorded: Float[np.ndarray, " rows"]
    size: Float[np.ndarray, " rows"]
    time: Float[np.ndarray, " rows"]
    run: Int[np.ndarray, " rows"]
    gap: Int[np.ndarray, " rows"]
    fastest: Float[np.ndarray, " runs"]

    @classmethod
    def of(cls, runs: Sequence[Run]) -> "Rows":
        """Return the rows of runs."""
        batch = make_batch(runs)
        n = batch.recorded.shape[1]
        seen = np.arange(n) < np.array([[len(run)] for run in runs])
        recorded, size, time, gap = [], [], [], []
        for run in runs:
            values = np.asarray(run.recorded, dtype=float)
            sizes = np.broadcast_to(run.sizes(values), values.shape)
            recorded.append(values)
            size.append(sizes)
            alone = run.protocol.control in _CURVES
            last = max(float(run.time[-1]), np.finfo(float).tiny)
            time.append(np.arange(len(run)) / len(run) if alone else run.time / last)
            own = np.zeros(len(run), int) if alone else _gaps(run.time)
            gap.append(own)
        count = [len(run) for run in runs]
        return cls(
            tuple(runs),
            batch,
            seen,
            np.concatenate(recorded),
            np.concatenate(size),
            np.concatenate(time),
            np.repeat(np.arange(len(runs)), count),
            np.concatenate(gap),
            np.array([max(float(np.max(np.abs(run.rate))), 1e-300) for run in runs]),
        )

    def __len__(self) -> int:
        return len(self.recorded)

    @property
    def alone(self) -> Bool[np.ndarray, " rows"]:
        """Whether a row is a value of a curve, an experiment of its own."""
        return np.array([run.protocol.control in _CURVES for run in self.runs])[self.run]

    def flat(
        self, predicted: Float[np.ndarray, "trials runs n"]
    ) -> Float[np.ndarray, "trials rows"]:
        """Return predictions row by row; not a number where they are no record's at all.

        What runs away is cut off here, at any size, for its squares and products would not be
        finite either.
        """
        found = predicted[:, self.seen]
        most = _RUNAWAY * np.max(self.size, initial=0.0)
        return np.where(np.abs(found) <= most, found, np.nan)

    def sizes_of(self, predicted: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " rows"]:
        """Return the sizes with values of a curve as they are predicted, without their noise."""
        return np.where(self.alone, np.abs(predicted), self.size)

    def rms_by_run(self, values: Float[np.ndarray, " rows"]) -> Float[np.ndarray, " runs"]:
        """Return the root mean square over the rows of each run."""
        count = np.bincount(self.run, minlength=len(self.runs))
        return np.sqrt(np.bincount(self.run, values**2, minlength=len(self.runs)) / count)


def _gaps(time: Float[np.ndarray, " n"]) -> Int[np.ndarray, " n"]:
    """Return how many typical spacings lie between samples, at least one; zero for the first."""
    spacing = np.diff(time)
    if not len(spacing):
        return np.zeros(len(time), int)
    typical = np.median(spacing)
    found = np.clip(np.rint(spacing / max(typical, 1e-300)), 1, 1000).astype(int)
    return np.concatenate([[0], found])
