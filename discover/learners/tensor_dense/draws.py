"""Laws that fit the data with their weights, and what they predict together."""

from dataclasses import dataclass

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.expansion import LibraryExpansion
from discover.learners.results.weighted_laws import WeightedLaws
from discover.learners.tensor_dense.reference_laws import ReferenceLaw
from tensor_library.library import TermLibrary


@dataclass(frozen=True)
class DenseDraws:
    """Laws that fit the data.

    Attributes
    ----------
    constants
        Of the reference law under each, shape (draws, 5): α, ξ, ε, k, m.
    coefficients
        Of the library on top of it, shape (draws, n).
    weights
        Adding up to one, shape (draws,).
    moduli
        In Pa, shape (draws, k), the solvent behind them where a sweep told it; None where all have
        those declared.
    relaxation
        One where the reference laws bring −σ along, else zero.
    optima
        Number of the optimum about which each was drawn, shape (draws,), where no named law fits:
        the fluid's is then one more, and the band of N1 allows for it. None where one fits.
    """

    constants: Float[np.ndarray, "draws 5"]
    coefficients: Float[np.ndarray, "draws n"]
    weights: Float[np.ndarray, " draws"]
    relaxation: float
    moduli: Float[np.ndarray, "draws c"] | None = None
    optima: Int[np.ndarray, " draws"] | None = None

    def laws(self, library: TermLibrary, base: AbstractConstitutiveLaw) -> WeightedLaws:
        """Return the laws, dimensionless, the known one included."""

        def law(constants, coefficients):
            reference = ReferenceLaw(
                constants=constants,
                relaxation=jnp.asarray(self.relaxation),
                base=base,
                linear_relaxation=base.linear_relaxation,
            )
            return LibraryExpansion(
                coefficients=coefficients,
                inner=jnp.zeros(0),
                library=library,
                linear_relaxation=base.linear_relaxation,
                base=reference,
            )

        laws = eqx.filter_vmap(law)(jnp.asarray(self.constants), jnp.asarray(self.coefficients))
        return WeightedLaws(laws, self.weights, self.moduli, self.optima)
