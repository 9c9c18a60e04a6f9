"""What every simulated material answers: its stresses in a shear flow from rest."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from independent.flow import Flow

Rate = float | np.ndarray
"""Shear rate in 1/s, or a whole velocity gradient L in 1/s, shape (3, 3), of any flow."""

TOLERANCE = 1e-9
"""Tolerance of the integrator, relative, and absolute in the scale of each state."""


@dataclass(frozen=True)
class Stresses:
    """Shear stress and normal stress differences in Pa, each of the shape of the times."""

    sigma12: np.ndarray
    N1: np.ndarray
    N2: np.ndarray

    def __add__(self, other: "Stresses") -> "Stresses":
        return Stresses(self.sigma12 + other.sigma12, self.N1 + other.N1, self.N2 + other.N2)


class Material(ABC):
    """Anything that has stresses in a shear flow."""

    @abstractmethod
    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stresses in a flow from rest, at increasing times in s from 0 on."""


class RateLaw(Material):
    """A material whose state obeys an ordinary differential equation in time.

    Written for the full stress tensor, in Pa and s; integrated by `scipy.integrate.solve_ivp` with
    the method of order 8 of Hairer, Nørsett & Wanner 1993 (DOP853), from jump to jump.
    """

    modulus: float

    @abstractmethod
    def rest(self) -> np.ndarray:
        """Return the state at rest, shape (m,)."""

    def scale(self) -> np.ndarray:
        return np.ones(len(self.rest()))

    @abstractmethod
    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return the time derivative of the state at a rate, shape (m,)."""

    @abstractmethod
    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        """Return the extra stress tensor in Pa, shape (3, 3)."""

    def respond(self, flow: Flow, times: np.ndarray) -> Stresses:
        """Return the stresses in a flow from rest; see `Material.respond`."""
        times = np.asarray(times, float)
        rates = np.asarray(flow.rate(times), float)

        def change(t, state):
            return self.change(state, float(flow.rate(t)))

        states = integrate(change, self.rest(), times, flow.jumps, self.scale())
        return differences(
            [self.stress(state, rate) for state, rate in zip(states, rates, strict=True)]
        )

    def pull(self, rate: float, times: np.ndarray) -> np.ndarray:
        """Return σ11 − σ22 in Pa in uniaxial extension from rest at a Hencky rate in 1/s."""
        gradient = rate * np.diag([1.0, -0.5, -0.5])
        states = integrate(
            lambda _, state: self.change(state, gradient),
            self.rest(),
            np.asarray(times, float),
            scale=self.scale(),
        )
        return differences([self.stress(state, gradient) for state in states]).N1

    def held(self, gradient: Rate, times: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
        """Return σ in Pa, shape (n, 3, 3), from rest in a flow that is held; Radau, for the stiff.

        `gradient`: shear rate or velocity gradient in 1/s. `times` in s, after 0.
        """
        found = solve_ivp(
            lambda _, state: self.change(state, gradient), (0.0, times[-1]), self.rest(), "Radau",
            times, rtol=tolerance, atol=0.01 * tolerance * self.scale(),
        )  # fmt: skip
        return np.array([self.stress(state, gradient) for state in found.y.T])


def integrate(
    change, start: np.ndarray, times: np.ndarray, jumps=(), scale: float | np.ndarray = 1.0
) -> np.ndarray:
    """Return the states at the times, shape (n, m), from a start at t = 0.

    Raises ValueError if the integrator gives up: the state runs away.
    """
    end = float(times[-1])
    knots = [0.0, *(j for j in jumps if 0.0 < j < end), end]
    states, state = np.empty((len(times), len(start))), np.asarray(start, float)
    states[times <= 0.0] = state
    for low, high in pairwise(knots):
        # an open end, so that the rate inside a piece is never that after the jump
        inside = (times > low) & (times <= high)
        short = np.nextafter(high, low) if high in jumps else high
        solution = solve_ivp(
            lambda t, y, short=short: change(min(t, short), y), (low, high), state, method="DOP853",
            t_eval=np.unique(np.append(times[inside], high)), rtol=TOLERANCE,
            atol=TOLERANCE * scale,
        )  # fmt: skip
        if not solution.success:
            raise ValueError(
                f"The integration stopped at {low:g} to {high:g} s: {solution.message}"
            )
        states[inside] = solution.y.T[: np.count_nonzero(inside)]
        state = solution.y[:, -1]
    return states


def differences(tensors: Sequence[np.ndarray]) -> Stresses:
    """Return σ12, N1 = σ11 − σ22 and N2 = σ22 − σ33 of stress tensors, shape (n, 3, 3)."""
    s = np.asarray(tensors, float)
    return Stresses(s[:, 0, 1], s[:, 0, 0] - s[:, 1, 1], s[:, 1, 1] - s[:, 2, 2])


def velocity_gradient(rate: Rate) -> np.ndarray:
    """Return L, shape (3, 3); of a shear rate, L_12 = γ̇."""
    if not isinstance(rate, float) and np.ndim(rate):
        return np.asarray(rate)
    gradient = np.zeros((3, 3))
    gradient[0, 1] = rate
    return gradient


def stretched(tensor: np.ndarray, rate: Rate) -> np.ndarray:
    """Return L·T + T·Lᵀ of a symmetric T, shape (3, 3), or of many, shape (..., 3, 3)."""
    if isinstance(rate, float):  # asked some hundred thousand times: L has one entry
        turned = np.zeros_like(tensor)
        turned[..., 0, :] = rate * tensor[..., 1, :]
    else:
        turned = velocity_gradient(rate) @ tensor
    return turned + turned.swapaxes(-1, -2)


def rate_tensor(rate: Rate) -> np.ndarray:
    """Return L + Lᵀ, shape (3, 3)."""
    gradient = velocity_gradient(rate)
    return gradient + gradient.T


class StressLaw(RateLaw):
    """A rate law whose state is the extra stress tensor itself, nine numbers in Pa."""

    def rest(self) -> np.ndarray:
        return np.zeros(9)

    def scale(self) -> np.ndarray:
        return np.full(9, self.modulus)

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return self.stress_change(state.reshape(3, 3), rate).ravel()

    @abstractmethod
    def stress_change(self, stress: np.ndarray, rate: Rate) -> np.ndarray:
        """Return dσ/dt in Pa/s, shape (3, 3)."""

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        return state.reshape(3, 3)


class Modes(RateLaw):
    """Several rate laws side by side in one flow; their stresses add up."""

    def __init__(self, *laws: RateLaw):
        self.laws = laws
        self.modulus = sum(law.modulus for law in laws)
        ends = np.cumsum([0, *(len(law.rest()) for law in laws)]).tolist()
        self._places = [slice(*both) for both in pairwise(ends)]

    def rest(self) -> np.ndarray:
        return np.concatenate([law.rest() for law in self.laws])

    def scale(self) -> np.ndarray:
        return np.concatenate([law.scale() for law in self.laws])

    def change(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        places = zip(self.laws, self._places, strict=True)
        changes = [law.change(state[place], rate) for law, place in places]
        return np.concatenate(changes)

    def stress(self, state: np.ndarray, rate: Rate) -> np.ndarray:
        places = zip(self.laws, self._places, strict=True)
        tensors = [law.stress(state[place], rate) for law, place in places]
        return np.sum(tensors, axis=0)
