"""First-order lag of a sampled signal."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def first_order_lag(
    times: Float[Array, " n"], values: Float[Array, " n"], time_constant: Float[Array, ""]
) -> Float[Array, " n"]:
    """Return y with τ y' + y = x, y = 0 at the first time; exact for x linear between times.

    Parameters
    ----------
    times
        In s, increasing.
    values
        x at those times.
    time_constant
        τ in s; at zero, y = x (also at the first time).
    """
    active = time_constant > 0.0
    safe = jnp.where(active, time_constant, 1.0)
    step = jnp.diff(times) / safe
    decay = jnp.exp(-step)
    # weights of the two ends of an interval: ∫ e^{-(h-s)} (linear) ds
    mean = -jnp.expm1(-step) / step
    forcing = values[1:] * (1.0 - mean) + values[:-1] * (mean - decay)

    def join(first, second):
        return first[0] * second[0], first[1] * second[0] + second[1]

    _, lagged = jax.lax.associative_scan(join, (decay, forcing))
    lagged = jnp.concatenate([jnp.zeros(1), lagged])
    return jnp.where(active, lagged, values)
