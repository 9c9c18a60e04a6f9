"""Laws whose coefficients in the tensor basis are a neural network."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw, AbstractExtendedLaw
from tensor_library.algebra import TENSOR_NAMES, Symmetric, integrity_basis, scalar_invariants
from tensor_library.law_terms import LawTerm

N_COEFFICIENTS = 8


# JAX's and Equinox's own have no name by which a network that holds them could be unpickled


def _tanh(value: Float[Array, ""]) -> Float[Array, ""]:
    return jnp.tanh(value)


def _unchanged(value: Float[Array, ""]) -> Float[Array, ""]:
    return value


class TensorBasisNetwork(AbstractExtendedLaw):
    """h = Σ gₙ(invariants) Tₙ, gₙ from a multilayer perceptron [Ling et al. 2016, JFM 807, 155].

    gₙ = cₙ + mₙ MLPₙ(invariants); in the paper cₙ = 0 and invariants are bare. `network`: eight
    numbers of eight invariants; None where all gₙ are constant. `invariant_scale`: the network sees
    asinh(invariant/scale); None for bare ones.
    """

    network: eqx.nn.MLP | None
    constants: Float[Array, "8"]  # cₙ, shape (8,)
    network_mask: Float[Array, "8"]  # mₙ, 0 or 1, shape (8,): which coefficients may vary
    invariant_scale: Float[Array, "8"] | None = None
    linear_relaxation: bool = eqx.field(static=True, default=True)
    base: AbstractConstitutiveLaw | None = None  # a known law whose extra term is added, or None

    @classmethod
    def initialise(
        cls, key: PRNGKeyArray, width: int = 32, depth: int = 2, linear_relaxation: bool = True
    ) -> "TensorBasisNetwork":
        """Return a network of the paper's size (8 → 32 → 32 → 8, tanh) with random weights."""
        network = eqx.nn.MLP(
            N_COEFFICIENTS, N_COEFFICIENTS, width, depth, _tanh, _unchanged, key=key
        )
        return cls(
            network=network,
            constants=jnp.zeros(N_COEFFICIENTS),
            network_mask=jnp.ones(N_COEFFICIENTS),
            linear_relaxation=linear_relaxation,
        )

    def coefficients(self, stress: Symmetric, rate: Symmetric) -> Float[Array, "8"]:
        """Return the coefficients gₙ at one state."""
        if self.network is None:
            return self.constants
        invariants = scalar_invariants(stress, rate)
        if self.invariant_scale is not None:
            invariants = jnp.arcsinh(invariants / self.invariant_scale)
        return self.constants + self.network_mask * self.network(invariants)

    def own_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return Σ gₙ Tₙ, without the base law's."""
        return jnp.tensordot(self.coefficients(stress, rate), integrity_basis(stress, rate), axes=1)

    def own_terms(self) -> tuple[LawTerm, ...]:
        """Return the constants as coefficients; InputError if one varies with the invariants."""
        if np.any(np.asarray(self.network_mask) != 0):
            raise InputError(
                "The network's coefficients vary with the invariants, so it is no sum of terms. "
                "Write out its projection on the library: the terms of its result."
            )
        pairs = zip(TENSOR_NAMES, np.asarray(self.constants).tolist(), strict=True)
        return tuple(LawTerm(name, value) for name, value in pairs if value != 0.0)
