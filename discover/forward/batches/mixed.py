"""Runs of several controls in one batch, and the batch of any runs."""

from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.batches.imposed_stress import StressBatch, at_given_stress
from discover.forward.batches.oscillation import OscillationBatch, Places, oscillations
from discover.forward.batches.samples import measured
from discover.forward.batches.steady import SteadyBatch, steady_states
from discover.forward.batches.transient import RunBatch, transients

Part = RunBatch | SteadyBatch | StressBatch
"""Runs of one control, which share one program, one row for each run."""


class MixedBatch(eqx.Module):
    """Runs of several controls, each of which has a program of its own.

    Attributes
    ----------
    moduli
        Of each run that is a modulus, which one, and where its states stand in their part.
    weight, recorded
        Of all runs in their order, as in `RunBatch`.
    """

    parts: tuple[Part | OscillationBatch, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moduli: tuple[Places, ...] = eqx.field(static=True)
    weight: Float[np.ndarray, "runs n"]
    recorded: Float[np.ndarray, "runs n"]

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        return max(part.longest for part in self.parts)


Batch = Part | MixedBatch


def make_batch(runs: Sequence[Run], strain_step: float = 0.25) -> Batch:
    """Return runs as a batch."""
    make = {
        "rate": lambda some: transients(some, strain_step),
        "steady": steady_states,
        "stress": lambda some: at_given_stress(some, strain_step),
    }
    controls = list(dict.fromkeys(run.protocol.control for run in runs))
    if len(controls) == 1 and controls[0] in make:
        return make[controls[0]](runs)
    moduli: tuple[Places, ...] = ()
    rows = tuple(
        tuple(i for i, run in enumerate(runs) if run.protocol.control == control)
        for control in controls
    )
    parts = []
    for control, some in zip(controls, rows, strict=True):
        if control == "oscillation":
            part, moduli = oscillations([runs[i] for i in some], strain_step)
        else:
            part = make[control]([runs[i] for i in some])
        parts.append(part)
    n = max(len(run) for run in runs)
    weight, recorded = zip(*(measured(run, n) for run in runs), strict=True)
    return MixedBatch(tuple(parts), rows, moduli, np.stack(weight), np.stack(recorded))
