"""What effects add to the law of every mode, of which only what is in use is computed.

All candidates stand in one program, most at zero amplitude, where they add nothing; it branches by
a few integers that no run and no mode changes, so that what is not taken costs nothing.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import ConstitutiveEffect, LibraryTerm
from tensor_library.algebra import integrity_basis, scalar_invariants
from tensor_library.kinematics import rate_of_deformation


class LibraryMatrix:
    """Coefficients of library terms, basis tensors × monomials of the invariants."""

    def __init__(self, terms: Sequence[LibraryTerm], positions: Sequence[int]):
        self.positions = np.asarray(positions, dtype=int)
        self.powers = tuple(dict.fromkeys(term.term.powers for term in terms))
        self.rows = np.array([term.term.tensor for term in terms], dtype=int)
        self.columns = np.array([self.powers.index(t.term.powers) for t in terms], dtype=int)
        self.tensors = tuple(sorted(set(self.rows.tolist())))
        """Basis tensors that occur."""

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

    def sum(self, matrix: Float[Array, "8 m"], stress, rate):
        """Return the sum of all terms; one at zero adds nothing, however large the stress."""

        def times(coefficients, values):
            return jnp.where(coefficients != 0.0, coefficients * values, 0.0)

        coefficients = times(matrix, self.monomials(stress, rate)).sum(axis=1)
        return times(coefficients[:, None], integrity_basis(stress, rate)).sum(axis=0)


ModesRate = Callable[[Float[Array, "s k"], Float[Array, "*c k"]], Float[Array, "s k"]]
"""From σ_k/G_k of all modes and their λ_k L: shear rates, (k,), or four components, (4, k)."""


class InUse(NamedTuple):
    """Which branches a parameter vector takes.

    `library`: 1 with terms of it. `others`, `states`: 0 without, i + 1 with the i-th alone,
    one past the last with several. `times`: 1 where a state changes the relaxation times.
    """

    library: np.int32
    others: np.int32
    states: np.int32 = np.int32(0)
    times: np.int32 = np.int32(0)


class AddedTerms:
    """Terms of the law of each mode that effects add.

    `slices`: where the parameters of each effect stand in the vector. `varying`: where what varies
    an amplitude from mode to mode stands.
    """

    def __init__(
        self,
        effects: Sequence[ConstitutiveEffect],
        slices: Mapping[str, slice],
        varying: Mapping[str, slice] | None = None,
    ):
        self._varying = dict(varying or {})
        plain = [
            e
            for e in effects
            if isinstance(e, LibraryTerm)
            and e.term.closed_form is None
            and e.name not in self._varying
        ]
        self.library = LibraryMatrix(plain, [slices[term.name].start for term in plain])
        self.others = [e for e in effects if e.adds_term and e not in plain]
        self._slices = slices

    def in_use(self, theta: Float[np.ndarray, " p"]) -> InUse:
        """Return the branches that a parameter vector takes."""
        library = np.any(theta[self.library.positions] != 0.0)
        others = [i for i, e in enumerate(self.others) if self._is_used(theta, e)]
        several = len(self.others) + 1
        return InUse(
            np.int32(library),
            np.int32(0 if not others else others[0] + 1 if len(others) == 1 else several),
        )

    def _is_used(self, theta, effect: ConstitutiveEffect) -> bool:
        varied = self._varying.get(effect.name, slice(0))
        return bool(theta[self._slices[effect.name].start] != 0.0 or np.any(theta[varied]))

    def rate(
        self,
        theta: Float[Array, " p"],
        used: InUse,
        amplitudes: Mapping[str, Float[Array, " k"]] | None = None,
    ) -> ModesRate:
        """Return the function that sums what is in use, dimensionless."""
        library = self._library_rate(theta, used) if self.library.tensors else _nothing
        others = self._others_rate(theta, used, amplitudes or {}) if self.others else _nothing

        def total(state, gradient):
            stress = state[:4]
            found = library(stress, gradient) + others(stress, gradient)
            # what structure variables of the law do is not changed
            return found if len(state) == 4 else jnp.zeros_like(state).at[:4].set(found)

        return total

    def _library_rate(self, theta, used: InUse) -> ModesRate:
        matrix = self.library.matrix(theta)

        def of_mode(stress, gradient):
            return self.library.sum(matrix, stress, rate_of_deformation(gradient))

        every = jax.vmap(of_mode, in_axes=-1, out_axes=-1)
        return lambda *flow: jax.lax.switch(used.library, [_nothing, every], *flow)

    def _others_rate(self, theta, used: InUse, amplitudes) -> ModesRate:
        def values_of(effect: ConstitutiveEffect):
            values = theta[self._slices[effect.name]]
            if effect.name not in amplitudes:
                return values
            own = amplitudes[effect.name]
            inner = jnp.broadcast_to(values[1:], (len(own), len(values) - 1))
            return jnp.concatenate([own[:, None], inner], axis=1)

        def of(effects: Sequence[ConstitutiveEffect]) -> ModesRate:
            def of_mode(values, stress, gradient):
                rate = rate_of_deformation(gradient)
                pairs = zip(effects, values, strict=True)
                return reduce(add, (e.extra_term(own, stress, rate) for e, own in pairs))

            by_mode = [0 if e.name in amplitudes else None for e in effects]
            every = jax.vmap(of_mode, in_axes=(by_mode, -1, -1), out_axes=-1)
            values = [values_of(e) for e in effects]
            return lambda stress, gradient: every(values, stress, gradient)

        branches = [_nothing, *(of([e]) for e in self.others), of(self.others)]
        return lambda *flow: jax.lax.switch(used.others, branches, *flow)


def _nothing(stress, gradient):
    del gradient
    return jnp.zeros_like(stress)
