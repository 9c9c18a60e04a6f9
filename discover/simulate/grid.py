"""Fixed time grids, made once on the host, so that every run of a batch shares one compilation."""

from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from discover.errors import InputError
from discover.protocols.shear import ShearProtocol

MAX_GRID_POINTS = 200_000


class IntegrationGrid(eqx.Module):
    """Where to step and where to sample, for one run or, with a leading axis, a batch of runs.

    Attributes
    ----------
    times
        Step times in s, shape (s,), strictly increasing from 0; padded past the last sample.
    sample_index
        Position in `times` of every sample, shape (n,); padded with the last one.
    sample_mask
        False where a sample is padding, shape (n,).
    """

    times: Float[Array, "*batch s"]
    sample_index: Int[Array, "*batch n"]
    sample_mask: Bool[Array, "*batch n"]


def make_grid(
    protocol: ShearProtocol,
    times: Float[np.ndarray, " n"],
    strain_step: float = 0.1,
    phase_step: float = 0.15,
    max_step: float = np.inf,
) -> tuple[Float[np.ndarray, " s"], Int[np.ndarray, " n"]]:
    """Return step times and the position of each sample among them.

    Every sample and every kink of the protocol is a step; between them no step turns the fluid
    through more than `strain_step` of strain or `phase_step` radians of an oscillation. With the
    defaults the fourth-order method is accurate to about 1e-6 of the stress (tested).

    Parameters
    ----------
    protocol
        The flow.
    times
        Sampling times in s, increasing, from 0 on.
    strain_step, phase_step
        Largest strain and phase per step.
    max_step
        Largest step in s.

    Raises
    ------
    InputError
        If the run would need an absurd number of steps.
    """
    times = np.asarray(times, dtype=float)
    end = float(times[-1])
    knots = np.asarray(protocol.table_times)
    rates = np.asarray(protocol.table_rates)
    kinks = knots[(knots > 0.0) & (knots < end)]
    jumps = np.intersect1d(kinks, knots[1:][np.diff(knots) <= 0.0])
    # Step to just before a jump and on from it, so that no step straddles one
    anchors = np.unique(np.concatenate([[0.0], times, kinks, jumps * (1.0 - 1e-12)]))
    fastest = np.max(np.abs(rates)) + np.sum(np.abs(np.asarray(protocol.amplitudes)))
    waves = np.asarray(protocol.frequencies)[np.asarray(protocol.amplitudes) != 0.0]
    limit = min(
        max_step,
        strain_step / fastest if fastest > 0 else np.inf,
        phase_step / np.max(np.abs(waves)) if waves.size and np.max(np.abs(waves)) > 0 else np.inf,
    )
    gaps = np.diff(anchors)
    pieces = np.maximum(1, np.ceil(gaps / limit - 1e-9)) if gaps.size else np.zeros(0)
    if np.sum(pieces) > MAX_GRID_POINTS:
        raise InputError(
            f"A run of {end:g} s at shear rates up to {fastest:g} 1/s would need "
            f"{int(np.sum(pieces))} steps (at most {MAX_GRID_POINTS}). Check the units of time and "
            "shear rate, or thin the run."
        )
    grid = np.concatenate(
        [
            a + gap * np.arange(int(n)) / n
            for a, gap, n in zip(anchors[:-1], gaps, pieces, strict=True)
        ]
        + [anchors[-1:]]
    )
    return grid, np.searchsorted(grid, times)


def make_grids(
    protocols: Sequence[ShearProtocol],
    times: Sequence[Float[np.ndarray, " _"]],
    **limits: float,
) -> IntegrationGrid:
    """Return the grids of several runs, padded to one shape with a leading batch axis.

    Parameters
    ----------
    protocols, times
        One flow and its sampling times for each run; see `make_grid`.
    **limits
        Step limits of `make_grid`.
    """
    grids = [make_grid(p, t, **limits) for p, t in zip(protocols, times, strict=True)]
    n_steps = max(max(len(g) for g, _ in grids), 2)
    n_samples = max(len(i) for _, i in grids)
    stacked = [], [], []
    for grid, index in grids:
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padding = grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)
        stacked[0].append(np.concatenate([grid, padding]))
        stacked[1].append(np.pad(index, (0, n_samples - len(index)), mode="edge"))
        stacked[2].append(np.arange(n_samples) < len(index))
    return IntegrationGrid(*(jnp.asarray(np.stack(s)) for s in stacked))
