"""Predictions of the declared and the augmented model, run by run."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.run_record import RunRecord
from discover.dataset import Run
from discover.errors import InputError
from discover.forward import AugmentedModel, Batch
from discover.protocols import strains
from discover.protocols.kinematics import STATES
from discover.statistics.projection import rms


def strain_of(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain of a run at its samples: recorded, or of its commanded rate.

    That of a steady state is not known, and nan.
    """
    if run.strain is not None:
        return run.strain
    if run.protocol.control == "steady":
        return np.full(len(run), np.nan)
    return strains(run.protocol, run.time)


def cut_to_strain(runs: Sequence[Run], window: tuple[float, float] | None) -> list[Run]:
    """Return the samples of every run whose strain magnitude lies in a window.

    Raises
    ------
    InputError
        If the window is no window, or a run has fewer than 3 samples in it.
    """
    if window is None:
        return list(runs)
    low, high = window
    if not 0 <= low < high:
        raise InputError(
            f"The strain window must be two increasing numbers from 0 on; got {list(window)}."
        )
    cut = []
    for run in runs:
        if run.protocol.control in STATES:
            cut.append(run)  # no course of a strain to be cut
            continue
        strain = np.abs(strain_of(run))
        keep = (strain >= low) & (strain <= high)
        if np.count_nonzero(keep) < 3:
            raise InputError(
                f"The run {run.name!r} has {np.count_nonzero(keep)} samples at strains from "
                f"{low:g} to {high:g}; at least 3 are needed. Widen [loop] strain or leave the run "
                "out."
            )
        cut.append(run.window(keep))
    return cut


def record_runs(
    model: AugmentedModel,
    batch: Batch,
    runs: Sequence[Run],
    thetas: Sequence[np.ndarray],
    held_out: bool,
    order: Sequence[str] = (),
) -> list[RunRecord]:
    """Return each run with the predictions of several parameter vectors.

    Of fitted runs with the factors of their loadings, where they have any; those of runs that no
    fit saw are told by these runs themselves, so they are no part of a prediction.

    Parameters
    ----------
    model, batch, runs, thetas
        The runs, laid out for the model, and the parameter vectors.
    held_out
        Whether no fit saw them.
    order
        Names of the runs of the data set, in its order.
    """
    predictions = model.predictions(thetas, batch)
    if not held_out:
        predictions = batch.records.as_loaded(predictions)
    records = []
    for i, run in enumerate(runs):
        predicted = predictions[:, i, : len(run)]
        size = rms(run.recorded)
        misfit = np.sqrt(np.mean((predicted - run.recorded) ** 2, axis=1))
        records.append(
            RunRecord(
                name=run.name,
                held_out=held_out,
                time=run.time,
                strain=strain_of(run),
                instrument_time=run.time / run.clock_factor,
                rate=run.rate,
                measured=run.recorded,
                predicted=predicted,
                errors=misfit / (size if size > 0 else 1.0),
                conditions=_conditions(run, order),
                flow=run.flow,
                quantity=run.quantity,
                control=run.protocol.control,
            )
        )
    return records


def _conditions(run: Run, order: Sequence[str]) -> dict[str, float]:
    numbers = {k: float(v) for k, v in run.metadata.items() if not isinstance(v, str)}
    numbers.pop("n_points", None)  # of the file, not of the experiment
    if run.name in order:
        numbers["the order of the runs"] = float(list(order).index(run.name))
    return numbers


def errors_of(records: Sequence[RunRecord], index: int) -> ErrorPair:
    """Return the mean errors of one of the models in the records."""
    fitted = [r.errors[index] for r in records if not r.held_out]
    held = [r.errors[index] for r in records if r.held_out]
    return ErrorPair(float(np.mean(fitted)), float(np.mean(held)) if held else None)
