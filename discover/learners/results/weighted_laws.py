"""Many laws that fit the data, with weights, and the band that they make together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from discover.forward.fluids import observed_on_grid
from discover.forward.grids.flow_batch import FlowBatch
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid, moduli_and_solvent
from discover.programs import compiled
from discover.statistics.one_more import one_more
from discover.statistics.weighted_quantiles import weighted_quantiles

QUANTITIES = ("sigma12", "N1", "N2")

Limits = Mapping[str, Float[np.ndarray, "3 n"]]
"""Lowest, middle and highest value of each of `QUANTITIES` in Pa."""

_LEVELS = (0.025, 0.5, 0.975)
_MOST_LOST = 0.5
"""Weight of the laws that may run away in a flow in which the others still make a band."""

_LAWS_AT_ONCE = 32


@dataclass(frozen=True)
class WeightedLaws:
    """Laws with one structure.

    Attributes
    ----------
    laws
        One law whose arrays have a leading axis of laws.
    weights
        Adding up to one, shape (laws,).
    moduli
        Of each law in Pa, shape (laws, k); None where all have those of the fluid.
    kinds
        Number of the kind of each law, shape (laws,), where the band of N1 is that of a law of one
        more kind; None where the kinds at hand are all that are meant.
    """

    laws: AbstractConstitutiveLaw
    weights: Float[np.ndarray, " laws"]
    moduli: Float[np.ndarray, "laws c"] | None = None
    kinds: Int[np.ndarray, " laws"] | None = None

    def bands(
        self,
        modes: tuple[Float[Array, " k"], Float[Array, " k"], Float[Array, ""]],
        flows: FlowBatch,
        samples: Sequence[int],
    ) -> list[Limits | None]:
        """Return the 95 % band of each flow.

        Parameters
        ----------
        modes
            Moduli in Pa, for laws without their own, relaxation times in s, and the solvent's
            viscosity in Pa s.
        flows
            From `lay_out`.
        samples
            Number of samples of each flow.

        Returns
        -------
        None for a flow in which laws of more than half of the weight run away, or a single kind is
        left to tell what one more may do.
        """
        modulus, relaxation_time, viscosity = modes
        if self.moduli is None:
            moduli = jnp.tile(modulus, (len(self.weights), 1))
        else:
            moduli = jnp.asarray(self.moduli)
        predicted = np.asarray(_predict(self.laws, moduli, relaxation_time, viscosity, flows))
        bands: list[Limits | None] = []
        for flow, n in enumerate(samples):
            values = predicted[:, flow, :n]
            kept = np.all(np.isfinite(values), axis=(1, 2))
            if np.sum(self.weights[kept]) < 1.0 - _MOST_LOST:
                bands.append(None)
                continue
            limits = weighted_quantiles(values[kept], self.weights[kept], _LEVELS)
            if self.kinds is not None:
                if len(np.unique(self.kinds[kept])) < 2:
                    bands.append(None)
                    continue
                first = QUANTITIES.index("N1")
                # a law that is about to run away is as far as the band, and no farther
                known = np.clip(values[kept, :, first], limits[0, :, first], limits[-1, :, first])
                low, high = one_more(known, self.kinds[kept])
                limits[0, :, first] = np.minimum(limits[0, :, first], low)
                limits[-1, :, first] = np.maximum(limits[-1, :, first], high)
            bands.append({q: limits[:, :, i] for i, q in enumerate(QUANTITIES)})
        return bands


@compiled
def _predict(
    laws, moduli, relaxation_time, solvent_viscosity, flows
) -> Float[Array, "laws flows n 3"]:
    arrays, rest = eqx.partition(laws, eqx.is_array)

    def of_law(numbers):
        law, modulus = numbers
        modes = moduli_and_solvent(modulus, len(relaxation_time), solvent_viscosity)
        fluid = Fluid(eqx.combine(law, rest), modes[0], relaxation_time, modes[1])
        return flows.over(partial(observed_on_grid, fluid))

    return jax.lax.map(of_law, (arrays, moduli), batch_size=_LAWS_AT_ONCE)
