"""Weights of a step that treats linear relaxation exactly."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

_TAYLOR_TERMS = 14

Numbers = Float[Array | np.ndarray, " ..."]


def phi_functions(z: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Return φ₁, φ₂, φ₃ with φ₁(z) = (eᶻ − 1)/z and φₖ₊₁(z) = (φₖ(z) − 1/k!)/z.

    The recurrence loses digits near zero, so a Taylor series serves there: its remainder at |z| = 1
    is below 1e-15, and the recurrence loses less than three digits beyond.
    """
    of: Any = np if isinstance(z, np.ndarray) else jnp
    small = of.abs(z) < 1.0
    safe = of.where(small, 1.0, z)
    first = of.expm1(safe) / safe
    second = (first - 1.0) / safe
    third = (second - 0.5) / safe
    near = of.where(small, z, 0.0)
    series = of.zeros_like(z)
    factorial = [1.0]
    for n in range(1, _TAYLOR_TERMS + 4):
        factorial.append(factorial[-1] * n)
    for n in reversed(range(_TAYLOR_TERMS)):
        series = series * near + 1.0 / factorial[n + 3]
    series_second = 0.5 + near * series
    series_first = 1.0 + near * series_second
    return (
        of.where(small, series_first, first),
        of.where(small, series_second, second),
        of.where(small, series, third),
    )


def with_shares(state, shares, factor: float, axis: int):
    """Return states whose first tensor has shares of the further ones more, times a factor.

    `state`: components along `axis`: four of each tensor, and what stands behind. `shares`: of each
    further tensor, or of each and each mode; None for none. `factor`: 1, or −1 to undo it.
    """
    if shares is None or not len(shares):
        return state
    moved = jnp.moveaxis(state, axis, 0)
    for i, share in enumerate(shares, start=1):
        moved = moved.at[:4].add(factor * share * moved[4 * i : 4 * i + 4])
    return jnp.moveaxis(moved, 0, axis)


class KrogstadWeights(NamedTuple):
    """What one step of Krogstad's method multiplies state and remainders with.

    The stages are Y2 = half y + a21 N1, Y3 = half y + a31 N1 + a32 N2 and Y4 = full y + a41 N1 +
    a43 N3, the new state is full y + b1 N1 + b23 (N2 + N3) + b4 N4, and N is f + decay · Y. A
    parabola through N1, the mean of N2 and N3, and N4 gives the state in the middle, with m4 the
    weight of N4.
    """

    half: Numbers
    full: Numbers
    a21: Numbers
    a31: Numbers
    a32: Numbers
    a41: Numbers
    a43: Numbers
    b1: Numbers
    b23: Numbers
    b4: Numbers
    m4: Numbers

    def second(self, y, n1):
        """Return Y2, of the state and the remainder there; shapes that broadcast, as below."""
        return self.half * y + self.a21 * n1

    def third(self, y, n1, n2):
        """Return Y3."""
        return self.half * y + self.a31 * n1 + self.a32 * n2

    def fourth(self, y, n1, n3):
        """Return Y4."""
        return self.full * y + self.a41 * n1 + self.a43 * n3

    def end(self, y, n1, n2, n3, n4):
        """Return the state after the step."""
        return self.full * y + self.b1 * n1 + self.b23 * (n2 + n3) + self.b4 * n4

    def middle(self, y, n1, n2, n3, n4):
        """Return the state in the middle of the step, as exact as that after it."""
        m1 = self.a21 - 0.5 * self.a32 + self.m4
        m23 = 0.25 * self.a32 - self.m4
        return self.half * y + m1 * n1 + m23 * (n2 + n3) + self.m4 * n4


