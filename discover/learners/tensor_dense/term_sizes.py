"""How large every term of a library is along the trajectories of a law."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.forward.fluids import at_samples
from discover.laws.multimode import Fluid
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.programs import compiled
from tensor_library.kinematics import rate_of_deformation

_COUNTS = (1.0, 1.0, 1.0, 2.0)
"""How often each of the components 11, 22, 33 and 12 stands in a tensor."""


def term_sizes(problem: TrajectoryProblem) -> Float[np.ndarray, " n"]:
    """Return the root-mean-square Frobenius norm of every term, dimensionless."""
    return np.asarray(_sizes(problem))


@compiled
def _sizes(problem: TrajectoryProblem) -> Float[Array, " n"]:
    fluid = Fluid(problem.base, problem.modulus, problem.relaxation_time, problem.solvent_viscosity)

    def of_run(protocol, grid):
        _, states, rates = at_samples(fluid, protocol, grid)  # (samples, modes, 4)
        flow = protocol.kinematics
        gradients = rates if flow is None else jnp.multiply.outer(rates, flow.gradient)

        def squares(stress, gradient, time):
            values = problem.library.evaluate(stress[:4], rate_of_deformation(gradient * time))
            return jnp.sum(jnp.asarray(_COUNTS) * values**2, axis=-1)

        of_modes = jax.vmap(squares, in_axes=(0, None, 0))
        found = jax.vmap(of_modes, in_axes=(0, 0, None))(states, gradients, fluid.relaxation_time)
        return jnp.where(grid.sample_mask[:, None, None], found, 0.0)

    found = problem.flows.over(of_run)
    samples = jnp.sum(problem.flows.sample_mask) * problem.modulus.shape[0]
    return jnp.sqrt(jnp.sum(found, axis=(0, 1, 2)) / samples)
