"""What a residual with a pattern may be of the instrument's, where no effect with a name is it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.statistics.noise.converter_steps import step_of_converter
from discover.statistics.noise.held_values import read_times
from discover.statistics.noise.running_mean import averaged_over
from discover.statistics.noise.wandering import wandering
from discover.statistics.projection import rms
from discover.words import percent_of

_WITHIN = 0.8
"""Share of what is left within half a step from which on the steps may be what is left."""

_HARDLY_MORE = 1.05  # half steps


@dataclass(frozen=True)
class Likeness:
    """What a residual looks like, and what to measure then, as clauses; empty if like nothing."""

    looks: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        """Return both in one."""
        return f"{self.looks}: {self.remedy}" if self.remedy else self.looks


def likeness(
    residuals: Sequence[Float[np.ndarray, " _"]], measured: Sequence[Float[np.ndarray, " _"]]
) -> Likeness:
    """Return what a residual looks like.

    That is no finding: a law that errs by less than a step, or at random, looks the same.

    `residuals`, `measured`: prediction minus measurement of each run, and the measurement, in one
    unit.
    """
    steps = [step_of_converter(np.asarray(record)) for record in measured]
    if steps and all(steps):
        return _of_steps(residuals, measured, steps)
    often = [read_times(np.asarray(record)) for record in measured]
    if often and min(often) > 1:
        return Likeness(
            f"each value of the records stands in {max(often)} samples, which looks like a lag",
            "record a sample for each value of the transducer, or keep the first of those alike",
        )
    sizes = [rms(record) or 1.0 for record in measured]
    rows = [np.asarray(row) / size for row, size in zip(residuals, sizes, strict=True)]
    if width := averaged_over(rows):
        return Likeness(
            f"what is left looks like noise of which each sample is the mean of {width}, and no "
            "test tells such noise from a small error of the law",
            f"record the stress without smoothing it over {width} samples, or give the size of its "
            "noise, as by noise = 0.01",
        )
    far = wandering(rows)
    if far is None:
        return Likeness()
    return Likeness(
        "what is left wanders as a zero does that drifts at random, by some "
        f"{percent_of(far)} of the stress over a run, and not as smoothly as what a law lacks",
        "read the zero before and after each run, or repeat one, in which a missing effect comes "
        "back and a wandering zero does not",
    )


def _of_steps(residuals, measured, steps: Sequence[float]) -> Likeness:
    """Return what the steps of a converter have to do with it."""
    every = zip(residuals, steps, strict=True)
    off = np.concatenate([2.0 * np.abs(np.asarray(row)) / step for row, step in every])
    within = float(np.mean(off <= _HARDLY_MORE))
    if within < _WITHIN:
        return Likeness()
    largest = [float(np.max(np.abs(record))) or 1.0 for record in measured]
    size = float(np.mean([step / most for step, most in zip(steps, largest, strict=True)]))
    return Likeness(
        f"the records come in steps of {percent_of(size)} of their largest value, and "
        f"{percent_of(within)} of what is left stands within half of one, so it may be nothing but "
        "the steps, which hide as much of a law as well",
        "record with a finer range of the transducer",
    )
