"""Runs as a fit has them, for the question how they were read.

See `discover.statistics.reading.misread`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward import AugmentedModel, Batch, even
from discover.inference.least_squares import Fit
from discover.inference.modulus_errors import modulus_shifts
from discover.statistics.noise.outliers import stray
from discover.statistics.reading.reading_faults import Reading

_STEP = 1e-2  # relative, of a modulus


def fitted_readings(
    model: AugmentedModel, batch: Batch, runs: Sequence[Run], fit: Fit
) -> list[Reading]:
    """Return the fitted runs for the question how they were read.

    The factors of loadings, where runs have any, are constants of them that come last.
    """
    changes = _of_moduli(model, batch, fit.theta)
    columns = fit.jacobian
    if batch.records.loadings is not None:
        columns = _with_factors(model, batch, fit.theta, fit.free)
    return _readings(batch, runs, fit.residual, columns, *changes)


def unseen_readings(
    model: AugmentedModel, batch: Batch, runs: Sequence[Run], fit: Fit, theta: np.ndarray
) -> list[Reading]:
    """Return runs that no fit saw for the same question, as these parameters predict them."""
    found = model.linearise(theta, batch, fit.free)
    columns = found.jacobian
    if batch.records.loadings is not None:
        columns = _with_factors(model, batch, theta, fit.free)
    return _readings(batch, runs, found.residual, columns, *_of_moduli(model, batch, theta))


def beside_one_another(
    fitted: Sequence[Reading], unseen: Sequence[Reading], constants: int
) -> tuple[list[Reading], list[Reading]]:
    """Return runs with a column for the factor of each loading of all of them, where they have any.

    Parameters
    ----------
    fitted, unseen
        Of which each has columns of the constants, and then of the loadings of its kind.
    constants
        How many constants were fitted.
    """
    own, others = (
        max((len(run.columns) for run in runs), default=constants) - constants
        for runs in (fitted, unseen)
    )

    def padded(run: Reading, before: int, after: int) -> Reading:
        first, last = run.columns[:constants], run.columns[constants:]
        none = np.zeros((before, len(run.times))), np.zeros((after, len(run.times)))
        return replace(run, columns=np.concatenate([first, none[0], last, none[1]]))

    if not own and not others:
        return list(fitted), list(unseen)
    return [padded(run, 0, others) for run in fitted], [padded(run, own, 0) for run in unseen]


def _with_factors(
    model: AugmentedModel, batch: Batch, theta: np.ndarray, free: Sequence[int]
) -> Float[np.ndarray, "columns runs n"]:
    """Return changes of the weighted predictions by constants, and by factors of the loadings."""
    own, plain = batch.records.loadings, batch.without_factors()
    assert own is not None
    found = model.linearise(theta, plain, free)
    predicted = found.residual + batch.recorded * batch.weight
    factors = np.where(np.asarray(own.members)[..., None], predicted, 0.0)
    return np.concatenate([found.jacobian, factors])


def _readings(
    batch: Batch,
    runs: Sequence[Run],
    residual: Float[np.ndarray, "runs n"],
    jacobian: Float[np.ndarray, "free runs n"],
    moduli: Float[np.ndarray, "k runs n"],
    errors: Float[np.ndarray, "errors runs n"],
) -> list[Reading]:
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    found = []
    if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(jacobian))):
        return found  # the law runs away in one of them
    for i, run in enumerate(runs):
        seen = weight[i] > 0
        own, record = weight[i, seen], recorded[i, seen]
        if not len(record):
            continue
        off = residual[i, seen] / own
        kept = ~stray(off / even(own), record / even(own))
        found.append(
            Reading(
                _times(run, int(np.count_nonzero(seen)))[kept],
                (record + off)[kept],
                off[kept],
                (jacobian[:, i, seen] / own)[:, kept],
                1.0 / even(own)[kept],
                control=run.protocol.control,
                modes=(moduli[:, i, seen] / own)[:, kept],
                shared=(errors[:, i, seen] / own)[:, kept],
            )
        )
    return found


def _of_moduli(
    model: AugmentedModel, batch: Batch, theta: np.ndarray
) -> tuple[Float[np.ndarray, "k runs n"], Float[np.ndarray, "errors runs n"]]:
    """Return what relative changes of each modulus change, and errors that a sweep leaves."""
    modulus = np.asarray(model.declared.modulus, dtype=float)
    found = np.zeros((0, *np.shape(batch.weight)))
    if len(modulus) > 1:
        moves = np.pad(_STEP * np.diag(modulus), [(0, 0), (0, 1)])
        found = np.nan_to_num(model.linearise(theta, batch, moves=moves).jacobian) / _STEP
    return found, modulus_shifts(model, theta, batch)


def _times(run: Run, count: int) -> Float[np.ndarray, " n"]:
    return np.asarray(run.time, dtype=float)[:count]
