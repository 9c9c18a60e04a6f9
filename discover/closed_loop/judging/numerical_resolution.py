"""What a misfit may owe to arithmetic: finite steps, a rate read in samples, rounded stresses."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.finer_steps import change_on_finer_steps
from discover.dataset import Run
from discover.forward import AugmentedModel, Batch
from discover.inference.least_squares import Fit
from discover.statistics.noise.converter_steps import step_of_converter
from discover.statistics.projection import rms
from discover.statistics.residual import judging

COMPUTED = 1e-6
"""Relative accuracy of this software's simulations (`discover.simulate.make_grid`). Data that were
computed are taken to be no better, whatever their digits."""

_LARGEST = 5e-3
"""A larger relative misfit is not put down to steps, and what they do is not computed: elements in
series err by a thousandth on the steps of a search, and a rate read 24 times a cycle by φ²/12, with
φ the phase between samples, which is this."""

_MOST_DIGITS = 9  # a difference of the tenth digit is below `COMPUTED` by far
_HARDLY_MORE = 1.1  # half steps, of a stress that is noisy before it is read
_BEYOND = 0.1
"""Share of samples more than half a step off from which on a converter's steps are not all that is
left: a misfit of a seventh of a step, half of what the steps themselves leave."""

_FEWEST_VALUES = 5  # that all of fewer end in the same noughts may be chance


class NumericalResolution:
    """What a model's misfit of some runs may owe to arithmetic.

    Parameters
    ----------
    model, batch, runs
        The model with all candidates; the runs, laid out for it and as they are.
    """

    def __init__(self, model: AugmentedModel, batch: Batch, runs: Sequence[Run]):
        self.model, self.batch, self.runs = model, batch, runs
        sizes = [rms(run.recorded) or 1.0 for run in runs]
        self.rounding = np.array(
            [rounding(run.recorded) / size for run, size in zip(runs, sizes, strict=True)]
        )
        self._half_steps = np.array([0.5 * step_of_converter(run.recorded) for run in runs])
        self._known: dict[bytes, np.ndarray] = {}

    def beyond_steps(self, residual: Float[np.ndarray, "runs n"]) -> bool:
        """Return whether residuals are more than the steps of a converter leave.

        A record in steps is the nearest level to the stress, so a right model misses it by half a
        step at the most: a misfit m, small beside a step s, shows as the share m/s of the samples
        beyond, though it hardly adds to what is left, root-mean-square.

        Parameters
        ----------
        residual
            Weighted, as of a fit.
        """
        weight = np.asarray(self.batch.weight)
        off = [
            np.abs(row[w > 0] / w[w > 0]) / half
            for row, w, half in zip(residual, weight, self._half_steps, strict=True)
            if half > 0.0
        ]
        return bool(off) and float(np.mean(np.concatenate(off) > _HARDLY_MORE)) > _BEYOND

    def limit(self, theta: np.ndarray, active: Sequence[str], error: float) -> float:
        """Return the relative error that arithmetic explains, mean over the runs that judge.

        Parameters
        ----------
        theta, active
            Parameters, and the effects among them that are in the model.
        error
            Relative error in question; one that is large by far is not put down to steps.
        """
        steps = np.zeros(len(self.runs))
        if error <= _LARGEST:
            steps = np.sqrt(np.sum(self._change(theta, active) ** 2, axis=1))
        return self.mean(np.sqrt(steps**2 + self.rounding**2 + COMPUTED**2))

    def mean(self, errors: Float[np.ndarray, " runs"]) -> float:
        """Return the mean of errors over the runs that judge."""
        return float(np.mean(errors[judging(np.asarray(self.batch.weight))]))

    def corrected(self, fit: Fit, active: Sequence[str]) -> Float[np.ndarray, "runs n"] | None:
        """Return what a fit on finer steps would leave, to first order; None where it is large."""
        if self.mean(fit.run_errors) > _LARGEST:
            return None
        change = self._change(fit.theta, active).ravel()
        if fit.free:
            # the fitted parameters take up what they can
            design = fit.jacobian.reshape(len(fit.free), -1).T
            change = change - design @ np.linalg.lstsq(design, change, rcond=None)[0]
        return fit.residual + change.reshape(fit.residual.shape)

    def _change(self, theta, active) -> Float[np.ndarray, "runs n"]:
        # a position that belongs to no active effect changes nothing
        key = np.asarray(theta).tobytes()
        if key not in self._known:
            self._known[key] = change_on_finer_steps(
                self.model, self.batch, self.runs, theta, active, other_rates=True
            )
        return self._known[key]


def rounding(values: Float[np.ndarray, " n"]) -> float:
    """Return half a unit in the last place of numbers, root-mean-square; 0 if they hold them all.

    A file gives its numbers with so many digits, or with so many decimals, and a converter in steps
    of its own; all are looked for, and the coarsest of those that the numbers fit is taken.

    Parameters
    ----------
    values
        In any unit. Of fewer than five that differ nothing is said.
    """
    step = step_of_converter(values)
    values = np.abs(values[values != 0.0])
    if len(np.unique(values)) < _FEWEST_VALUES:
        return 0.0
    own, largest = np.floor(np.log10(values)), np.floor(np.log10(np.max(values)))
    found = [0.5 * step]
    for exponents in (own, np.full_like(own, largest)):
        for digits in range(1, _MOST_DIGITS + 1):
            unit = 10.0 ** (exponents - digits + 1)
            if np.all(np.abs(values - unit * np.round(values / unit)) <= 1e-5 * unit):
                found.append(rms(0.5 * unit))
                break
    return max(found)
