"""A law whose coefficients in the tensor basis are a neural network."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from discover.laws.base import AbstractConstitutiveLaw
from tensor_library.algebra import Symmetric
from tensor_library.integrity_basis import integrity_basis
from tensor_library.invariants import scalar_invariants


class TensorBasisNetwork(AbstractConstitutiveLaw):
    """h = Σ gₙ(invariants) Tₙ, gₙ from a multilayer perceptron   [Ling et al. 2016, JFM 807, 155].

    Attributes
    ----------
    network
        Eight invariants in, eight coefficients out.
    """

    network: eqx.nn.MLP
    linear_relaxation: bool = eqx.field(static=True, default=True)

    @classmethod
    def initialise(
        cls, key: PRNGKeyArray, width: int = 32, depth: int = 2, linear_relaxation: bool = True
    ) -> "TensorBasisNetwork":
        """Return a network of the paper's size (8 → 32 → 32 → 8, tanh) with random weights."""
        network = eqx.nn.MLP(8, 8, width, depth, jax.nn.tanh, key=key)
        return cls(network=network, linear_relaxation=linear_relaxation)

    def coefficients(self, stress: Symmetric, rate: Symmetric) -> Float[Array, "8"]:
        """Return the coefficients gₙ at one state."""
        return self.network(scalar_invariants(stress, rate))

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = Σ gₙ Tₙ."""
        return jnp.tensordot(self.coefficients(stress, rate), integrity_basis(stress, rate), axes=1)
