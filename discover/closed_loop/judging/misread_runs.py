"""A model that explains records only up to how each was read: in the verdict, and in constants.

See `discover.statistics.misread`. A fault that describes the runs clearly better refutes the model.
One that is not ruled out by the fitted runs moves the constants, whose intervals hold either.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.dataset import Run
from discover.forward import AugmentedModel, Batch, even
from discover.forward.least_squares import Fit, jacobians
from discover.forward.modulus_errors import modulus_shifts
from discover.protocols.kinematics import STATES
from discover.statistics.misread import CLEAR, POSSIBLE, Misread, Reading, advice, misread, reads
from discover.statistics.outliers import stray
from discover.statistics.residual import STRUCTURE, Expectation

_STEP = 1e-2  # relative, of a modulus

Bounds = dict[int, tuple[float, float]]


def fitted_readings(
    model: AugmentedModel, batch: Batch, runs: Sequence[Run], fit: Fit
) -> list[Reading]:
    """Return the fitted runs for the question how they were read."""
    changes = _of_moduli(model, batch, fit.theta)
    return _readings(batch, runs, fit.residual, fit.jacobian, *changes)


def unseen_readings(
    model: AugmentedModel, batch: Batch, runs: Sequence[Run], fit: Fit, theta: np.ndarray
) -> list[Reading]:
    """Return runs that no fit saw for the same question, as these parameters predict them."""
    residual = model.residuals([theta], batch)
    columns = jacobians(model, batch, [theta], residual, [fit.free])[0]
    return _readings(batch, runs, residual[0], columns, *_of_moduli(model, batch, theta))


def judged_as_read(
    judgement: Judgement,
    fitted: Sequence[Reading],
    unseen: Sequence[Reading],
    expectation: Expectation,
    resolution: NumericalResolution,
    theta: np.ndarray,
    active: Sequence[str],
) -> Judgement:
    """Return a judgement that another reading of the runs does not refute.

    Parameters
    ----------
    judgement
        Of the final model.
    fitted, unseen
        Runs as it predicts them.
    expectation
        What a complete model may leave; a noise that is given may hold anything.
    resolution
        What arithmetic leaves of the fitted runs.
    theta, active
        The parameters, and the effects in the model.
    """
    if judgement.verdict not in ("effects_added", "no_effect_needed"):
        return judgement
    left = judgement.left
    if expectation.noise is not None and left.misfit <= left.expected:
        return judgement
    sets = [fitted, [*fitted, *unseen]] if unseen else [fitted]
    found = [one for runs in sets if (one := misread(runs)) is not None]
    clear = [one for one in found if len(sets) * one.probability <= CLEAR]
    seen = [one for one in clear if not expectation.excuses(one.size)]
    if not seen:
        return judgement
    best = min(seen, key=lambda one: one.probability)
    if best.size <= STRUCTURE * resolution.limit(theta, active, best.size):
        return judgement
    text = (
        f"{judgement.description} But the records follow the model clearly better {reads(best)}: "
        f"{advice(best)}. Constants beside it would be others, so nothing is explained."
    )
    return replace(
        judgement,
        verdict="unexplained",
        structured=True,
        left=left.refuted(left.reason),
        description=text,
    )


def holding_misreading(
    bounds: Bounds, fit: Fit, fitted: Sequence[Reading], model: AugmentedModel
) -> tuple[Bounds, Misread | None]:
    """Return intervals that hold with a fault that is not ruled out too, and the fault."""
    found = misread(fitted)
    if found is None or found.probability > POSSIBLE or not len(found.steps):
        return bounds, None
    wider = dict(bounds)
    for position, step in zip(fit.free, found.steps, strict=True):
        if position not in bounds or not np.isfinite(step):
            continue
        low, high = bounds[position]
        wider[position] = (
            max(low + min(float(step), 0.0), float(model.low[position])),
            min(high + max(float(step), 0.0), float(model.high[position])),
        )
    return wider, found


def _readings(
    batch: Batch,
    runs: Sequence[Run],
    residual: Float[np.ndarray, "runs n"],
    jacobian: Float[np.ndarray, "free runs n"],
    moduli: Float[np.ndarray, "k runs n"],
    errors: Float[np.ndarray, "k runs n"],
) -> list[Reading]:
    weight, recorded = np.asarray(batch.weight), np.asarray(batch.recorded)
    found = []
    for i, run in enumerate(runs):
        seen = weight[i] > 0
        own, record = weight[i, seen], recorded[i, seen]
        if not len(record):
            continue
        off = residual[i, seen] / own
        kept = ~stray(off / even(own), record / even(own))
        control = run.protocol.control
        found.append(
            Reading(
                _times(run, int(np.count_nonzero(seen)))[kept],
                (record + off)[kept],
                off[kept],
                (jacobian[:, i, seen] / own)[:, kept],
                1.0 / even(own)[kept],
                has_zero=control == "rate" and control not in STATES,
                has_level=control in ("rate", "steady"),
                modes=(moduli[:, i, seen] / own)[:, kept],
                shared=(errors[:, i, seen] / own)[:, kept],
            )
        )
    return found


def _of_moduli(
    model: AugmentedModel, batch: Batch, theta: np.ndarray
) -> tuple[Float[np.ndarray, "k runs n"], Float[np.ndarray, "k runs n"]]:
    """Return what relative changes of each modulus change, and errors that a sweep leaves."""
    modulus = np.asarray(model.declared.modulus, dtype=float)
    found = np.zeros((0, *np.shape(batch.weight)))
    if len(modulus) > 1:
        moved = [
            [
                model.at_moduli(modulus * (1 + sign * _STEP * one)).residuals([theta], batch)[0]
                for sign in (1, -1)
            ]
            for one in np.eye(len(modulus))
        ]
        found = np.nan_to_num(np.array([(up - down) / (2 * _STEP) for up, down in moved]))
    return found, modulus_shifts(model, theta, batch)


def _times(run: Run, count: int) -> Float[np.ndarray, " n"]:
    return np.asarray(run.time, dtype=float)[:count]
