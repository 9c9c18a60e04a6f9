"""Laws at a given rate: in time, from rest or from what a cycle brings back, and in steady flow."""

from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from discover.forward.dynamics import Dynamics
from discover.forward.grids.grid import IntegrationGrid
from discover.forward.starts.periodic_start import periodic_start
from discover.forward.starts.steady_states import steady_state
from discover.protocols.protocol import FlowProtocol
from tensor_library.kinematics import VelocityGradient

Tree = TypeVar("Tree")

Observe = Callable[[Float[Array, "s *c k"], VelocityGradient], PyTree]
"""What is seen of the modes in a flow with this L in 1/s."""


def follow(
    dynamics: Dynamics,
    fixed: Dynamics,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    observe: Observe,
    start: Float[Array, "s *c k"] | None = None,
) -> PyTree:
    """Return what is observed at the samples of one grid, stacked along a new first axis.

    Made to be transformed: `jax.vmap`, `jax.jvp`; reverse mode keeps every step in memory. A law
    that runs away gives infinite or nan values, never an error, so that a fit can reject the trial.

    `dynamics`: the modes, with derivatives beside them where it has columns. No state changes with
    them, and nothing gives way in series. `fixed`: the modes alone, through which no derivative
    passes. `protocol`, `grid`: of one run at a given rate, in time or steady. `observe`: what is
    seen at each step end, or of each steady state. `start`: the modes at the first time; by default
    as `begun` says.
    """
    flow = protocol.kinematics
    if protocol.control == "steady":

        def at(number):
            stress = steady_state(dynamics, fixed, protocol.rate(number), flow)
            return observe(stress, protocol.velocity_gradient(number))

        return grid.of_states(at)
    rate, width = _stepped(protocol, grid)

    def seen(stress, rate):
        return observe(stress, rate if flow is None else rate * flow.gradient)

    def step(stress, inputs):
        rates, width = inputs
        stress = dynamics.after_step(stress, rates, width, flow)
        return stress, seen(stress, rates[2])

    start = begun(dynamics, fixed, protocol, grid) if start is None else start
    _, later = jax.lax.scan(step, start, (rate, width))
    first = seen(start, rate[0, 0])
    return jax.tree.map(
        lambda one, others: jnp.concatenate([one[None], others])[grid.sample_index], first, later
    )


def begun(
    dynamics: Dynamics, fixed: Dynamics, protocol: FlowProtocol, grid: IntegrationGrid
) -> Float[Array, "s *c k"]:
    """Return the modes at the start of a grid: at rest, or periodic where it begins with a cycle.

    A periodic state is solved for, without derivatives. One step of Newton's method from there
    moves it by nothing, and its derivatives, also those that stand beside it in columns, to those
    of the implicit function.
    """
    rest, _ = dynamics.rest()
    if grid.cycle is None:
        return rest
    rate, width = (of[: grid.cycle_steps] for of in _stepped(protocol, grid))

    def after_cycle(fluid: Dynamics, stress):
        def step(stress, inputs):
            number, rates, width = inputs
            after = fluid.after_step(stress, rates, width, protocol.kinematics)
            return jnp.where(number < grid.cycle, after, stress), None

        return jax.lax.scan(step, stress, (jnp.arange(grid.cycle_steps), rate, width))[0]

    def along(unit):
        direction = unit[:, None] * jnp.ones_like(state)
        return jax.jvp(lambda stress: after_cycle(fixed, stress), (state,), (direction,))[1]

    is_periodic = grid.cycle > 0
    period = grid.times[grid.cycle] - grid.times[0]
    slowness = fixed.modes.relaxation_time / jnp.where(period > 0.0, period, 1.0)
    alone, _ = fixed.rest()
    state, _ = periodic_start(
        lambda stress, levels: (after_cycle(fixed, stress), levels),
        (alone, ()),
        slowness,
        is_periodic,
    )
    state = jax.lax.stop_gradient(state)
    start = state if not dynamics.columns else rest.at[:, 0].set(state)
    change = after_cycle(dynamics, start) - start
    # of every mode, the derivative of the end of a cycle by its start: direction, component, mode
    ends = jax.lax.stop_gradient(jax.vmap(along)(jnp.eye(len(state))))
    matrix = jnp.eye(len(state)) - ends.T
    right = jnp.moveaxis(change, -1, 0).reshape(len(matrix), len(state), -1)
    step = jnp.moveaxis(jnp.linalg.solve(matrix, right), 0, -1).reshape(change.shape)
    return jnp.where(is_periodic, start + step, rest)


def _stepped(
    protocol: FlowProtocol, grid: IntegrationGrid
) -> tuple[Float[Array, "steps 3"], Float[Array, " steps"]]:
    """Return rates at the beginning, middle and end of every step, and its width in s."""
    first, width = grid.times[:-1], jnp.diff(grid.times)
    at_ends = jax.vmap(protocol.rate)(grid.times)
    in_middle = jax.vmap(protocol.rate)(first + 0.5 * width)
    return jnp.stack([at_ends[:-1], in_middle, at_ends[1:]], axis=1), width


def without_derivatives(tree: Tree) -> Tree:
    """Return a tree through which no derivative passes."""
    return jax.tree.map(
        lambda leaf: jax.lax.stop_gradient(leaf) if eqx.is_inexact_array(leaf) else leaf, tree
    )
