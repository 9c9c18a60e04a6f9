"""Predictions of runs that are loadings of their own, with the factors that their records suggest.

A prediction p of a record y is replaced by p', whose distance from y is what
`discover.forward.batches.loadings` leaves of the residual e = p − y. Along the record in place of
the prediction this would be linear in p, but then a law that predicts less would leave less of the
noise.
"""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.forward import relative_noise, share_of_factor
from discover.programs import on_device


def signals_of(
    runs: Sequence[Run], noise: Float[np.ndarray, " runs"]
) -> Float[Array, " runs"] | None:
    """Return (s/ν)² of runs, zero of those that are no loading of their own; None if all are none.

    Parameters
    ----------
    runs
        The fitted runs.
    noise
        By what a misfit in units of the record's size is multiplied where the factor is taken.
    """
    if all(run.loading is None for run in runs):
        return None
    told = [
        0.0 if (own := run.loading) is None else own.deviation / relative_noise(run, own)
        for run in runs
    ]
    return on_device((np.array(told) / noise) ** 2)


def with_likely_factors(
    predicted: Float[Array, "runs n"],
    recorded: Float[Array, "runs n"],
    signal: Float[Array, " runs"],
) -> Float[Array, "runs n"]:
    """Return predictions p' of records, each run by a factor of its own that its prior holds back.

    Parameters
    ----------
    predicted, recorded
        In common units, zero where nothing was recorded.
    signal
        As `signals_of` returns it, in these units.
    """
    along = jnp.sum(predicted * (predicted - recorded), axis=1)
    share = share_of_factor(along, jnp.sum(predicted**2, axis=1), signal)
    return predicted - share[:, None] * predicted
