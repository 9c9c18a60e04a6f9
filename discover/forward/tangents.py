"""Derivatives of a law by many numbers at once."""

from collections.abc import Callable
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.custom_derivatives import SymbolicZero
from jaxtyping import Array, Float

from tensor_library.algebra import VelocityGradient


def with_cheap_tangents(
    stress_rate: Callable[[Any, Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]],
    given: Any,
) -> Callable[[Any, Float[Array, " s"], VelocityGradient], Float[Array, " s"]]:
    """Return the rate of a law whose tangents cost little, however many there are.

    Four pullbacks give the derivatives by stress, rate and every number of the law at once; each
    tangent is then a small matrix product. `stress_rate`: of `given` (not differentiated), of a
    tree of numbers, of σ and of λL.
    """
    # what is traced has to be handed in: a rule for derivatives must not close over it
    arrays, rest = eqx.partition(given, eqx.is_array)

    def of_all(arrays, numbers, stress, gradient):
        return stress_rate(eqx.combine(arrays, rest), numbers, stress, gradient)

    rate = jax.custom_jvp(of_all)

    def tangent(primals, tangents):
        arrays, *moving = primals
        still = [isinstance(leaf, SymbolicZero) for leaf in jax.tree.leaves(tangents[1])]
        if all(still):
            # few tangents, of the state or of the rate, are carried through the law
            flow = [
                jnp.zeros_like(value) if isinstance(moved, SymbolicZero) else moved
                for value, moved in zip(moving[1:], tangents[2:], strict=True)
            ]
            return jax.jvp(partial(of_all, arrays, moving[0]), tuple(moving[1:]), tuple(flow))
        value, pull = jax.vjp(partial(of_all, arrays), *moving)
        rows = jax.vmap(pull)(jnp.eye(value.shape[0]))
        total = jnp.zeros_like(value)
        pairs = zip(*map(jax.tree.leaves, (rows, tuple(tangents[1:]))), strict=True)
        for row, moved in pairs:
            if not isinstance(moved, SymbolicZero):
                total = total + jnp.tensordot(row, moved, axes=moved.ndim)
        return value, total

    rate.defjvp(tangent, symbolic_zeros=True)
    return partial(rate, arrays)
