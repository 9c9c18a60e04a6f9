"""The runs that a closed loop fits, and those that judge it: without spikes, cut and thinned."""

from collections.abc import Iterator, Sequence

from discover.closed_loop.judging.before_after import cut_to_strain
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.search.scoring.refitting import FEWEST_SAMPLES
from discover.dataset import Dataset, Run
from discover.dataset.records.copies import require_no_copies
from discover.dataset.records.spikes import without_spikes
from discover.dataset.records.thinning import thin_run
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.inference.step_instants import with_rate_steps
from discover.statistics.projection import rms
from discover.statistics.residual import fast_part

FEWEST_LINEAR_SAMPLES = 10
"""Fewer samples than this at small strain settle nothing."""

MOST_SAMPLES = 400
"""Samples of a run that are used by default, at most: a search costs as much as it has samples, and
more of them say little more of a law."""

_FEWEST_KEPT = 150
_RESOLVED = 1e-3
"""Relative error that the noise of as many samples as are used may leave."""


def split_runs(
    dataset: Dataset,
    fit: Sequence[str] | None,
    held_out: Sequence[str],
    strain: tuple[float, float] | None,
    most: int,
) -> tuple[list[Run], list[Run], dict[str, list[float]]]:
    """Return the runs that are fitted, those that judge, and the times of spikes left out of each.

    Parameters
    ----------
    fit, held_out
        Names; by default all are fitted that are not held out.
    strain
        Smallest and largest strain of the samples used.
    most
        Samples of a run, at most.

    Raises
    ------
    InputError
        If a run is both fitted and held out, by name or by its samples; if none is left to fit; or
        if the samples asked for are too few.
    """
    overlap = [name for name in (fit or ()) if name in held_out]
    if overlap:
        raise InputError(f"The run {overlap[0]!r} is both fitted and held out; choose one.")
    held = dataset.select(list(held_out))
    fitted = dataset.select(
        list(fit) if fit is not None else [n for n in dataset.names if n not in held_out]
    )
    if len(fitted) == 0:
        raise InputError("No run is left to fit. Take some out of held_out.")
    require_no_copies(fitted.runs, held.runs)
    if most < FEWEST_LINEAR_SAMPLES:
        raise InputError(
            f"most_samples must be {FEWEST_LINEAR_SAMPLES} or more; got {most}. A law cannot be "
            "told from fewer samples."
        )
    spikes: dict[str, list[float]] = {}
    fitted_runs, held_runs = (
        [
            thin_run(run, _needed(run, most))
            for run in _without_spikes(
                cut_to_strain([*map(with_rate_steps, part.runs)], strain), spikes
            )
        ]
        for part in (fitted, held)
    )
    return fitted_runs, held_runs, spikes


def _without_spikes(runs: Sequence[Run], spikes: dict[str, list[float]]) -> Iterator[Run]:
    """Give the runs without the samples that stand alone in them, whose times are noted."""
    for run in runs:
        left, times = without_spikes(run)
        if times:
            spikes[run.name] = times
        yield left


def with_later_spikes(
    spikes: dict[str, list[float]], runs: Sequence[Run], judgement: Judgement
) -> dict[str, list[float]]:
    """Return the times of all outliers: of those that the fit showed too."""
    found = dict(spikes)
    for run, samples in zip(runs, judgement.left.outlier_samples, strict=True):
        if samples:
            times = [float(run.time[i]) for i in samples]
            found[run.name] = sorted([*found.get(run.name, []), *times])
    return found


def all_at_a_rate_in_shear(runs: Sequence[Run]) -> bool:
    """Return whether all runs are shear stresses at a given rate, which free functions explain."""
    return all(
        run.flow == "shear" and run.protocol.control == "rate" and run.quantity == "sigma12"
        for run in runs
    )


def _needed(run: Run, most: int) -> int:
    """Return how many samples of a run resolve its stress to `_RESOLVED`."""
    size = rms(run.recorded)
    noise = fast_part(run.recorded) / size if size > 0.0 else 0.0
    return int(min(most, max(_FEWEST_KEPT, (noise / _RESOLVED) ** 2)))


def require_samples(runs: Sequence[Run], declared: DeclaredModel) -> None:
    """Refuse what any law would fit."""
    count, constants = sum(len(run) for run in runs), declared.free_constants
    if count < FEWEST_SAMPLES + constants:
        raise InputError(
            f"The runs to fit ([data] fit) hold {count} samples in all, for {constants} constants "
            f"to be fitted; at least {FEWEST_SAMPLES + constants} are needed to tell a law from "
            "another. Sample more often, or declare the constants."
        )
