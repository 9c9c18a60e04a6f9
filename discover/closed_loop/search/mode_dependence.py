"""Constants of a law that differ from mode to mode, to be held against names that were found.

A declared law has the same constants in every mode, and real fluids do not: what that leaves of the
data looks like a little of many effects. It is no candidate, since it names no mechanism; but a
name that is not needed once it is allowed is no finding.
"""

from collections.abc import Sequence

import numpy as np

from discover.closed_loop.search.evidence import INDISTINGUISHABLE, evidence
from discover.effects import ModeDependence
from discover.forward import AugmentedModel, Batch
from discover.forward.least_squares import NO_PRIOR, Fit, Prior, fit_batch
from discover.statistics.residual import summarise

_STARTS = (-0.5, 0.5)


def names_not_needed(
    model: AugmentedModel,
    batch: Batch,
    fit: Fit,
    names: Sequence[str],
    prior: Prior = NO_PRIOR,
) -> tuple[str, ...]:
    """Return the effects without which the data are explained as well, by constants by mode.

    Each is left out alone, and with all that came after it; the exponent of the modes is then
    fitted in their place. They are not needed if the evidence for them over it is not strong
    (`INDISTINGUISHABLE`).

    Parameters
    ----------
    model
        With a `ModeDependence` among its effects; without one nothing is said.
    batch, fit
        The fitted runs, and the fit.
    names
        Effects that may go, in the order in which they came.
    prior
        What is known of some parameters.
    """
    by_mode = next((e for e in model.effects if isinstance(e, ModeDependence)), None)
    if by_mode is None or not names:
        return ()
    groups = list(dict.fromkeys([*(tuple(names[i:]) for i in range(len(names))), *zip(names)]))
    at = model.positions(by_mode.name)
    starts, free, owners = [], [], []
    for group in groups:
        gone = [p for name in group for p in (*model.positions(name), *model.varying(name))]
        for exponent in _STARTS:
            theta = fit.theta.copy()
            theta[gone] = model.zero()[gone]
            theta[at] = exponent
            starts.append(theta)
            free.append((*(p for p in fit.free if p not in gone), *at))
            owners.append(group)
    rivals = fit_batch(model, batch, starts, free, prior=prior, rivals=True)
    effective = summarise(fit.residual, np.asarray(batch.weight)).effective_samples
    enough = [
        group
        for group, rival in zip(owners, rivals, strict=True)
        if rival.usable
        # both were fitted here, and neither pays for a choice among many
        and evidence(rival, fit, np.asarray(batch.weight), effective, 1) <= INDISTINGUISHABLE
    ]
    return max(enough, key=len, default=())
