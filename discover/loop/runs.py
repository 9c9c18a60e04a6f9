"""Runs that a closed loop fits, and those that judge it: each value once, cut and thinned."""

from collections.abc import Iterator, Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import count_flows, require_no_copies
from discover.dataset.records.thinning import thin_run, without_held_values, without_spikes
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.loop.measured_rates import with_rate_steps
from discover.protocols import strains
from discover.protocols.kinematics import STATES
from discover.statistics.noise.noise_model import rms
from discover.statistics.residual import fast_part

FEWEST_SAMPLES = 5
"""Samples beyond the constants to be fitted, below which any law fits."""

MOST_SAMPLES = 400
"""Samples of a run that are used by default, at most: more of them say little more of a law."""

_FEWEST_ASKED = 10
_FEWEST_KEPT = 150
_RESOLVED = 1e-3  # Relative error that the noise of as many samples as are used may leave


def split_runs(
    dataset: Dataset,
    fit: Sequence[str] | None,
    held_out: Sequence[str],
    strain: tuple[float, float] | None,
    most: int,
) -> tuple[list[Run], list[Run], dict[str, list[float]]]:
    """Return the runs that are fitted, those that judge, and the times of spikes left out of each.

    `fit`, `held_out`: names; by default all are fitted that are not held out. `strain`: smallest
    and largest strain of the samples used. `most`: samples of a run, at most.

    Raises InputError if a run is both fitted and held out, by name or by its samples; if none is
    left to fit; or if the samples asked for are too few.
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
    if most < _FEWEST_ASKED:
        raise InputError(
            f"most_samples must be {_FEWEST_ASKED} or more; got {most}. A law cannot be told from "
            "fewer samples."
        )
    spikes: dict[str, list[float]] = {}
    fitted_runs, held_runs = (
        [
            thin_run(run, _needed(run, most))
            for run in _without_spikes(
                cut_to_strain(
                    [without_held_values(with_rate_steps(run)) for run in part.runs], strain
                ),
                spikes,
            )
        ]
        for part in (fitted, held)
    )
    return fitted_runs, held_runs, spikes


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

    Raises InputError if the window is no window, or a run has fewer than 3 samples in it.
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


def _without_spikes(runs: Sequence[Run], spikes: dict[str, list[float]]) -> Iterator[Run]:
    """Give the runs without the samples that stand alone in them, whose times are noted."""
    for run in runs:
        left, times = without_spikes(run)
        if times:
            spikes[run.name] = times
        yield left


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


def why_untested(
    constants: int, fitted: Sequence[Run], held_out: Sequence[Run]
) -> Literal["flows", "states"] | None:
    """Return why nothing that was measured could have refuted what was fitted; None if it could.

    ``flows``: no run is held out, and each flow that was measured is taken by a constant, for a
    constant takes a flow to show itself. ``states``: steady and periodic states do not tell how
    they are reached: a viscosity η₀/(1 + q γ̇) is that of a structure that flow breaks down, and as
    well one of White and Metzner.

    `constants`: fitted; those of the declared model count as one.
    """
    if not constants:
        return None
    if all(run.protocol.control in STATES for run in (*fitted, *held_out)):
        return "states"
    return "flows" if not held_out and count_flows(fitted) <= constants else None
