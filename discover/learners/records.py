"""What was recorded in runs and what every value weighs: the misfit that all learners minimise.

A residual is what is predicted minus what was recorded, times its weight. A weight is the run's own
(`Run.weight`, or one of `Run.normal_weights`), over the size of the value (`Run.sizes`: the
root-mean-square of a transient, in a flow curve or a sweep each value itself), over the root of the
number of values that the mean is over. So where runs weigh alike the norm of the residuals is the
relative misfit. The mean is over all values, or over the runs of each one's mean; in the batches of
the closed loop (`discover.forward.batches`) it is the sum of that over the runs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from discover.dataset.run import Run
from discover.errors import InputError
from discover.forward.enough_steps import in_enough_steps
from discover.forward.grids.flow_batch import FlowBatch, lay_out
from discover.laws.multimode import Fluid
from discover.learners.own_loadings import signals_of, with_likely_factors
from discover.programs import on_device

OBSERVED = ("recorded", "first_normal_stress_difference", "second_normal_stress_difference")
"""What may be observed, in the order of the last axis: what is recorded, N1, N2."""


class Records(eqx.Module):
    """What was recorded in runs, and what every value weighs.

    Attributes
    ----------
    recorded
        In Pa, of creep the strain; zero where nothing was. Shape (runs, n, 3) of what is recorded,
        N1 and N2, or (runs, n) of the first alone.
    weight
        Of each value, as above; zero where nothing was recorded or it is not looked at.
    loading
        Of runs that are loadings of their own, as `signals_of` returns it in units of the misfit,
        shape (runs,); None where none is.
    """

    recorded: Float[Array, "runs n *kinds"]
    weight: Float[Array, "runs n *kinds"]
    loading: Float[Array, " runs"] | None = None

    def only(self, keep: Bool[Array, "*seen"]) -> "Records":
        """Return the records of which only some runs or samples are looked at.

        Parameters
        ----------
        keep
            Which, shape (runs,) or (runs, n).
        """
        keep = keep.reshape(*keep.shape, *(1,) * (self.weight.ndim - keep.ndim))
        return replace(self, weight=jnp.where(keep, self.weight, 0.0))

    def weighted(self, predicted: Float[Array, "runs n *kinds"]) -> Float[Array, "runs n *kinds"]:
        """Return weighted predictions, in units of the records; zero where none is looked at.

        Of runs that are loadings of their own with the factors that their records suggest.
        """
        found = jnp.where(self.weight > 0, self.weight * predicted, 0.0)
        if self.loading is None:
            return found
        # one loading has one factor, on all that was recorded of it
        rows = (found.shape[0], -1)
        recorded = (self.weight * self.recorded).reshape(rows)
        return with_likely_factors(found.reshape(rows), recorded, self.loading).reshape(found.shape)

    def residual(self, predicted: Float[Array, "runs n *kinds"]) -> Float[Array, "runs n *kinds"]:
        """Return weighted predictions minus weighted records."""
        return self.weighted(predicted) - self.weight * self.recorded

    def linearised(
        self,
        predicted: Float[Array, "runs n *kinds"],
        columns: Float[Array, "runs n *kinds p"],
    ) -> tuple[Float[Array, "runs n *kinds"], Float[Array, "runs n *kinds p"]]:
        """Return the residual and its derivatives, of predictions and theirs."""
        if self.loading is None:
            weight = self.weight[..., None]
            return self.residual(predicted), jnp.where(weight > 0, weight * columns, 0.0)
        residual, change = jax.linearize(self.residual, predicted)
        return residual, jax.vmap(change, in_axes=-1, out_axes=-1)(columns)

    @property
    def seen(self) -> Bool[np.ndarray, "runs n *kinds"]:
        """Whether a value was recorded and is looked at."""
        return np.asarray(self.weight) > 0

    @property
    def weighted_record(self) -> Float[np.ndarray, " rows"]:
        """What was recorded, times its weight, in one vector."""
        return np.asarray(self.weight * self.recorded).reshape(-1)

    @property
    def n_observations(self) -> int:
        """Number of values recorded."""
        return int(np.sum(self.seen))

    @property
    def run_of_row(self) -> Int[np.ndarray, " rows"]:
        """Run to which each row of the flattened records belongs."""
        runs = len(self.recorded)
        return np.repeat(np.arange(runs), self.recorded.size // runs)

    def sequences(self) -> list[np.ndarray]:
        """Return the rows of each run and kind, in the order of time, of records of three kinds."""
        seen = self.seen
        runs, _, kinds = seen.shape
        rows = np.arange(seen.size).reshape(seen.shape)
        sequences = [rows[i, seen[i, :, k], k] for i in range(runs) for k in range(kinds)]
        return [sequence for sequence in sequences if sequence.size]


def laid_out(
    runs: Sequence[Run],
    known: Fluid,
    use_normal_stresses: bool = False,
    runs_alike: bool = False,
    samples_in: int = 1,
    steps_in: int = 1,
    **limits: Any,
) -> tuple[FlowBatch, Records]:
    """Return runs and their grids, and what was recorded in them of three kinds.

    Parameters
    ----------
    runs
        As `as_runs` returns them.
    known
        The known part, whose steps the grids follow.
    use_normal_stresses
        Whether N1 and N2, where measured, are looked at too.
    runs_alike
        Whether each run counts alike, or each value.
    samples_in, steps_in
        Samples and steps are rounded up to multiples, so that different runs share a compilation.
    **limits
        Of steps, as `make_grids` takes them.

    Raises
    ------
    InputError
        If what was recorded in a run is zero throughout.
    """
    n = -(-max(map(len, runs)) // samples_in) * samples_in
    recorded = np.zeros((len(runs), n, len(OBSERVED)))
    weight = np.zeros_like(recorded)
    for i, run in enumerate(runs):
        share = (run.weight, *run.normal_weights)
        for kind, name in enumerate(OBSERVED if use_normal_stresses else OBSERVED[:1]):
            values = getattr(run, name)
            if values is None:
                continue
            if not np.any(values):
                if kind == 0:
                    raise InputError(
                        f"The shear stress of the run {run.name!r} is zero throughout: it says "
                        "nothing of the law. Leave the run out."
                    )
                continue  # a normal stress difference may vanish in truth, but sets no scale
            recorded[i, : len(run), kind] = values
            weight[i, : len(run), kind] = share[kind] / run.sizes(values)
    values_of = np.sum(weight > 0, axis=(1, 2))
    root = np.sqrt(values_of * len(runs) if runs_alike else np.full(len(runs), np.sum(values_of)))
    flows = lay_out(
        [run.protocol for run in runs],
        [run.time for run in runs],
        n,
        relaxation_time=known.settling_time,
        **limits,
    )
    return in_enough_steps(known, flows.with_steps_in(steps_in)), Records(
        on_device(recorded),
        on_device(weight / root[:, None, None]),
        signals_of(runs, np.array([run.weight for run in runs]) / root),
    )
