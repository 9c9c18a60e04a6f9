"""Runs laid out for prediction: the flows of each control, and what was recorded in all of them."""

from collections.abc import Sequence
from dataclasses import replace

import equinox as eqx
import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward.batches.flows import (
    PeriodicFlows,
    Places,
    SteadyFlows,
    StressFlows,
    TransientFlows,
    at_given_stress,
    oscillations,
    steady_states,
    transients,
)
from discover.forward.batches.records import Records, make_records

Flows = TransientFlows | SteadyFlows | StressFlows | PeriodicFlows
"""Flows of one control, which share one program; of all but oscillations one row for each run."""


class Batch(eqx.Module):
    """Runs of one control or several, in parts of which each has a program of its own.

    `parts`, `rows`: the flows of each control, simple shear apart, and which runs they are.
    `moduli`: of each run that is a modulus, which one, and where its states stand in their part.
    """

    parts: tuple[Flows, ...]
    rows: tuple[tuple[int, ...], ...] = eqx.field(static=True)
    moduli: tuple[Places, ...] = eqx.field(static=True)
    records: Records  # of all runs in their order, of one kind, in arrays of NumPy

    @property
    def weight(self) -> Float[np.ndarray, "runs n"]:
        """Weights of what was recorded, zero at padding."""
        return np.asarray(self.records.weight)

    @property
    def recorded(self) -> Float[np.ndarray, "runs n"]:
        """What was recorded, in Pa or as a strain."""
        return np.asarray(self.records.recorded)

    @property
    def longest(self) -> float:
        """Time of the last sample of all, in s."""
        return max(part.longest for part in self.parts)

    def without_factors(self) -> "Batch":
        """Return a batch whose residuals are those of predictions, without factors of loadings."""
        return replace(self, records=self.records.without_factors())


def make_batch(runs: Sequence[Run], strain_step: float = 0.25) -> Batch:
    """Return runs as a batch.

    `runs`: of each record one. `strain_step`: largest strain of a step.
    """
    # simple shear apart from other flows, for it costs less
    kinds = [
        (flow.control, flow.control == "rate" and flow.kinematics is not None)
        for flow in (run.protocol for run in runs)
    ]
    rows = tuple(
        tuple(i for i, own in enumerate(kinds) if own == kind) for kind in dict.fromkeys(kinds)
    )
    moduli: tuple[Places, ...] = ()
    parts: list[Flows] = []
    for at in rows:
        own = [runs[i] for i in at]
        control = own[0].protocol.control
        if control == "oscillation":
            part, moduli = oscillations(own, strain_step)
        elif control == "steady":
            part = steady_states(own)
        elif control == "stress":
            part = at_given_stress(own, strain_step)
        else:
            part = transients(own, strain_step)
        parts.append(part)
    records = make_records(runs, max(map(len, runs)), "run").of_one_kind()
    return Batch(tuple(parts), rows, moduli, records)
