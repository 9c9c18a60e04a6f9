"""Of what a free function of the record is one, and what it does to the record."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float
from sklearn.preprocessing import SplineTransformer

from discover.closed_loop.judging.before_after import strain_of
from discover.closed_loop.results.free_curve import Slot
from discover.dataset import Run
from discover.dataset.run_table import oscillation

Way = Literal["added", "factor", "in_cycles"]


@dataclass(frozen=True)
class Place:
    """Where a free function acts.

    Attributes
    ----------
    variable, unit
        Of what it is a function, and its unit.
    way
        Added to the stress, a factor on it, or added in each cycle alike, to what oscillates.
    """

    variable: str
    unit: str
    way: Way = "added"


PLACES: dict[Slot, Place] = {
    "recorded_stress": Place("stress", "Pa"),
    "drift": Place("instrument_time", "s"),
    "rate": Place("rate", "1/s"),
    "network": Place("strain", "", "factor"),
    "position": Place("position of the tool", ""),
    "gap": Place("position of the tool", "", "factor"),
    "phase": Place("phase of the cycle", "rad", "in_cycles"),
}


class Variables:
    """Of what functions of the record of some runs may be one.

    Parameters
    ----------
    runs
        In shear at a given rate.
    most_samples
        n, of the longest.

    Attributes
    ----------
    slots
        Places that these runs can tell of.
    """

    def __init__(self, runs: Sequence[Run], most_samples: int):
        self._values: dict[Slot, Float[np.ndarray, "runs n"]] = {}
        for slot in PLACES:
            self._values[slot] = np.zeros((len(runs), most_samples))
            if slot != "recorded_stress":
                for row, run in zip(self._values[slot], runs, strict=True):
                    row[: len(run)] = _of_run(slot, run)
        self.slots: list[Slot] = [slot for slot in PLACES if self._can_tell_of(slot)]

    def _can_tell_of(self, slot: Slot) -> bool:
        if slot == "gap":  # where no tool turns back it is the factor of `network`
            return bool(np.min(self._values[slot]) < 0.0)
        return slot != "phase" or bool(np.any(np.isfinite(self._values[slot])))

    def at(self, slot: Slot, predicted: Float[np.ndarray, "runs n"]) -> Float[np.ndarray, "runs n"]:
        """Return the variable at every sample, nan where the function does not act.

        Parameters
        ----------
        slot
            Where the function acts.
        predicted
            The stress without it, in Pa.
        """
        return predicted if slot == "recorded_stress" else self._values[slot]


def _of_run(slot: Slot, run: Run) -> Float[np.ndarray, " n"]:
    if slot == "drift":
        return run.time / run.clock_factor
    if slot == "rate":
        return run.rate
    if slot == "network":  # what is lost is not found again where the tool turns back
        return np.abs(strain_of(run))
    return _phase(run) if slot == "phase" else strain_of(run)


def _phase(run: Run) -> Float[np.ndarray, " n"]:
    """Return the phase of a rate that oscillates, from 0 where it is largest to 2π; else nan."""
    wave = oscillation(run)
    if wave is None:
        return np.full(len(run), np.nan)
    angle = wave[0] * run.time
    # least squares, for over the samples of a run cosine and sine need not be orthogonal
    waves = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    along, across = np.linalg.lstsq(waves, run.rate, rcond=None)[0]
    return np.mod(angle - np.arctan2(across, along), 2.0 * np.pi)


def spline(slot: Slot, knots: int, values: Float[np.ndarray, " n"]) -> SplineTransformer:
    """Return cubic splines over the values that a variable takes; periodic over a cycle."""
    if PLACES[slot].way == "in_cycles":
        at = np.linspace(0.0, 2.0 * np.pi, knots).reshape(-1, 1)
        made = SplineTransformer(knots=at, extrapolation="periodic")  # pyright: ignore
    else:
        made = SplineTransformer(knots, extrapolation="linear")
    return made.fit(values[np.isfinite(values)].reshape(-1, 1))


def columns(
    slot: Slot,
    splines: SplineTransformer,
    values: Float[np.ndarray, "runs n"],
    predicted: Float[np.ndarray, "runs n"],
) -> Float[np.ndarray, "runs n m"]:
    """Return what the coefficients of the spline change in the record, in Pa."""
    acts = np.isfinite(values)
    basis = splines.transform(np.where(acts, values, 0.0).reshape(-1, 1))
    basis = np.where(acts[..., None], basis.reshape(*values.shape, -1), 0.0)
    return basis * predicted[..., None] if PLACES[slot].way == "factor" else basis
