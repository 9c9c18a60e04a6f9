"""The same steps by diffrax, for derivatives in reverse mode."""

import diffrax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.grids.grid import IntegrationGrid
from discover.forward.integrators.exponential_runge_kutta import exponential_steps
from discover.laws.multimode import Fluid
from discover.protocols.protocol import FlowProtocol


def solve_in_reverse(
    fluid: Fluid,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    start: Float[Array, "k s"],
    adjoint: diffrax.AbstractAdjoint,
) -> Float[Array, "n 4"]:
    """Return the stresses in Pa at the samples of one grid, from where the modes begin.

    Parameters
    ----------
    fluid, protocol, grid
        Of one run at a given rate in time.
    start
        Dimensionless modes at the first time.
    adjoint
        How diffrax differentiates.
    """
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(vector_field),
        exponential_steps(fluid),
        grid.times[0],
        grid.times[-1],
        None,
        start,
        args=(fluid, protocol),
        saveat=diffrax.SaveAt(t0=True, steps=True, fn=stress_of),
        stepsize_controller=diffrax.StepTo(grid.times),
        adjoint=adjoint,
        max_steps=grid.times.shape[0] - 1,
        throw=False,
    )
    return jnp.asarray(solution.ys)[grid.sample_index]


def vector_field(t, state, args):
    """Return the rate of change of the modes of a fluid in a flow, as diffrax asks for it."""
    fluid, protocol = args
    return fluid.state_rate(state, protocol.velocity_gradient(t))


def stress_of(t, state, args):
    """Return the stresses in Pa of the modes of a fluid in a flow, as diffrax asks for them."""
    fluid, protocol = args
    return fluid.stress(state, protocol.velocity_gradient(t))
