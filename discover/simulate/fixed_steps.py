"""Steps of a diffrax solver through given times, in a plain scan.

`diffrax.diffeqsolve` may adapt, stop, interpolate and differentiate in several ways; on a grid that
is known beforehand nothing of this is wanted, and to trace and compile it takes three times as long
for the same numbers.
"""

from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree


def fixed_steps(
    vector_field: Callable[[Any, Any, Any], Any],
    solver: diffrax.AbstractSolver,
    times: Float[Array, " s"],
    start: Any,
    args: Any,
    observe: Callable[[Any, Any, Any], PyTree] | None = None,
) -> PyTree:
    """Return what is observed at every time, stacked along a new first axis.

    Made to be transformed: `jax.vmap`, `jax.jvp`; reverse mode keeps every step in memory.

    Parameters
    ----------
    vector_field
        dy/dt = f(t, y, args).
    solver
        Makes one step from each time to the next.
    times
        Increasing.
    start
        y at the first time.
    args
        Handed on.
    observe
        Of (t, y, args); y itself by default.
    """
    seen = observe or (lambda t, y, args: y)
    term = diffrax.ODETerm(vector_field)

    def step(carry, interval):
        y, memory = carry
        t0, t1 = interval
        after, _, _, memory, _ = solver.step(term, t0, t1, y, args, memory, made_jump=False)
        return (after, memory), seen(t1, after, args)

    memory = solver.init(term, times[0], times[1], start, args)
    _, later = jax.lax.scan(step, (start, memory), (times[:-1], times[1:]))
    return jax.tree.map(
        lambda first, rest: jnp.concatenate([first[None], rest]), seen(times[0], start, args), later
    )
