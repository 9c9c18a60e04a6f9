"""Library terms as one coefficient matrix, so that sixty of them cost little more than one."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np

from discover.effects import LibraryTerm
from tensor_library.integrity_basis import integrity_basis
from tensor_library.invariants import scalar_invariants


class LibraryMatrix:
    """Coefficients of library terms, basis tensors × monomials of the invariants.

    Parameters
    ----------
    terms
        Terms without a closed form.
    positions
        Of their coefficients in the parameter vector.
    """

    def __init__(self, terms: Sequence[LibraryTerm], positions: Sequence[int]):
        self.positions = np.asarray(positions, dtype=int)
        self.powers = tuple(dict.fromkeys(term.term.powers for term in terms))
        self.rows = np.array([term.term.tensor for term in terms], dtype=int)
        self.columns = np.array([self.powers.index(t.term.powers) for t in terms], dtype=int)

    def matrix(self, theta):
        """Return the coefficients as a matrix."""
        empty = jnp.zeros((8, len(self.powers)))
        return empty.at[self.rows, self.columns].add(theta[self.positions])

    def extra_term(self, matrix, stress, rate):
        """Return the sum of all terms."""
        invariants = scalar_invariants(stress, rate)
        monomials = []
        for powers in self.powers:
            value = jnp.ones(())
            for i, power in enumerate(powers):
                for _ in range(power):
                    value = value * invariants[i]
            monomials.append(value)
        return jnp.tensordot(matrix @ jnp.stack(monomials), integrity_basis(stress, rate), axes=1)
