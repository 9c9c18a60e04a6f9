"""Flows at a given rate, followed on their grids from rest or from what a cycle brings back."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from discover.simulate.exponential_runge_kutta import ExponentialRungeKutta4
from discover.simulate.fixed_steps import fixed_steps
from discover.simulate.grid import IntegrationGrid
from discover.simulate.periodic_start import periodic_start

Tree = TypeVar("Tree")
VectorField = Callable[[Any, Any, Any], Any]


class Following(NamedTuple):
    """How states of modes change, and by which method they are followed.

    Attributes
    ----------
    vector_field
        dy/dt = f(t, y, args).
    rest
        Where there has been no flow, shape (k, s), or (k, s, c) with derivatives behind the first
        column.
    args
        Handed on to the vector field.
    """

    vector_field: VectorField
    solver: ExponentialRungeKutta4
    rest: Float[Array, "k s *c"]
    args: Any


def follow(
    following: Following,
    grid: IntegrationGrid,
    observe: Callable[[Any, Any, Any], PyTree] | None = None,
    alone: Following | None = None,
) -> PyTree:
    """Return what is observed at the samples of one grid, stacked along a new first axis.

    Parameters
    ----------
    following
        The states.
    observe
        Of (t, y, args); y itself by default.
    alone
        The same states without derivatives beside them, where `following` has these.
    """
    start = begun(following, grid, alone)
    vector_field, solver, _, args = following
    values = fixed_steps(vector_field, solver, grid.times, start, args, observe)
    return jax.tree.map(lambda value: value[grid.sample_index], values)


def begun(
    following: Following, grid: IntegrationGrid, alone: Following | None = None
) -> Float[Array, "k s *c"]:
    """Return the states at the start of a grid: at rest, or periodic where it begins with a cycle.

    A periodic state is solved for, without derivatives. One step of Newton's method from there
    moves it by nothing, and its derivatives, also those that stand beside it in columns, to those
    of the implicit function.
    """
    if grid.cycle is None:
        return following.rest
    alone = following if alone is None else alone
    fixed = alone._replace(
        args=without_derivatives(alone.args), rest=without_derivatives(alone.rest)
    )
    state = without_derivatives(_periodic_state(fixed, grid))
    is_periodic = grid.cycle > 0
    columns = following.rest
    start = (
        jnp.where(is_periodic, state, columns)
        if columns.ndim == 2
        else (columns.at[..., 0].set(jnp.where(is_periodic, state, columns[..., 0])))
    )
    change = _after_cycle(following, grid, start) - start
    # of every mode, the derivative of the end of a cycle by its start: direction, mode, component
    ends = without_derivatives(_along_components(fixed, grid, state))
    matrix = jnp.eye(state.shape[1]) - jnp.moveaxis(ends, 0, 2)
    step = jnp.linalg.solve(matrix, change.reshape(*state.shape, -1)).reshape(change.shape)
    return jnp.where(is_periodic, start + step, columns)


def _periodic_state(following: Following, grid: IntegrationGrid) -> Float[Array, "k s"]:
    assert grid.cycle is not None
    period = grid.times[grid.cycle] - grid.times[0]
    decay = jnp.min(following.solver.decay, axis=1) * jnp.where(period > 0.0, period, 1.0)
    slowness = 1.0 / jnp.where(decay > 0.0, decay, 1.0)

    def after_cycle(components, levels):
        return _after_cycle(following, grid, components.T).T, levels

    rest = following.rest.T, ()
    return periodic_start(after_cycle, rest, slowness, grid.cycle > 0)[0].T


def _along_components(following: Following, grid: IntegrationGrid, state: Float[Array, "k s"]):
    """Return how the end of a cycle moves with each component of every mode, shape (s, k, s)."""

    def along(unit):
        direction = unit * jnp.ones_like(state)
        return jax.jvp(lambda y: _after_cycle(following, grid, y), (state,), (direction,))[1]

    return jax.vmap(along)(jnp.eye(state.shape[1]))


def _after_cycle(following: Following, grid: IntegrationGrid, state):
    """Return what the cycle with which a grid begins makes of states."""
    vector_field, solver, _, args = following
    term = diffrax.ODETerm(vector_field)
    times = grid.times[: grid.cycle_steps + 1]

    def step(y, numbered):
        number, t0, t1 = numbered
        after = solver.step(term, t0, t1, y, args, None, made_jump=False)[0]
        return jnp.where(number < grid.cycle, after, y), None

    return jax.lax.scan(step, state, (jnp.arange(grid.cycle_steps), times[:-1], times[1:]))[0]


def without_derivatives(tree: Tree) -> Tree:
    """Return a tree through which no derivative passes."""
    return jax.tree.map(
        lambda leaf: jax.lax.stop_gradient(leaf) if eqx.is_inexact_array(leaf) else leaf, tree
    )
