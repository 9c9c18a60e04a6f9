"""What was recorded in runs and what every value weighs: the misfit that all fits minimise.

A residual is prediction minus record, times its weight: the run's own (`Run.weight`, or one of
`Run.normal_weights`) over the size of the value (`Run.sizes`) and over the root of the number of
values that the mean is over, so that squares add up to a mean squared relative misfit; see `Mean`.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Literal, TypeVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.dataset.run import Loading, Run
from discover.programs import on_device
from discover.statistics.noise.noise_model import rms
from discover.statistics.noise.whiteness import FEWEST_FAST
from discover.statistics.residual import fast_part

_LEAST = 1e-3
"""Relative noise below which none is taken to be: a law is not told to more digits."""

_MOST = 1.0 / 3.0
"""Of the deviation of loadings, up to which their noise is told from the records: what changes from
sample to sample of few samples may be the flow, and a noise that is told too small leaves factors
freer, and intervals wider."""


Values = TypeVar("Values", Array, np.ndarray)
"""Arrays of JAX, where programs hold the records, or else of NumPy."""


class Loadings(eqx.Module):
    """Which rows of records share a loading, and how much their factors may differ.

    `members`: whether a row is a record of a loading. `noise`: standard deviation of the weighted
    residuals of each row that is noise.
    """

    members: Bool[Array | np.ndarray, "loadings rows"]
    deviation: Float[Array | np.ndarray, ""]  # standard deviation of the factors
    noise: Float[Array | np.ndarray, " rows"]

    @property
    def rows(self) -> tuple[tuple[int, ...], ...]:
        """The rows of each loading's records."""
        return tuple(tuple(np.flatnonzero(own).tolist()) for own in np.asarray(self.members))

    def whitened(
        self, residual: Float[Values, "*trials rows n"], predicted: Float[Values, "*trials rows n"]
    ) -> Float[Values, "*trials rows n"]:
        """Return weighted residuals with factors of their own, which the prior holds back.

        `residual`, `predicted`: predictions minus records, and predictions, both weighted.
        """
        along, size = self._along(residual, predicted)
        with np.errstate(all="ignore"):  # a trial that ran away
            signal = self.deviation**2
            # what the likely factor takes, and no more where nothing is predicted
            share = (1.0 - (1.0 + signal * size) ** -0.5) * along / (size + (size == 0.0))
            # a loading whose runs ran away leaves the others as they are
            return residual - self.at_rows(share)[..., None] * predicted

    def at_rows(self, values: Float[Values, "*trials loadings"]) -> Float[Values, "*trials rows"]:
        """Return values of loadings at the rows of their records; zero at rows of none."""
        return _where(self.members, values[..., :, None]).sum(-2)

    def factors(
        self,
        residual: Float[np.ndarray, "trials rows n"],
        predicted: Float[np.ndarray, "trials rows n"],
    ) -> tuple[Float[np.ndarray, "trials loadings"], Float[np.ndarray, "trials loadings"]]:
        """Return the factors less one that fit best without the prior, and their precisions."""
        along, size = self._along(residual, predicted)
        return -along / np.where(size > 0.0, size, 1.0), size

    def _along(self, residual, predicted):
        """Return p·e and p·p of each loading, in units of the noise."""
        with np.errstate(all="ignore"):
            noise = self.noise[:, None]
            along = (residual * predicted / noise**2).sum(-1)
            size = ((predicted / noise) ** 2).sum(-1)
            both = (_where(self.members, of[..., None, :]).sum(-1) for of in (along, size))
            return tuple(both)


def _where(chosen, values):
    """Return values where they are chosen and zero elsewhere, of NumPy or JAX."""
    return values.__array_namespace__().where(chosen, values, 0.0)


def loadings(runs: Sequence[Run], unit: Float[np.ndarray, " runs"]) -> Loadings | None:
    """Return the loadings of runs; None where they are none of their own.

    What else was recorded of a run, and both moduli of a sweep, share its loading. `unit`: the norm
    of the weighted residuals of a run that misses by all of its size, over the root of its samples.
    """
    deviations = {run.loading.deviation for run in runs if run.loading is not None}
    if not deviations:
        return None
    (deviation,) = deviations
    sources = np.array([run.source if run.loading is not None else "" for run in runs])
    own = np.array(names_of_loadings(runs))
    noise = [1.0 if (one := run.loading) is None else relative_noise(run, one) for run in runs]
    told = np.array([run.loading is not None for run in runs])
    return Loadings(
        (sources == own[:, None]) & told, np.asarray(deviation), np.where(told, noise * unit, 1.0)
    )


