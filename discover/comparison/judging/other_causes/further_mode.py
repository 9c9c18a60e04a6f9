"""A law that leaves correlated noise, or the misfit of a mode that it lacks.

Of what changes slowly no test tells noise that is correlated from a misfit. But the most frequent
misfit is known: a fluid has more relaxation times than were declared. So where one mode was, the
same law is fitted with one more, with all its constants; noise, however correlated, hardly gets
less by that.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares
from scipy.stats import chi2

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.outcomes.flows import Flow
from discover.errors import InputError
from discover.forward.enough_steps import in_enough_steps
from discover.forward.fluids import observed_in_batch
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.each_mode import LawOfEachMode
from discover.laws.multimode import Fluid
from discover.statistics.noise.outliers import stray
from discover.statistics.noise.same_correlation import common_likelihood
from discover.statistics.projection import rms
from discover.statistics.reading.misread import CLEAR
from discover.statistics.residual import Expectation, fast_part

_SLOW = 1.5
"""Residual over what changes from sample to sample, from which on noise would be correlated."""

_STARTS = (0.1, 0.3, 3.0)
"""Relaxation times from which the further mode is fitted, over that of the mode declared."""

_SHARE = 0.2  # of the modulus, from which it is
_NONE = -40.0  # logarithm of the share of a mode that is not there
_STEP, _MOST_EVALUATIONS = 1e-3, 20
_RUNS_AWAY = 1e3  # residual, over noise, of parameters with which the law does


@dataclass(frozen=True)
class FurtherMode:
    """One more mode, with which a law describes the records better.

    Attributes
    ----------
    time
        Its relaxation time in s.
    share
        Its modulus over that of the other.
    """

    time: float
    share: float


def clear_further_mode(
    law: MovedLaw, flows: Sequence[Flow], expectation: Expectation
) -> FurtherMode | None:
    """Return one more mode, with which the fitted runs follow a law clearly better; None if none.

    Both fits are of least squares, and the likelihoods those of noise with a size of each run and
    one first-order correlation of all   [Wilks 1938, Ann. Math. Stat. 9, 60].

    Parameters
    ----------
    law
        The law found, with the constants that were fitted along.
    flows
        The fitted runs, at given rates; of others, and of laws of several modes, nothing is asked.
    expectation
        What a complete law may leave.
    """
    asked = _Asked.of(law, flows)
    if asked is None or expectation.noise is not None:
        return None
    before = asked.rows(asked.start)
    if before is None or not _slow(before):
        return None
    found = [one for ratio in _STARTS if (one := asked.fitted(ratio)) is not None]
    if not found:
        return None
    best = min(found, key=lambda values: float(np.sum(np.square(asked.residual(values)))))
    after = asked.rows(best)
    if after is None:
        return None
    gain = common_likelihood(after) - common_likelihood(before)
    probability = min(1.0, len(_STARTS) * float(chi2.sf(2.0 * max(gain, 0.0), 2)))
    changes = [rms(a - b) for a, b in zip(after, before, strict=True)]
    size = float(np.mean(changes))
    if probability > CLEAR or expectation.excuses(size):
        return None
    return FurtherMode(float(np.exp(best[-1])), float(np.exp(best[-2])))


def _slow(rows: Sequence[Float[np.ndarray, " _"]]) -> bool:
    slow = np.mean([rms(row) for row in rows])
    return bool(slow > _SLOW * np.mean([fast_part(row) for row in rows]))


@dataclass(frozen=True)
class _Asked:
    """The fitted runs, and a law of one mode, with a further one."""

    law: MovedLaw
    flows: Sequence[Flow]
    steps: FlowBatch
    kept: Sequence[np.ndarray]
    weights: Sequence[Float[np.ndarray, " _"]]

    @classmethod
    def of(cls, law: MovedLaw, flows: Sequence[Flow]) -> "_Asked | None":
        plain = all(f.protocol.control == "rate" and f.measured is not None for f in flows)
        several = len(law.declared.modulus) > 1 or isinstance(law.declared.law, LawOfEachMode)
        if not flows or not plain or several or law.terms.inner:
            return None
        try:
            laid_out = lay_out([f.protocol for f in flows], [f.times for f in flows])
        except InputError:  # of runs held for so long that only learners' longer steps follow them
            return None
        steps = in_enough_steps(law.fluid(law.start), laid_out)
        asked = cls(law, flows, steps, [np.ones(len(f.times), dtype=bool) for f in flows], [])
        told = asked.predicted(asked.start)
        if told is None:
            return None
        kept, weights = [], []
        for flow, stress in zip(flows, told, strict=True):
            record = np.asarray(flow.measured, dtype=float)
            even = flow.even(record)
            kept.append(~stray(even * (stress - record), even * record))
            weights.append(even / (rms(even * record) or 1.0))
        return cls(law, flows, steps, kept, weights)

    @property
    def start(self) -> Float[np.ndarray, " q"]:
        """The law as it is: a further mode of no modulus to speak of."""
        time = float(np.log(self.law.declared.relaxation_time[0]))
        return np.array([*self.law.start, _NONE, time])

    def predicted(self, values: Float[np.ndarray, " q"]) -> list[np.ndarray] | None:
        """Return σ12 of each run; the last two are logarithms of a modulus' share and of a time."""
        try:
            one = self.law.fluid(values[:-2])
        except InputError:  # a constant of the declared law beyond its range
            return None
        modulus = np.append(one.modulus, np.asarray(one.modulus) * np.exp(values[-2]))
        time = np.append(one.relaxation_time, np.exp(values[-1]))
        both = Fluid(one.law, modulus, time, one.solvent_viscosity)
        observed = np.asarray(observed_in_batch(both, self.steps))[..., 0]
        stress = [row[: len(f.times)] for row, f in zip(observed, self.flows, strict=True)]
        return stress if all(np.all(np.isfinite(row)) for row in stress) else None

    def rows(self, values: Float[np.ndarray, " q"]) -> list[np.ndarray] | None:
        """Return what is left of each run, over the size of its record."""
        told = self.predicted(values)
        if told is None:
            return None
        return [
            (weight * (stress - np.asarray(flow.measured, dtype=float)))[kept]
            for stress, flow, kept, weight in zip(
                told, self.flows, self.kept, self.weights, strict=True
            )
        ]

    def residual(self, values: Float[np.ndarray, " q"]) -> Float[np.ndarray, " m"]:
        """Return the same of all runs, each of as much weight."""
        rows = self.rows(values)
        if rows is None:
            return np.full(sum(int(np.count_nonzero(kept)) for kept in self.kept), _RUNS_AWAY)
        return np.concatenate([row / np.sqrt(len(row)) for row in rows])

    def fitted(self, ratio: float) -> Float[np.ndarray, " q"] | None:
        """Return where a fit ends; None where the law runs away."""
        start = self.start
        start[-2:] = np.log(_SHARE), start[-1] + np.log(ratio)
        if self.rows(start) is None:
            return None
        scale = np.maximum(np.abs(start), 0.1)
        return least_squares(
            self.residual, start, x_scale=scale, diff_step=_STEP, max_nfev=_MOST_EVALUATIONS
        ).x
