"""Classical Runge–Kutta steps through given times, for laws of one relaxation time.

To compare such laws needs no spectrum and no adjoint, and a plain scan compiles in a fraction of
the time of a solver made for both.
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from discover.laws.base import AbstractConstitutiveLaw


def longest_step(law: AbstractConstitutiveLaw) -> float:
    """Return the longest step, over λ, in which these steps follow chains that retract.

    Other laws relax in λ, in which any step of the flow's length is short enough.
    """
    if not law.retracts:
        return np.inf
    return 1.0 / (1.0 + float(jnp.max(jnp.sum(law.relaxations(), axis=1))))


def runge_kutta_4(
    slope: Callable[[Float[Array, ""], Any], Any], start: PyTree, times: Float[Array, " s"]
) -> PyTree:
    """Return the solution of dy/dt = slope(t, y) at every time, stacked along a new first axis.

    Parameters
    ----------
    slope
        Of any state that is a tree of arrays.
    start
        The state at the first time.
    times
        Increasing; one fourth-order step is made from each to the next   [Kutta 1901].
    """

    def moved(state, change, factor):
        return jax.tree.map(lambda s, c: s + factor * c, state, change)

    def advance(state, interval):
        t, h = interval
        k1 = slope(t, state)
        k2 = slope(t + 0.5 * h, moved(state, k1, 0.5 * h))
        k3 = slope(t + 0.5 * h, moved(state, k2, 0.5 * h))
        k4 = slope(t + h, moved(state, k3, h))
        mean = jax.tree.map(lambda a, b, c, d: (a + 2.0 * b + 2.0 * c + d) / 6.0, k1, k2, k3, k4)
        after = moved(state, mean, h)
        return after, after

    _, after = jax.lax.scan(advance, start, (times[:-1], jnp.diff(times)))
    return jax.tree.map(lambda first, rest: jnp.concatenate([first[None], rest]), start, after)
