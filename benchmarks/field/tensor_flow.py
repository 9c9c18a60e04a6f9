"""A tensor law that a contestant found, taken through a flow by scipy."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from field.contract import Flow, Training

TensorLaw = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""h(σ, γ̇) of λ σ▽ + σ + h = λ G γ̇, from (3, 3) stress over modulus and (3, 3) λ(L + Lᵀ)."""


def predict(law: TensorLaw, training: Training, flow: Flow, rtol: float = 1e-6) -> dict:
    """Return the stresses of a law in a flow from rest, in Pa.

    Raises ArithmeticError if its stress runs away.
    """
    unit = training.relaxation_time

    def change(time, state):
        stress, gradient = state.reshape(3, 3), unit * flow.gradient(time * unit)
        turned = gradient @ stress
        rate = gradient + gradient.T
        return (rate + turned + turned.T - stress - law(stress, rate)).ravel()

    times = flow.times / unit
    too_far = _too_far()
    with np.errstate(all="ignore"):
        found = solve_ivp(
            change, (0.0, times[-1]), np.zeros(9), "LSODA", times, events=too_far, rtol=rtol,
            atol=1e-3 * rtol,
        )  # fmt: skip
    if found.status != 0:
        raise ArithmeticError("the stress runs away")
    s = training.modulus * found.y.reshape(3, 3, -1)
    if flow.kind == "uniaxial":
        return {"tensile": s[0, 0] - s[1, 1]}
    return {"sigma12": s[0, 1], "N1": s[0, 0] - s[1, 1], "N2": s[1, 1] - s[2, 2]}


def _too_far():
    def event(time, state):
        del time
        return 1e6 - np.max(np.abs(state))

    event.terminal = True
    return event
