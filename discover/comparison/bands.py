"""Predictions of a posterior in the flows of a comparison: σ12, N1 and N2 with their 95 % bands."""

from collections.abc import Mapping, Sequence
from dataclasses import astuple, replace

import numpy as np
from jaxtyping import Float

from discover.comparison.flows import MEASURED, Band, Flow, Stresses, columns_of
from discover.dataset import Run
from discover.forward import AugmentedModel, make_batch
from discover.forward.of_fluids import bare_run
from discover.inference.engine.bands import Predictions
from discover.inference.engine.rows import Rows
from discover.linear_algebra_threads import in_one_thread
from discover.loop.expected_errors import weighed_laws
from discover.loop.loop import Found


@in_one_thread
def flow_bands(found: Found, flows: Sequence[Flow], runs: Mapping[str, Run]) -> dict[str, Band]:
    """Return the band of each flow, by its key; those in which most hypotheses diverge have none.

    Where no law is all there is, σ12 is that of laws which predict runs left out best, as in a
    closed loop. These need not come nearest in N1 and N2, for which all count that describe the
    runs about as well. Runs are predicted as recorded, other flows for the fluid alone. `runs`: as
    recorded, by name.
    """
    posterior, asked = found.posterior, [flow_run(flow, found, runs) for flow in flows]
    weighed, out = weighed_laws(posterior), {}
    for recorded in (True, False):
        some = [
            (flow, run)
            for flow, run in zip(flows, asked, strict=True)
            if (flow.kind in MEASURED) is recorded
        ]
        if some:
            predictions = Predictions(posterior, Rows.of([run for _, run in some]), recorded)
            of_stress, of_normal = map(predictions.bands, (posterior.predicting_best, weighed))
            for (flow, _), first, others in zip(some, of_stress, of_normal, strict=True):
                if first is not None and others is not None:
                    ends = zip(astuple(first), astuple(others), strict=True)
                    out[flow.key] = Band(*(columns_of(np.c_[a[:, :1], b[:, 1:]]) for a, b in ends))
    return out


def flow_run(flow: Flow, found: Found, runs: Mapping[str, Run]) -> Run:
    """Return the run that a flow asks for; one at hand with its steps placed where they are."""
    run = runs.get(flow.name) if flow.kind in MEASURED else None
    if run is None:
        return run_of(flow)
    placed = [one for one in (*found.task.fitted, *found.task.held_out) if one.name == run.name]
    return replace(run, rate_steps=placed[0].rate_steps) if placed else run


def run_of(flow: Flow) -> Run:
    """Return a flow, with the rate as it was recorded, as a run of which nothing is recorded."""
    return replace(bare_run(flow.protocol, flow.times, flow.name), rate=flow.rate)


def in_flows(
    model: AugmentedModel,
    thetas: Sequence[Float[np.ndarray, " p"]],
    flows: Sequence[Flow],
    runs: Sequence[Run] | None = None,
) -> list[dict[str, Stresses | None]]:
    """Return what vectors of constants predict in each flow, by its key; None where they diverge.

    `runs`: that the flows ask for; by default of the fluid alone.
    """
    if not flows:
        return [{} for _ in thetas]
    runs = list(map(run_of, flows)) if runs is None else runs
    with np.errstate(all="ignore"):
        predicted = model.observables(thetas, make_batch(runs))
    return [
        {
            flow.key: columns_of(rows[: len(flow.times)])
            if np.all(np.isfinite(rows[: len(flow.times), 0]))
            else None
            for flow, rows in zip(flows, of_one, strict=True)
        }
        for of_one in predicted
    ]
