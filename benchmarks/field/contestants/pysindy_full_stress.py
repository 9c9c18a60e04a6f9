"""pysindy where the whole stress tensor is known: an upper reference, not a rival.

Regression of dσ/dt on Smith's eight tensors and tr(σ) σ, all components in one column, as
`notebooks/full_stress.py` does.
"""

from functools import partial

import numpy as np
import pysindy as ps

from field import Answer, Training
from field.tensor_flow import predict

TITLE = "pysindy on the full stress"
SEES_STRESS = True

TENSORS = {
    "I": lambda s, d: np.broadcast_to(np.eye(3), s.shape),
    "σ": lambda s, d: s,
    "γ̇": lambda s, d: d,
    "σ²": lambda s, d: s @ s,
    "γ̇²": lambda s, d: d @ d,
    "σγ̇+γ̇σ": lambda s, d: s @ d + d @ s,
    "σ²γ̇+γ̇σ²": lambda s, d: s @ s @ d + d @ s @ s,
    "σγ̇²+γ̇²σ": lambda s, d: s @ d @ d + d @ d @ s,
    "tr(σ) σ": lambda s, d: np.trace(s, axis1=-2, axis2=-1)[..., None, None] * s,
}
NAMES = {
    (): "ucm", ("σ²",): "giesekus", ("σγ̇+γ̇σ",): "johnson_segalman", ("tr(σ) σ",): "ptt_linear",
}  # fmt: skip
THRESHOLD = 0.02
"""Of STLSQ, on dimensionless coefficients."""


def learn(training: Training) -> Answer:
    """Return the sparse law by sequentially thresholded least squares."""
    slope = ps.SmoothedFiniteDifference(smoother_kws={"window_length": 11, "polyorder": 3})
    designs, targets = [], []
    for record in training.records:
        time = record.flow.times / training.relaxation_time
        s = record.stress / training.modulus
        gradients = [record.flow.gradient(t) for t in record.flow.times]
        gradient = training.relaxation_time * np.array(gradients)
        d = gradient + gradient.swapaxes(1, 2)
        turned = gradient @ s
        change = slope(s.reshape(len(s), 9), time).reshape(s.shape)
        missing = d + turned + turned.swapaxes(1, 2) - s - change
        rows = _terms(s, d)
        for i, j in ((0, 0), (1, 1), (2, 2), (0, 1)):
            designs.append(rows[:, :, i, j].T)
            targets.append(missing[:, i, j])
    model = ps.STLSQ(threshold=THRESHOLD)
    model.fit(np.vstack(designs), np.concatenate(targets)[:, None])
    coefficients = model.coef_[0]
    kept = [(c, name) for c, name in zip(coefficients, TENSORS, strict=True) if c]

    def law(stress, rate):
        return np.tensordot(coefficients, _terms(stress, rate), 1)

    return Answer(
        partial(predict, law, training),
        NAMES.get(tuple(name for _, name in kept)),
        " + ".join(f"{c:.3g} {name}" for c, name in kept),
    )


def _terms(stress, rate) -> np.ndarray:
    return np.array([tensor(stress, rate) for tensor in TENSORS.values()])