class StressWeights(NamedTuple):
    """The same for stresses of modes, (4, k), whose trace may relax faster than the rest.

    `trace`, `faster`: weights of the trace and by how much it relaxes faster, over 1/λ; None where
    it does not. `beside`: the same of each further tensor, with by how much it relaxes faster than
    −1. `shares`: what σ has of each of these.
    """

    whole: KrogstadWeights  # weights of each mode
    trace: KrogstadWeights | None = None
    faster: Float[Array, " k"] | float = 0.0
    beside: tuple[tuple["StressWeights", Float[Array, " k"]], ...] = ()
    shares: Float[Array, "tensors k"] | None = None

    @classmethod
    def of_kinds(cls, kinds: Any, relaxations: Any, shares: Any) -> "StressWeights":
        """Return weights told as `Dynamics.weights` does: of the whole, its trace, and so on.

        `relaxations`, `shares`: of each tensor, as `Dynamics` has them.
        """
        if relaxations is None:
            return cls(KrogstadWeights(*kinds[0]))
        whole, trace, *others = (KrogstadWeights(*one) for one in kinds)
        beside = tuple(
            (cls(others[2 * i], others[2 * i + 1], one[1]), one[0])
            for i, one in enumerate(relaxations[1:])
        )
        return cls(whole, trace, relaxations[0, 1], beside, shares)

    def remainder(self, stress, change, decay: float):
        """Return what of a change is not relaxation at the rates of these weights."""
        stress, change = (with_shares(one, self.shares, -1.0, axis=0) for one in (stress, change))
        if decay:
            change = change + decay * stress
        if self.trace is not None:
            change = change.at[:3].add(self.faster * _mean_normal(stress))
        for i, (own, faster) in enumerate(self.beside, start=1):
            at = slice(4 * i, 4 * i + 4)
            left = own.remainder(stress[at], change[at] + faster * stress[at], 0.0)
            change = change.at[at].set(left)
        return with_shares(change, self.shares, 1.0, axis=0)

    def step(
        self,
        stress: Float[Array, "s ..."],
        remainder: Callable[[Float[Array, "s ..."], Any], Float[Array, "s ..."]],
        rates: Sequence[Any],
    ) -> tuple[Float[Array, "s ..."], tuple[Float[Array, "s ..."], ...]]:
        """Return the stress after a step, and the remainders of its stages.

        `remainder`: of stress and rate, see there. `rates`: felt in each of the four stages.
        """
        n1 = remainder(stress, rates[0])
        n2 = remainder(self.second(stress, n1), rates[1])
        n3 = remainder(self.third(stress, n1, n2), rates[2])
        n4 = remainder(self.fourth(stress, n1, n3), rates[3])
        return self.end(stress, n1, n2, n3, n4), (n1, n2, n3, n4)

    def along_a_line(self, stress, remainder, middle, last):
        """Return the stress in the middle of a step and after it, by the rates there."""
        rates = (2.0 * middle - last, middle, middle, last)
        after, remainders = self.step(stress, remainder, rates)
        return self.middle(stress, *remainders), after

    def second(self, y, n1):
        """Return Y2, as `KrogstadWeights` does."""
        return self._applied("second", y, n1)

    def third(self, y, n1, n2):
        """Return Y3."""
        return self._applied("third", y, n1, n2)

    def fourth(self, y, n1, n3):
        """Return Y4."""
        return self._applied("fourth", y, n1, n3)

    def end(self, y, n1, n2, n3, n4):
        """Return the state after the step."""
        return self._applied("end", y, n1, n2, n3, n4)

    def middle(self, y, n1, n2, n3, n4):
        """Return the state in the middle of the step."""
        return self._applied("middle", y, n1, n2, n3, n4)

    def _applied(self, stage: str, *parts):
        parts = [with_shares(part, self.shares, -1.0, axis=0) for part in parts]
        found = getattr(self.whole, stage)(*parts)
        if self.trace is not None:
            means = [_mean_normal(part) for part in parts]
            apart = getattr(self.trace, stage)(*means) - getattr(self.whole, stage)(*means)
            found = found.at[:3].add(apart)
        for i, (own, _) in enumerate(self.beside, start=1):
            at = slice(4 * i, 4 * i + 4)
            found = found.at[at].set(getattr(own, stage)(*(part[at] for part in parts)))
        return with_shares(found, self.shares, 1.0, axis=0)


def _mean_normal(stress: Float[Array, " s *c"]) -> Float[Array, " *c"]:
    return jnp.sum(stress[:3], axis=0) / 3.0


def krogstad_weights(z: Numbers, step: Numbers) -> KrogstadWeights:
    """Return the weights of a step   [Krogstad 2005, JCP 203, 72].

    `z`: minus the decay over the step. `step`: its length, in the unit of time of the remainders.
    """
    half_first, half_second, half_third = phi_functions(0.5 * z)
    # those of z follow from those of its half   [Skaflestad & Wright 2009, Appl. Numer. Math. 59,
    # 783]: sums of positive numbers, which lose no digit
    half = np.exp(0.5 * z) if isinstance(z, np.ndarray) else jnp.exp(0.5 * z)
    first = 0.5 * (half + 1.0) * half_first
    second = 0.25 * (half_first * half_first + 2.0 * half_second)
    third = 0.125 * (half_first * half_second + half_second + 2.0 * half_third)
    return KrogstadWeights(
        half=half,
        full=half * half,
        a21=0.5 * step * half_first,
        a31=step * (0.5 * half_first - half_second),
        a32=step * half_second,
        a41=step * (first - 2.0 * second),
        a43=2.0 * step * second,
        b1=step * (first - 3.0 * second + 4.0 * third),
        b23=step * (2.0 * second - 4.0 * third),
        b4=step * (4.0 * third - second),
        m4=step * (0.5 * half_third - 0.25 * half_second),
    )


def relax(
    source: Float[Array, "*levels"],
    decay: Float[Array, "*levels"],
    state: Float[Array, "*levels"],
    width: Float[Array, ""],
) -> Float[Array, "*levels"]:
    """Return s after a step of ds/dt = source − decay · s with both of them constant, exactly."""
    z = -decay * width
    grown, still = jnp.expm1(z), z == 0.0
    return (
        state
        + grown * state
        + source * width * jnp.where(still, 1.0, grown / jnp.where(still, 1.0, z))
    )
