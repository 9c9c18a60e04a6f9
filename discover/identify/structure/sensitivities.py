"""Stresses of a law in flows, and their exact derivatives by every coefficient of a library.

Differences will not do: what a linear identity hides comes out at rounding error, and the weakest
of what is seen not far above.
"""

from dataclasses import replace
from functools import partial

import jax
from jaxtyping import Array, Float

from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.programs import compiled


@compiled
def with_sensitivities(
    law: LibraryExpansion, known: Fluid, flows: FlowBatch
) -> tuple[Float[Array, "runs n 3"], Float[Array, "runs n 3 terms"]]:
    """Return what is recorded, N1 and N2 in Pa, and their derivatives by the coefficients.

    `law`: what it makes is not finite where it runs away. `known`: a fluid with its modes and
    solvent. `flows`: the runs and their grids.
    """

    def observed(coefficients):
        moved = replace(law, coefficients=coefficients)
        found = flows.over(partial(observed_on_grid, replace(known, law=moved)))
        return found, found

    columns, value = jax.jacfwd(observed, has_aux=True)(law.coefficients)
    return value, columns
