"""A few terms of a library, chosen by an index array that may change without recompiling."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from tensor_library.algebra import Symmetric
from tensor_library.integrity_basis import integrity_basis
from tensor_library.invariants import scalar_invariants
from tensor_library.library import TermLibrary


def evaluate_active(
    library: TermLibrary,
    active: Int[Array, " q"],
    stress: Symmetric,
    rate: Symmetric,
    inner: Float[Array, " m"],
) -> Float[Array, "q 3 3"] | Float[Array, "q 4"]:
    """Return the values of the active terms: the rows `active` of ``library.evaluate``.

    The cost grows with the number of active terms, not with the library: each term is looked up
    in a table of its factors.
    """
    factors, forms, tensors = _factor_table(library)
    invariants = scalar_invariants(stress, rate)
    one = jnp.ones((1,), invariants.dtype)
    scalar = jnp.concatenate([one, invariants])[jnp.asarray(factors)[active]].prod(axis=1)
    if library.forms:
        values = [
            form.function(invariants[0], inner[i]).astype(invariants.dtype)
            for i, form in enumerate(library.forms)
        ]
        scalar = scalar * jnp.concatenate([one, jnp.stack(values)])[jnp.asarray(forms)[active]]
    basis = integrity_basis(stress, rate)[jnp.asarray(tensors)[active]]
    return scalar.reshape((-1,) + (1,) * stress.ndim) * basis


def _factor_table(library: TermLibrary):
    """Return, for each term, its invariants (1-based, 0 for none), closed form and tensor."""
    width = max(1, max(term.degree for term in library.terms))
    factors = np.zeros((len(library), width), dtype=int)
    for row, term in zip(factors, library.terms, strict=True):
        listed = [1 + i for i, power in enumerate(term.powers) for _ in range(power)]
        row[: len(listed)] = listed
    position = {form.name: 1 + i for i, form in enumerate(library.forms)}
    forms = np.array([position.get(term.closed_form or "", 0) for term in library.terms])
    return factors, forms, np.array([term.tensor for term in library.terms])
