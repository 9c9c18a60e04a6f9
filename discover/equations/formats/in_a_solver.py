"""Limits of a law in a flow solver: longest stable step, and positivity of the conformation."""

from collections.abc import Callable
from itertools import count
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.integrate import solve_ivp

from discover.equations.equation import Equation
from discover.laws.base import AbstractConstitutiveLaw

_PERIODS, _SAMPLES = 3.0, 200
_MOST_EVALUATIONS = 40_000  # some five seconds; a law of ten modes takes about 20,000
_TRUE_RATE = 1e-6  # of what decays, over 1/λ: slower than this nothing limits a step


class InASolver(NamedTuple):
    """Extremes over the edge of a law's box."""

    weissenberg: float  # largest Wi of the box, at which the flows were
    # of the conformation, I + σ_k/G_k (of chains that end, I + σ_k/(k G_k)); NaN if it diverged
    smallest_eigenvalue: float
    of_mode: int  # from 1
    # stable with explicit Euler for the stress of a mode, in s; infinite where nothing decays
    largest_step: float
    limiting_mode: int

    @property
    def text(self) -> str:
        """Limits in one sentence."""
        flows = f"At Wi {self.weissenberg:.3g}, the edge of the box, in start-up and oscillation"
        if not np.isfinite(self.smallest_eigenvalue):
            return f"{flows} of shear, mode {self.of_mode} diverges."
        lost = "" if self.smallest_eigenvalue > 0.0 else ", no conformation any more"
        smallest = f"{self.smallest_eigenvalue:.3g}{lost} (mode {self.of_mode})"
        step = f"{self.largest_step:.3g} s (mode {self.limiting_mode})"
        return (
            f"{flows} of shear: smallest eigenvalue of the conformation {smallest}; explicit Euler "
            f"of the stress alone is stable up to {step}."
        )


NOT_CHECKED = (
    "How long the steps of a solver may be, and whether the conformation stays positive, was not "
    f"checked: more than {_MOST_EVALUATIONS} evaluations of the law would have been needed."
)


class _Spent(Exception):
    """The evaluations that a check may take are used up."""


def in_a_solver(equation: Equation) -> InASolver | str | None:
    """Return how a law behaves at the edge of the box in which it was learned.

    A sentence where that takes too long; None without a box, or with a state. A step is stable
    where |1 + Δt μ| ≤ 1 for every decaying eigenvalue μ of the linearised stress equation.
    """
    if equation.tested is None or equation.states:
        return None
    mean, box = equation.mean_relaxation_time, equation.tested.learned_in
    amplitude = box.weissenberg[1] / mean
    evaluations = count()
    eigenvalues, steps = [], []
    for k, time in enumerate(equation.relaxation_time):
        law = equation.mode(k).law()
        flows = [(0.0, 10.0 * max(1.0, mean / time))]
        for deborah in dict.fromkeys(box.deborah):
            frequency = deborah / mean * time
            if frequency <= 0.0:  # start-up alone
                continue
            flows.append((frequency, _PERIODS * 2.0 * np.pi / frequency))
        try:
            found = [_extremes(law, time * amplitude, *flow, evaluations) for flow in flows]
        except _Spent:
            return NOT_CHECKED
        lowest, longest = np.transpose(found)
        eigenvalues.append(lowest.min())
        steps.append(time * longest.min())
    worst = int(np.argmin(eigenvalues))  # a NaN counts as the least
    limiting = int(np.argmin(steps))
    smallest, largest = float(eigenvalues[worst]), float(steps[limiting])
    return InASolver(box.weissenberg[1], smallest, worst + 1, largest, limiting + 1)


@jax.jit
def _rate(law: AbstractConstitutiveLaw, stress: Float[Array, " s"], shear_rate: Float[Array, ""]):
    return law.stress_rate(stress, shear_rate)


_conformations: Callable = jax.jit(
    jax.vmap(lambda law, stress: law.conformation(stress), in_axes=(None, 0))
)
_jacobians: Callable = jax.jit(jax.vmap(jax.jacfwd(_rate, argnums=1), in_axes=(None, 0, 0)))


def _extremes(
    law: AbstractConstitutiveLaw, amplitude: float, frequency: float, end: float, evaluations: count
) -> tuple[float, float]:
    """Return the smallest eigenvalue of A and the longest step; NaN if σ diverges."""
    times = np.linspace(0.0, end, _SAMPLES)

    def rate_at(t):
        return amplitude * np.cos(frequency * t)

    def change(t, y):
        if next(evaluations) >= _MOST_EVALUATIONS:
            raise _Spent
        # arrays of NumPy: a program takes them as they are, sooner than they are made JAX's
        return np.asarray(_rate(law, y, np.asarray(rate_at(t))))

    found = solve_ivp(
        change, (0.0, end), np.asarray(law.rest()), "LSODA", times, rtol=1e-6, atol=1e-9,
    )  # fmt: skip
    if not found.success or not np.all(np.isfinite(found.y)):
        return np.nan, np.inf
    a11, a22, a33, a12 = np.asarray(_conformations(law, jnp.asarray(found.y[:4].T))).T
    in_plane = 0.5 * (a11 + a22) - np.hypot(0.5 * (a11 - a22), a12)
    rates = rate_at(times)
    jacobians = np.asarray(_jacobians(law, jnp.asarray(found.y.T), rates))
    if not np.all(np.isfinite(jacobians)):
        return np.nan, np.inf
    mu = np.linalg.eigvals(jacobians)
    decaying = mu[mu.real < -_TRUE_RATE]
    steps = -2.0 * decaying.real / np.abs(decaying) ** 2
    return float(min(in_plane.min(), a33.min())), float(steps.min(initial=np.inf))
