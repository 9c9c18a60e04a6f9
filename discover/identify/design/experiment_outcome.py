"""Laws weighed against an experiment that none of them was fitted to."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.stats import chi2

from discover.identify.design.experiments import OBSERVED, Experiment
from discover.identify.design.next_experiment import spread_of
from discover.identify.side_by_side.many_laws import Contender, draws, fluid_of, predict_laws
from discover.laws.multimode import Fluid
from discover.statistics.projection import squared_distance

_DRAWS = 32

REFUTED = 1e-3
"""Probability of so large a deviation, below which a law counts as refuted."""


@dataclass(frozen=True)
class LawOutcome:
    """How one law stands after the experiment.

    Attributes
    ----------
    chi_squared
        Squared deviation in units of noise and of the law's own uncertainty.
    n_observations
        Number of values it was taken over.
    probability
        Of a deviation at least as large if the law is true.
    """

    name: str
    chi_squared: float
    n_observations: int
    probability: float

    @property
    def refuted(self) -> bool:
        """Whether the experiment speaks against the law."""
        return self.probability < REFUTED

    def line(self) -> dict[str, Any]:
        """Return the law as one line of a table."""
        return {**asdict(self), "refuted": self.refuted}


def judge_laws(
    laws: Sequence[Contender],
    declared: Fluid,
    experiment: Experiment,
    measured: dict[str, Float[np.ndarray, " n"]],
    noise: dict[str, float],
) -> list[LawOutcome]:
    """Return how each law stands after the experiment: prediction against measurement.

    Nothing is fitted; the uncertainty of a law's parameters is allowed for.

    Parameters
    ----------
    laws
        The laws, with the covariance of their parameters.
    declared
        The known part that they share.
    measured
        ``sigma12``, ``N1``, ``N2``: those that were measured, in Pa.
    noise
        Standard deviation of each, in Pa.
    """
    rng = np.random.default_rng(0)
    weights = []
    for law in laws:
        group = draws(law, _DRAWS, rng)
        predicted = predict_laws(
            fluid_of(group, declared), [experiment.protocol], [experiment.times]
        )[:, 0]
        columns, data = [], []
        for name, values in measured.items():
            columns.append(predicted[..., OBSERVED.index(name)] / noise[name])
            data.append(values / noise[name])
        scaled, target = np.concatenate(columns, axis=1), np.concatenate(data)
        if not np.all(np.isfinite(scaled[0])):
            weights.append(LawOutcome(law.name, np.inf, target.size, 0.0))
            continue
        distance = squared_distance(target - scaled[0], spread_of(scaled))
        weights.append(
            LawOutcome(law.name, distance, target.size, float(chi2.sf(distance, target.size)))
        )
    return weights
