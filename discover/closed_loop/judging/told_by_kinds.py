"""Which kind of test determined each constant of the final model, and each run held out."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.dataset.run_table import kind_of_record
from discover.forward import MODULUS, RELAXATION_TIME, AugmentedModel, Batch
from discover.inference.fit_uncertainty import sequences_of
from discover.inference.least_squares import Fit
from discover.statistics import Sized, Told, told_by_tests


def told_by_kinds(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    runs: Sequence[Run],
    effects: Sequence[str],
    held: tuple[Batch, Sequence[Run]] | None,
    shifts: Float[np.ndarray, "k runs n"],
) -> tuple[Told, ...]:
    """Return what tests of each kind tell; nothing where all fitted runs are of one kind."""
    kinds = [kind_of_record(run) for run in runs]
    if len(set(kinds)) < 2 or not fit.free:
        return ()
    sequences, sizes = sequences_of(batch)
    numbers = _constants(model, fit, effects)
    if held is not None:
        numbers += _predictions(model, fit, *held)
    return told_by_tests(
        fit.jacobian.reshape(len(fit.free), -1).T,
        fit.residual.ravel(),
        sequences,
        kinds,
        numbers,
        shifts.reshape(len(shifts), -1).T if len(shifts) else None,
        sizes,
    )


def _constants(model: AugmentedModel, fit: Fit, effects: Sequence[str]) -> list[Sized]:
    declared = model.declared
    single = len(declared.modulus) == 1
    factors = {
        0: MODULUS if single else "modulus_factor",
        1: RELAXATION_TIME if single else "relaxation_time_factor",
    }
    names = {2 + i: p.name for i, p in enumerate(declared.free_parameters)}
    # these are fitted as the logarithm of a factor, whose error is relative already
    size = {at: 1.0 for at in factors}
    names |= factors
    for name in effects:
        parameters = next(effect.parameters for effect in model.effects if effect.name == name)
        for one, at in zip(parameters, model.positions(name), strict=True):
            names[at] = f"{one.name} of {name}"
    unit = np.eye(len(fit.free))
    least = np.finfo(float).tiny ** 0.5
    return [
        Sized(names[at], unit[[i]] / size.get(at, max(abs(float(fit.theta[at])), least)))
        for i, at in enumerate(fit.free)
        if at in names
    ]


def _predictions(model, fit, batch: Batch, runs: Sequence[Run]) -> list[Sized]:
    slopes = model.linearise(fit.theta, batch, fit.free).jacobian
    found = []
    for i, run in enumerate(runs):
        seen = np.asarray(batch.weight)[i] > 0
        # weights are one over the root-mean-square of a record and the root of its samples
        own = slopes[:, i, seen].T * np.sqrt(np.sum(seen))
        if np.all(np.isfinite(own)):
            found.append(Sized(f"prediction of {run.name}", own))
    return found
