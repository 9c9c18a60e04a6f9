"""Library terms as one coefficient matrix, so that sixty of them cost little more than one."""

from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import LibraryTerm
from tensor_library.contraction import contracted
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
        self.tensors = tuple(sorted(set(self.rows.tolist())))
        """Basis tensors that occur."""

    def tensors_in_use(self, theta: Float[np.ndarray, " p"]) -> list[int]:
        """Return which of `tensors` have a coefficient that is not zero, by position."""
        used = set(self.rows[theta[self.positions] != 0.0].tolist())
        return [i for i, tensor in enumerate(self.tensors) if tensor in used]

    def matrix(self, theta: Float[Array, " p"]) -> Float[Array, "8 m"]:
        """Return the coefficients as a matrix."""
        empty = jnp.zeros((8, len(self.powers)))
        return empty.at[self.rows, self.columns].add(theta[self.positions])

    def monomials(self, stress, rate) -> Float[Array, " m"]:
        """Return the monomials of the invariants, in the order of the columns."""
        invariants = scalar_invariants(stress, rate)
        values = []
        for powers in self.powers:
            value = jnp.ones(())
            for i, power in enumerate(powers):
                for _ in range(power):
                    value = value * invariants[i]
            values.append(value)
        return jnp.stack(values)

    def sum(self, matrix: Float[Array, "8 m"], stress, rate, in_one_piece: bool = True):
        """Return the sum of all terms, without a product of matrices or with."""
        coefficients = contracted(matrix, self.monomials(stress, rate), in_one_piece)
        return contracted(coefficients, integrity_basis(stress, rate), in_one_piece)
