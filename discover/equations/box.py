"""The (Wi, De) box of a set of flows."""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Real

from discover.equations.equation import Box


def flow_numbers(
    times: Real[np.ndarray, " n"],
    shear_rate: Real[np.ndarray, " n"],
    relaxation_time: float,
    frequency: float | None = None,
) -> tuple[float, float]:
    """Return Wi and De of one flow.

    Wi = λ̄ max|γ̇|. De = λ̄ω in oscillation and λ̄/T in a flow of length T that does not oscillate.

    `times`, `shear_rate` in s and 1/s. `relaxation_time`: λ̄ in s. `frequency`: ω in rad/s where
    known; otherwise from the time between changes of sign of the rate.
    """
    length = float(times[-1]) if times[-1] > 0 else 1.0
    if frequency is None:
        flowing = np.abs(shear_rate) > 0
        turned = np.flatnonzero(np.diff(np.sign(shear_rate[flowing])))
        at = times[flowing][turned]
        frequency = 1.0 / length
        if at.size >= 2:
            frequency = np.pi * (at.size - 1) / float(at[-1] - at[0])
    return relaxation_time * float(np.max(np.abs(shear_rate))), relaxation_time * frequency


def box_of(numbers: Iterable[tuple[float, float]]) -> Box | None:
    """Return the smallest box that holds all flows, given by Wi and De; None without flows."""
    pairs = list(numbers)
    if not pairs:
        return None
    weissenberg, deborah = zip(*pairs, strict=True)
    return Box((min(weissenberg), max(weissenberg)), (min(deborah), max(deborah)))
