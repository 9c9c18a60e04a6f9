"""A function of one variable beside a law: what it is, and how far to rely on the law beside it."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fit import Fit
from discover.inference.problem import LOG_ODDS_OF_NONE
from discover.inference.with_function import WithFunction, WithSlip

_TOLD = 15.0
"""Log odds against all that has a name and any other discrepancy, from which on a curve is shown.
On development seeds one that is there has 35 and more; one that stands for a law of no dictionary,
up to 10."""

_TITLES = {
    "recorded_stress": "nonlinear_transducer",
    "drift": "zero_that_drifts",
    "response": "slow_transducer",
    "slip": "nonlinear_wall_slip",
}
"""Functions of the measurement, by slot."""


@dataclass(frozen=True)
class FreeForm:
    """A smooth function of one variable that explains what named effects leave.

    `slot`: where it acts, such as ``relaxation`` or ``slip``. `variable`, `unit`: of what it is a
    function, and its unit. `beside`: effects in the model with it. `grid`, `value`, `low95`,
    `high95`: the curve with its 95 % band, shape (n,), in Pa or as a relative change. `nearest`: a
    closed form that is it within its uncertainty; None if none of those tried is. `constants`: of
    what is beside it, each with the ends of its 95 % interval, by effect and name. `in_answer`:
    whether what is beside it is the answer's law.
    """

    slot: str
    variable: str
    unit: str
    beside: tuple[str, ...]
    grid: Float[np.ndarray, " n"]
    value: Float[np.ndarray, " n"]
    low95: Float[np.ndarray, " n"]
    high95: Float[np.ndarray, " n"]
    nearest: str | None
    constants: Mapping[str, Mapping[str, tuple[float, float, float]]]
    in_answer: bool = False

    @property
    def title(self) -> str:
        """What of the measurement has such a function, as an effect is spelled."""
        return _TITLES[self.slot]


@dataclass(frozen=True)
class FreeFunction:
    """A curve as a hypothesis.

    `fits`: hypotheses beside which it is possible, fitted with it, with weights that add up to one,
    the likeliest first. `fitter`: what fitted them. `log_odds`: against all that has a name, and
    any discrepancy of another kind, by the fitted runs. `log_odds_in_all`: the same by all runs, as
    explanations are weighed. `left`: what the likeliest leaves; None where it is not asked.
    """

    form: FreeForm
    fits: tuple[tuple[Fit, float], ...]
    fitter: "WithFunction | WithSlip"
    log_odds: float
    log_odds_in_all: float
    left: DiscrepancyModel | None

    @property
    def is_shown(self) -> bool:
        """Whether it stands out so far that the runs have a curve of this shape."""
        return self.log_odds > _TOLD

    @property
    def reliance(self) -> float:
        """Log odds by which laws beside it predict what was not fitted, and no others."""
        if self.left is None:
            return -np.inf
        return min(self.log_odds - _TOLD, -self.left.log_factor - LOG_ODDS_OF_NONE)

    @property
    def is_of_record(self) -> bool:
        """Whether it is of the measurement rather than the fluid, as far as its variable tells."""
        return self.form.slot in _TITLES

    @property
    def weight(self) -> float:
        """Log odds by which it counts: held-out runs may show it, and need not have it too."""
        return max(self.log_odds, self.log_odds_in_all)
