"""Steps of the modes by diffrax, whose adjoints give derivatives in reverse mode."""

from collections.abc import Callable
from typing import Any, ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.dynamics import Dynamics
from discover.forward.grid import IntegrationGrid
from discover.protocols.protocol import FlowProtocol


class ModeSteps(diffrax.AbstractSolver):
    """Steps of `Dynamics.after_step`; diffrax's `args` are numbers of a fluid, and its flow.

    `make`: the fluid of these numbers, through which derivatives pass.
    """

    make: Callable[[Any, FlowProtocol], Dynamics] = eqx.field(static=True)
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar = diffrax.LocalLinearInterpolation

    def order(self, terms):
        """Return the order of convergence."""
        del terms
        return 4

    def init(self, terms, t0, t1, y0, args):
        """Return no state: the method has no memory between steps."""
        del terms, t0, t1, y0, args

    def func(self, terms, t0, y0, args):
        """Return dσ/dt in the relaxation time of each mode."""
        return terms.vf(t0, y0, args)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        """Return what diffrax wants to know of a step from t0 to t1, without an error estimate."""
        del terms, solver_state, made_jump
        numbers, protocol = args
        rates = jax.vmap(protocol.rate)(jnp.stack([t0, 0.5 * (t0 + t1), t1]))
        dynamics = self.make(numbers, protocol)
        y1 = dynamics.after_step(y0, rates, jnp.asarray(t1 - t0), protocol.kinematics)
        return y1, None, {"y0": y0, "y1": y1}, None, diffrax.RESULTS.successful


def followed_in_reverse(
    make: Callable[[Any, FlowProtocol], Dynamics],
    numbers: Any,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    start: Float[Array, "s k"],
    adjoint: diffrax.AbstractAdjoint,
) -> Float[Array, "n s k"]:
    """Return the modes at the samples of one grid, by steps that `adjoint` goes back through."""

    def change(t, modes, args):
        numbers, protocol = args
        return make(numbers, protocol).change(modes, protocol.rate(t), protocol.kinematics)

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(change),
        ModeSteps(make),
        grid.times[0],
        grid.times[-1],
        None,
        start,
        args=(numbers, protocol),
        saveat=diffrax.SaveAt(t0=True, steps=True),
        stepsize_controller=diffrax.StepTo(grid.times),
        adjoint=adjoint,
        max_steps=grid.times.shape[0] - 1,
        throw=False,
    )
    return jnp.asarray(solution.ys)[grid.sample_index]
