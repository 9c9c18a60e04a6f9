"""Periodic states, padded: a sample is a modulus of a sweep of frequency or amplitude."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from discover.dataset import Run
from discover.programs import on_device
from discover.protocols.kinematics import MODULI
from discover.simulate.grid import half_cycle


class OscillationBatch(eqx.Module):
    """Periodic states, padded, with a leading axis of sweeps: both moduli of each are computed.

    Attributes
    ----------
    strain, frequency
        Amplitude and rad/s, shape (sweeps, n).
    phase
        ωt at step ends and middles in turn over half a cycle, shape (sweeps, m).
    """

    strain: Float[Array, "sweeps n"]
    frequency: Float[Array, "sweeps n"]
    phase: Float[Array, "sweeps m"]

    @property
    def longest(self) -> float:
        """Zero: a periodic state knows no time since it began."""
        return 0.0


def oscillations(
    runs: Sequence[Run], strain_step: float
) -> tuple[OscillationBatch, tuple[tuple[int, int], ...]]:
    """Return the sweeps, and of each run which of them it is and which modulus of it."""
    sweeps: list[tuple[np.ndarray, np.ndarray]] = []
    moduli = []
    for run in runs:
        strain, frequency = np.asarray(run.strain), run.angular_frequency
        # G′ and G″ of one sweep are computed together
        at = next(
            (
                i
                for i, (other, beside) in enumerate(sweeps)
                if np.array_equal(other, strain) and np.array_equal(beside, frequency)
            ),
            len(sweeps),
        )
        if at == len(sweeps):
            sweeps.append((strain, frequency))
        moduli.append((at, MODULI.index(run.quantity)))
    n = max(len(strain) for strain, _ in sweeps)
    strains, frequencies = (
        on_device(np.stack([np.pad(v, (0, n - len(v)), mode="edge") for v in column]))
        for column in zip(*sweeps, strict=True)
    )
    phase = half_cycle(max(float(np.max(strain)) for strain, _ in sweeps), strain_step)
    phases = on_device(np.tile(phase, (len(sweeps), 1)))
    return OscillationBatch(strains, frequencies, phases), tuple(moduli)
