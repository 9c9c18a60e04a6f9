"""Modes of a fluid stepped through a run, as JAX transforms it."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from discover.forward.dynamics import Dynamics
from discover.forward.grid import IntegrationGrid
from discover.forward.steady_states import periodic_start, steady_state
from discover.protocols.kinematics import Kinematics
from discover.protocols.protocol import FlowProtocol
from tensor_library.algebra import VelocityGradient, contracted

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

    Made to be transformed. A law that diverges gives infinite or nan values, never an error.

    `dynamics`: the modes, with derivatives beside them where it has columns; without states or
    series. `fixed`: the same, through which no derivative passes. `start`: the modes at the first
    time; by default as `begun` says.
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
    """Return the modes where a grid begins: at rest, or periodic where that is a cycle."""
    if grid.cycle is None:
        return dynamics.rest()
    rate, width = (of[: grid.cycle_steps] for of in _stepped(protocol, grid))
    period = grid.times[grid.cycle] - grid.times[0]
    return periodic_modes(dynamics, fixed, rate, width, grid.cycle, period, protocol.kinematics)


def periodic_modes(
    dynamics: Dynamics, fixed: Dynamics, rate: Float[Array, "steps 3"],
    width: Float[Array, " steps"], count: Int[Array, ""], period: Float[Array, ""],
    flow: Kinematics | None, mirrored: bool = False,
) -> Float[Array, "s *c k"]:  # fmt: skip
    """Return the modes that a cycle of `count` steps brings back; at rest where there are none.

    The state is solved for without derivatives; one step of Newton's method from there moves it by
    nothing, and its derivatives to those of the implicit function. `rate`: at the beginning, middle
    and end of each step, in 1/s. `width`, `period`: of a step and the cycle, in s. `mirrored`:
    whether it is half a cycle, after which the flow is its own image in the plane across it.
    """
    rest = dynamics.rest()
    signs = np.ones(len(rest))
    if mirrored:
        signs[3 : 4 * (1 + dynamics.tensors) : 4] = -1.0

    def after_cycle(fluid: Dynamics, stress) -> Any:
        def step(stress, inputs):
            number, rates, weights = inputs
            after = fluid.stepped(weights, stress, rates, flow)
            return jnp.where(number < count, after, stress), None

        steps = jnp.arange(len(width)), rate, fluid.weights(width)
        end = jax.lax.scan(step, stress, steps)[0]
        return signs.reshape(-1, *(1,) * (end.ndim - 1)) * end

    def along(unit):
        direction = unit[:, None] * jnp.ones_like(state)
        return jax.jvp(lambda stress: after_cycle(fixed, stress), (state,), (direction,))[1]

    is_periodic = count > 0
    slowness = fixed.modes.relaxation_time / jnp.where(period > 0.0, period, 1.0)
    state = periodic_start(partial(after_cycle, fixed), fixed.rest(), slowness, is_periodic)
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


class Answer(NamedTuple):
    """What a fluid answers a given stress with, at step ends."""

    strain: Float[Array, " s"]  # recorded, zero at the first
    stress: Float[Array, "s _ k"]  # dimensionless, of the modes, shape (steps, s, k)
    rate: Float[Array, " s"]  # in 1/s


def answer_to_stress(
    dynamics: Dynamics,
    times: Float[Array, " s"],
    imposed: Float[Array, " s"],
    flow: Kinematics | None,
    fixed: Dynamics,
) -> Answer:
    """Return the strain at step ends, and the modes and the rate there.

    In each step the rate is a straight line such that σ + η γ̇ = σ_imposed holds in the middle and
    at the end: collocation of a Volterra equation of the first kind, of order two and stable
    whatever the modes' times   [Brunner 2004, Collocation Methods for Volterra Integral and
    Related Functional Differential Equations, chapter 2.4]. The modes follow that rate by
    Krogstad's method.

    `times`: step ends in s, at rest at the first. `imposed`: recorded stress there in Pa. `fixed`:
    the fluid once more, through which no derivative passes.
    """
    width = jnp.diff(times)

    def step(carry, inputs):
        stress, before, bend, strain = carry
        (from_, target), h, weights = inputs
        w = dynamics.of_step(weights)
        wanted = jnp.stack([0.5 * (from_ + target), target])

        def followed(fluid: Dynamics, rates):
            """Return what the balance misses at rates in the middle and at the end; the modes."""
            there = w.along_a_line(stress, fluid.stage(w, flow), *rates)
            felt = jnp.stack([fluid.recorded(state, flow) for state in there])
            return wanted - felt - dynamics.viscosity * rates, there[1]

        # one of Newton's steps, with slopes that no derivative passes through
        rates = jax.lax.stop_gradient(before + bend * h * jnp.array([0.5, 1.0]))

        def as_it_is(rates):
            missing, _ = followed(fixed, rates)
            return missing, missing

        stiffness, missing = jax.lax.stop_gradient(jax.jacfwd(as_it_is, has_aux=True)(rates))
        (a, b), (c, d) = -stiffness
        inverse = jnp.array([[d, -b], [-c, a]]) / (a * d - b * c)
        rates = rates + contracted(inverse, missing)

        def corrected(carry, share):
            rates, _ = carry
            missing, after = followed(dynamics, rates)
            return (rates + share * contracted(inverse, missing), after), None

        # one more with the same slopes, by which the rates move as the implicit function does, and
        # the modes at what that found
        (rates, after), _ = jax.lax.scan(corrected, (rates, stress), jnp.array([1.0, 0.0]))
        mean, last = rates
        strain = strain + h * mean
        return (after, last, 2.0 * (last - mean) / h, strain), (strain, after, last)

    stress = dynamics.rest()
    zero = jnp.zeros((), dtype=stress.dtype)
    _, later = jax.lax.scan(
        step,
        (stress, zero, zero, zero),
        ((imposed[:-1], imposed[1:]), width, dynamics.weights(width)),
    )
    return Answer(
        *(
            jnp.concatenate([first[None], rest])
            for first, rest in zip((zero, stress, zero), later, strict=True)
        )
    )
