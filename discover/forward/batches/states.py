"""Tests of which each sample is a state by itself: flow curves, and sweeps of oscillations."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float, Int

from discover.dataset import Run
from discover.forward.grids.grid import steps_of_half_cycle
from discover.programs import on_device
from discover.protocols.kinematics import MODULI, Kinematics, stack_kinematics


class SteadyFlows(eqx.Module):
    """Flow curves, padded, with a leading axis of runs: a sample is a steady state at its rate."""

    rate: Float[Array, "runs n"]  # in 1/s, shape (runs, n)
    kinematics: Kinematics | None = None  # as in `TransientFlows`

    @property
    def longest(self) -> float:
        """Zero: a steady state knows no time."""
        return 0.0


def steady_states(runs: Sequence[Run]) -> SteadyFlows:
    """Return the flows of flow curves."""
    n = max(len(run) for run in runs)
    # a padded sample is one more of the last
    rates = [np.pad(run.rate, (0, n - len(run)), mode="edge") for run in runs]
    kinematics = stack_kinematics([run.protocol.kinematics for run in runs])
    return SteadyFlows(on_device(np.stack(rates)), kinematics)


# Half a cycle in the loop: as many steps as one of so much strain at least, whatever the strain
_FEWEST = 8.0

Places = tuple[int, tuple[int, ...]]
"""Of a run that is a modulus whether it is G′ (0) or G″ (1), and which states its samples are."""


class PeriodicFlows(eqx.Module):
    """Periodic states, each of which is solved for by itself; both moduli of each are computed.

    `strain`, `frequency`: amplitude and rad/s.
    """

    strain: Float[Array, " states"]
    frequency: Float[Array, " states"]
    steps: Int[Array, " states"]  # of half a cycle: more at large strain

    @property
    def longest(self) -> float:
        """Zero: a periodic state knows no time since it began."""
        return 0.0


def oscillations(
    runs: Sequence[Run], strain_step: float
) -> tuple[PeriodicFlows, tuple[Places, ...]]:
    """Return the states of sweeps, and of each run which of them are its own."""
    # G′ and G″ of one sweep are computed together
    of_runs = [
        np.stack([np.asarray(run.strain), np.asarray(run.angular_frequency)], axis=1)
        for run in runs
    ]
    states, number = np.unique(np.concatenate(of_runs), axis=0, return_inverse=True)
    ends = np.cumsum([len(own) for own in of_runs])[:-1]
    places = tuple(
        (MODULI.index(run.quantity), tuple(own.tolist()))
        for run, own in zip(runs, np.split(number.ravel(), ends), strict=True)
    )
    strain, frequency = states.T
    steps = [steps_of_half_cycle(max(float(one), _FEWEST / 2.0), strain_step) for one in strain]
    return PeriodicFlows(*map(on_device, (strain, frequency, np.array(steps)))), places
