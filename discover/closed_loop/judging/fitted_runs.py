"""What the fitted runs say of a final model."""

from collections.abc import Sequence
from dataclasses import dataclass

from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.inference.least_squares import Fit
from discover.statistics.lack_of_fit import LackOfFit
from discover.statistics.residual import STRUCTURE


@dataclass(frozen=True)
class FittedRuns:
    """What a final model leaves of the runs that it was fitted to.

    Attributes
    ----------
    left
        What is left of them.
    like_noise
        Whether noise and the error of the linear data alone may be what is left, or there is
        nothing that could tell.
    explained
        Whether these, and arithmetic, are what is left.
    resolution
        Relative error that arithmetic explains.
    noise_known
        Whether the runs are long enough to tell noise from structure, or the noise was given.
    noise_known_or_small
        The same, or so little is left that arithmetic explains it.
    """

    left: LackOfFit
    like_noise: bool
    explained: bool
    resolution: float
    noise_known: bool
    noise_known_or_small: bool

    @property
    def nothing(self) -> bool:
        """Whether the records hold hardly anything but noise."""
        return self.like_noise and self.left.verdict == "no_signal"


def what_fitted_runs_say(tolerated: ToleratedMisfit, fit: Fit, active: Sequence[str]) -> FittedRuns:
    """Return what a final fit, with the effects in it, leaves of the fitted runs."""
    left, noise_known = tolerated.left(fit.residual), tolerated.noise_known
    like_noise = not noise_known or left.verdict != "unexplained"
    explained = like_noise or tolerated.explained(fit, active)
    # steps are computed on only where noise alone does not explain what is left
    asked = float("inf") if like_noise else left.misfit
    resolution = tolerated.resolution.limit(fit.theta, active, asked)
    known_or_small = noise_known or left.misfit <= STRUCTURE * resolution
    return FittedRuns(left, like_noise, explained, resolution, noise_known, known_or_small)
