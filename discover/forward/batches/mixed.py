"""Runs of several controls in one batch, and the batch of any runs."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.batches.imposed_stress import StressBatch, at_given_stress
from discover.forward.batches.loadings import Loadings, loadings
from discover.forward.batches.oscillation import OscillationBatch, Places, oscillations
from discover.forward.batches.samples import measured
from discover.forward.batches.steady import SteadyBatch, steady_states
from discover.forward.batches.transient import RunBatch, transients

Part = RunBatch | SteadyBatch | StressBatch
"""Runs of one control, which share one program, one row for each run."""


class MixedBatch(eqx.Module):
    """Runs of several controls, each of which has a program of its own, or of several loadings.

    Attributes
    ----------
    moduli
        Of each run that is a modulus, which one, and where its states stand in their part.
    weight, recorded
        Of all runs in their order, as in `RunBatch`.
    loadings
        Which of them have factors of their own on their records; None where there are none.
    """

    parts: tuple[Part | OscillationBatch, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moduli: tuple[Places, ...] = eqx.field(static=True)
    weight: Float[np.ndarray, "runs n"]
    recorded: Float[np.ndarray, "runs n"]
    loadings: Loadings | None = eqx.field(static=True, default=None)

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        return max(part.longest for part in self.parts)


Batch = Part | MixedBatch


def loadings_of(batch: Batch) -> Loadings | None:
    """Return the loadings of a batch; None where its runs are none of their own."""
    return batch.loadings if isinstance(batch, MixedBatch) else None


def deviation_of_loadings(batch: Batch) -> float:
    """Return the standard deviation of the factors of loadings; zero where there are none."""
    own = loadings_of(batch)
    return 0.0 if own is None else own.deviation


def as_predicted(batch: Batch) -> Batch:
    """Return a batch whose residuals are those of predictions, without factors of loadings."""
    if not isinstance(batch, MixedBatch) or batch.loadings is None:
        return batch
    return replace(batch, loadings=None)


def as_loaded(
    predicted: Float[np.ndarray, "trials runs n"], batch: Batch
) -> Float[np.ndarray, "trials runs n"]:
    """Return predictions with the likeliest factors of the loadings of a batch, if it has any."""
    if not isinstance(batch, MixedBatch) or batch.loadings is None:
        return predicted
    weighted = predicted * batch.weight
    off = weighted - batch.recorded * batch.weight
    factors, precision = batch.loadings.factors(off, weighted)
    prior = batch.loadings.deviation**2
    factors = factors * prior * precision / (1.0 + prior * precision)
    out = np.array(predicted)
    for i, rows in enumerate(batch.loadings.rows):
        out[:, [*rows]] *= (1.0 + factors[:, i])[:, None, None]
    return out


def make_batch(runs: Sequence[Run], strain_step: float = 0.25) -> Batch:
    """Return runs as a batch."""
    make = {
        "rate": lambda some: transients(some, strain_step),
        "steady": steady_states,
        "stress": lambda some: at_given_stress(some, strain_step),
    }
    controls = list(dict.fromkeys(run.protocol.control for run in runs))
    own = loadings(runs)
    if own is None and len(controls) == 1 and controls[0] in make:
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
    return MixedBatch(tuple(parts), rows, moduli, np.stack(weight), np.stack(recorded), own)
