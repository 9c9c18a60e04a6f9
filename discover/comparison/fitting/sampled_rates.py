"""What a misfit may owe to a rate that is known at the samples only."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.outcomes.flows import Flow, Stresses, predict
from discover.laws.multimode import Fluid
from discover.protocols import another_between_samples

LARGEST = 5e-3
"""A larger relative misfit is not put down to arithmetic, as in the closed loop: a rate read 24
times a cycle errs by this."""


def left_by_sampled_rates(
    fluid: Fluid, flows: Sequence[Flow], predictions: Mapping[str, Stresses | None]
) -> float:
    """Return the relative misfit of σ12 that the rate between the samples may leave.

    The root-mean-square change of the prediction where the rate is another curve through its
    samples, over that of the measurement, mean over the training runs. Zero
    where the rate was commanded, and where the misfit is too large to be put down to it.

    Parameters
    ----------
    fluid
        The law found.
    flows
        The flows of the comparison.
    predictions
        Of the fluid, by the key of the flow.
    """
    misfits, changes = [], []
    for flow in flows:
        measured, prediction = flow.measured, predictions[flow.key]
        if flow.kind != "training" or measured is None:
            continue
        if prediction is None or not np.any(measured):
            return 0.0
        misfits.append(_relative(prediction["sigma12"] - measured, measured))
    if not misfits or float(np.mean(misfits)) > LARGEST:
        return 0.0
    for flow in flows:
        measured, prediction = flow.measured, predictions[flow.key]
        if flow.kind != "training" or measured is None or prediction is None:
            continue
        smooth = another_between_samples(flow.protocol, flow.times)
        other = None if smooth is None else predict(fluid, replace(flow, protocol=smooth))
        change = 0.0
        if other is not None:
            change = _relative(other["sigma12"] - prediction["sigma12"], measured)
        changes.append(change)
    return float(np.mean(changes))


def _relative(difference: np.ndarray, measured: np.ndarray) -> float:
    return float(np.sqrt(np.mean(difference**2) / np.mean(measured**2)))
