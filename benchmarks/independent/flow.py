"""Shear flows: the shear rate and the strain as functions of time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

Function = Callable[[ArrayLike], np.ndarray]


@dataclass(frozen=True)
class Flow:
    """Simple shear from rest at t = 0.

    `rate`, `strain`: γ̇ in 1/s and γ = ∫γ̇ dt since t = 0, of time in s; both take arrays. At a
        jump the rate is that after it.
    `jumps`: times at which the rate jumps, in s.
    """

    rate: Function
    strain: Function
    jumps: tuple[float, ...] = ()


def start_up(rate: float) -> Flow:
    """Return the constant shear rate in 1/s."""
    return Flow(lambda t: np.full(np.shape(t), float(rate)), lambda t: rate * np.asarray(t, float))


def oscillation(amplitude: float, frequency: float, phase: float = 0.0) -> Flow:
    """Return γ̇ = amplitude · cos(frequency · t + phase), in 1/s, rad/s and rad."""

    def strain(t):
        return amplitude / frequency * (np.sin(frequency * np.asarray(t) + phase) - np.sin(phase))

    return Flow(lambda t: amplitude * np.cos(frequency * np.asarray(t) + phase), strain)


def steps(times: Sequence[float], rates: Sequence[float]) -> Flow:
    """Return rates that are constant from each of the times on; the first time is 0."""
    starts, values = np.asarray(times, float), np.asarray(rates, float)
    if starts[0] != 0.0 or np.any(np.diff(starts) <= 0):
        raise ValueError(f"times must start at 0 and increase; got {list(times)}.")
    before = np.concatenate([[0.0], np.cumsum(np.diff(starts) * values[:-1])])

    def place(t):
        return np.maximum(np.searchsorted(starts, t, side="right") - 1, 0)

    return Flow(
        lambda t: values[place(t)],
        lambda t: before[place(t)] + values[place(t)] * (np.asarray(t, float) - starts[place(t)]),
        tuple(starts[1:]),
    )


def step_strain(strain: float, duration: float) -> Flow:
    """Return a strain put on at constant rate over a duration in s, and rest after it."""
    return steps([0.0, duration], [strain / duration, 0.0])


def of_rate(rate: Function, end: float, points: int = 20_001) -> Flow:
    """Return the flow of any smooth rate; its strain is summed by Simpson's rule up to `end`."""
    from scipy.integrate import cumulative_simpson

    grid = np.linspace(0.0, end, points)
    table = cumulative_simpson(np.asarray(rate(grid), float), x=grid, initial=0.0)
    return Flow(rate, lambda t: np.interp(np.asarray(t, float), grid, table))