def names_of_loadings(runs: Sequence[Run]) -> tuple[str, ...]:
    """Return the name of each loading of some runs, in the order of `Loadings`."""
    return tuple(dict.fromkeys(run.source for run in runs if run.loading is not None))


def relative_noise(run: Run, loading: Loading) -> float:
    """Return the noise of a run that is a loading of its own, relative to its size."""
    noise = loading.noise
    if noise is None:
        most = _MOST * loading.deviation
        fast = fast_part(run.recorded / run.sizes(run.recorded))
        noise = float(np.clip(fast, _LEAST, most)) if len(run) >= FEWEST_FAST else most
    return max(noise, _LEAST)


# Of a radian: the time in which a change of a periodic stress is seen, in its phase
_SEEN = 0.1


def data_scales(runs: Sequence[Run], others: Sequence[Run] = ()) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock, but for ``run_time``, which is the material's. Of `others`
    the temperatures count, and the shifts to these.
    """
    sweeps = [run for run in runs if run.protocol.control == "oscillation"]
    timed = [run for run in runs if run.protocol.control != "oscillation"]
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in timed if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in timed]
    strains = [
        float(np.sum(np.abs(run.rate[1:]) * np.diff(run.time)))
        + abs(float(run.rate[0])) * float(run.time[0])
        for run in timed
    ]
    strains += [float(np.max(np.abs(run.strain))) for run in sweeps if run.strain is not None]
    material_lengths = [float(run.time[-1]) for run in timed]
    # an oscillation changes within a radian; what is seen of it is a part of that
    radians = [1.0 / float(np.median(run.angular_frequency)) for run in sweeps]
    gaps += [_SEEN * radian for radian in radians]
    lengths, material_lengths = lengths + radians, material_lengths + radians
    stresses = [rms(run.stress) for run in runs]
    rates = [float(np.max(np.abs(run.rate))) for run in runs]
    stress, gap = float(np.median(stresses)) or 1.0, float(np.median(gaps or [1.0]))
    rate, length = float(np.median(rates)) or 1.0, float(np.median(lengths)) or 1.0
    return {
        "sampling_time": gap,
        "run_time": float(np.median(material_lengths)) or 1.0,
        "inverse_rate": 1.0 / rate,
        "strain": float(np.median(strains)) or 1.0,
        "stress": stress,
        "inverse_stress": 1.0 / stress,
        "fluidity": rate / stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "rate": rate,
        "inertia": stress * gap / rate,
        "softening_by_heat": softening_by_heat([*runs, *others]),
        "shift_factor": float(np.median([run.clock_factor for run in runs])),
    }


_GLASS = 0.8
"""−d ln a_T/dT at a glass transition, in 1/K   [Ferry 1980, ch. 11: 2.303 · 17.44/51.6 K]."""

_HEAT_CAPACITY = 1e6
"""Least heat capacity per volume of a liquid, in J/(m³ K)."""


def softening_by_heat(runs: Sequence[Run]) -> float:
    """Return by how much a unit of work can shorten relaxation times by its heat, in 1/Pa.

    −d ln a_T/dT is the steepest between two temperatures to whose shift factors runs were shifted;
    that of a glass transition where these are not known.
    """
    shifts = {
        round(run.temperature_C): np.log(run.clock_factor)
        for run in runs
        if run.temperature_C is not None
    }
    at = sorted(shifts)
    slopes = [(shifts[b] - shifts[a]) / (b - a) for a, b in pairwise(at)]
    steepest = max(slopes, default=0.0)
    return (steepest if steepest > 0.0 else _GLASS) / _HEAT_CAPACITY


OBSERVED = ("recorded", "first_normal_stress_difference", "second_normal_stress_difference")
"""What may be observed, in the order of the last axis: what is recorded, N1, N2."""

Mean = Literal["run", "runs", "values"]
"""What the squares of the residuals add up to: the sum over the runs of the mean of each, the mean
of that over the runs, or the mean over all values."""


class Records(eqx.Module):
    """What was recorded in runs, and what every value weighs; arrays of NumPy or JAX.

    `recorded`: in Pa, of creep the strain; zero where nothing was. Shape (runs, n, 3) of what is
    recorded, N1 and N2, or (runs, n). `weight`: zero where nothing was recorded or is looked at.
    """

    recorded: Float[Array | np.ndarray, "runs n *kinds"]
    weight: Float[Array | np.ndarray, "runs n *kinds"]
    loadings: Loadings | None = None  # which runs are loadings of their own; None where none is

    def only(self, keep: Bool[Array | np.ndarray, "*seen"]) -> "Records":
        """Return the records of which only some runs or samples are looked at.

        `keep`: which, shape (runs,) or (runs, n).
        """
        keep = keep.reshape(*keep.shape, *(1,) * (self.weight.ndim - keep.ndim))
        return replace(self, weight=_by_numpy(lambda weight: _looked_at(keep, weight), self.weight))

    def __len__(self) -> int:
        return len(self.weight)

    def of_one_kind(self) -> "Records":
        """Return the records of the first kind alone, without an axis of kinds."""
        parts = (self.recorded, self.weight)
        recorded, weight = (_by_numpy(lambda values: values[..., 0], part) for part in parts)
        return replace(self, recorded=recorded, weight=weight)

    def residual(
        self, predicted: Float[Values, "*trials_and_records"]
    ) -> Float[Values, "*trials_and_records"]:
        """Return predictions minus records, weighted; zero where none is looked at.

        Of runs that are loadings of their own what the factors of these leave.
        """
        seen = self.weight > 0
        off = _looked_at(seen, self.weight * (predicted - self.recorded))
        if self.loadings is None:
            return off
        # one loading has one factor, on all that was recorded of it
        rows = (*predicted.shape[: predicted.ndim - self.weight.ndim], len(self.weight), -1)
        weighted = _looked_at(seen, self.weight * predicted)
        left = self.loadings.whitened(off.reshape(rows), weighted.reshape(rows))
        return left.reshape(off.shape)

    def linearised(
        self, predicted: Float[Array, "runs n *kinds"], columns: Float[Array, "runs n *kinds p"]
    ) -> tuple[Float[Array, "runs n *kinds"], Float[Array, "runs n *kinds p"]]:
        """Return the residual and its derivatives, of predictions and theirs."""
        if self.loadings is None:
            weight = self.weight[..., None]
            change = _looked_at(weight > 0, weight * columns)
            return self.residual(predicted), change
        residual, change = jax.linearize(self.residual, predicted)
        return residual, jax.vmap(change, in_axes=-1, out_axes=-1)(columns)

    def factors(
        self, predicted: Float[np.ndarray, "trials runs n"]
    ) -> tuple[Float[np.ndarray, "trials loadings"], Float[np.ndarray, "trials loadings"]]:
        """Return factors of loadings less one, and their precisions; see `Loadings.factors`."""
        assert self.loadings is not None
        weight, recorded = np.asarray(self.weight), np.asarray(self.recorded)
        return self.loadings.factors(weight * (predicted - recorded), weight * predicted)

    @property
    def seen(self) -> Bool[np.ndarray, "runs n *kinds"]:
        """Whether a value was recorded and is looked at."""
        return np.asarray(self.weight) > 0


def make_records(runs: Sequence[Run], n: int, mean: Mean, kinds: int = 1) -> Records:
    """Return what was recorded in runs, of three kinds, in arrays of NumPy.

    `n`: samples of each, with padding. `mean`: what the squares of residuals add up to. `kinds`:
    how many of `OBSERVED` are looked at, where measured; a normal stress difference that is zero is
    not.
    """
    recorded = np.zeros((len(runs), n, len(OBSERVED)))
    weight, size = np.zeros_like(recorded), np.ones_like(recorded)
    for i, run in enumerate(runs):
        share = (run.weight, *run.normal_weights)
        for kind, name in enumerate(OBSERVED[:kinds]):
            values = getattr(run, name)
            if values is None or (kind and not np.any(values)):
                continue
            recorded[i, : len(run), kind] = values
            size[i, : len(run), kind] = run.sizes(values)
            weight[i, : len(run), kind] = share[kind]
    values_of = np.sum(weight > 0, axis=(1, 2))
    over = {
        "run": values_of,
        "runs": values_of * len(runs),
        "values": np.full(len(runs), np.sum(values_of)),
    }
    root = np.sqrt(np.maximum(over[mean], 1))
    units = np.array([run.weight for run in runs]) / root
    return Records(recorded, weight / (size * root[:, None, None]), loadings(runs, units))


def even(weight: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return by what values of one run are divided so that their noise has one size.

    Ones but for a flow curve or a sweep, whose noise is in proportion to it.

    `weight`: of its samples, without padding.
    """
    least = float(np.min(weight))
    return least / weight if np.ptp(weight) > 1e-9 * least else np.ones_like(weight)


def _looked_at(seen: Any, values: Any) -> Any:
    """Return values where they are looked at and zero elsewhere, of NumPy or JAX."""
    return values.__array_namespace__().where(seen, values, 0.0)


def _by_numpy(function: Callable[[np.ndarray], np.ndarray], values: Array | np.ndarray) -> Any:
    """Return what a function makes of values, by NumPy, which compiles nothing; of their kind."""
    found = function(np.asarray(values))
    return found if isinstance(values, np.ndarray) else on_device(found)
