"""Stresses of a law in flows, and their exact derivatives by every coefficient of a library.

Differences will not do: what a linear identity hides comes out at rounding error, and the weakest
of what is seen not far above.
"""

from functools import partial

import equinox as eqx
import jax
from jaxtyping import Array, Float

from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.multimode import Fluid
from discover.programs import compiled


@compiled
def with_sensitivities(
    fluid: Fluid, flows: FlowBatch
) -> tuple[Float[Array, "runs n 3"], Float[Array, "runs n 3 terms"]]:
    """Return what is recorded, N1 and N2 in Pa, and their derivatives by the coefficients.

    Parameters
    ----------
    fluid
        Of a law that is a `LibraryExpansion`. What it makes is not finite where it runs away.
    flows
        The runs and their grids.
    """

    def observed(coefficients):
        moved = eqx.tree_at(lambda one: one.law.coefficients, fluid, coefficients)
        found = flows.over(partial(observed_on_grid, moved))
        return found, found

    columns, value = jax.jacfwd(observed, has_aux=True)(fluid.law.coefficients)
    return value, columns
