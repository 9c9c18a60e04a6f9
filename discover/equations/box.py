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

    Parameters
    ----------
    times, shear_rate
        In s and 1/s.
    relaxation_time
        λ̄ in s.
    frequency
        ω in rad/s where known; otherwise from the changes of sign of the rate, at least three.
    """
    length = float(times[-1]) if times[-1] > 0 else 1.0
    if frequency is None:
        signs = np.sign(shear_rate[np.abs(shear_rate) > 0])
        changes = int(np.count_nonzero(np.diff(signs)))
        frequency = np.pi * changes / length if changes >= 3 else 1.0 / length
    return relaxation_time * float(np.max(np.abs(shear_rate))), relaxation_time * float(frequency)


def box_of(numbers: Iterable[tuple[float, float]]) -> Box | None:
    """Return the smallest box that holds all flows, given by Wi and De; None without flows."""
    pairs = list(numbers)
    if not pairs:
        return None
    weissenberg, deborah = zip(*pairs, strict=True)
    return Box((min(weissenberg), max(weissenberg)), (min(deborah), max(deborah)))
