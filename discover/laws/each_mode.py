"""Laws whose constants differ from mode to mode."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw, AbstractExtendedLaw, State
from tensor_library.algebra import Symmetric
from tensor_library.law_terms import LawTerm

Tree = TypeVar("Tree")


class LawOfEachMode(AbstractExtendedLaw):
    """One law for each mode of a fluid: the same equation with constants of its own.

    What follows the modes takes it apart by `over_modes` or `law_of_mode`.
    """

    law: AbstractConstitutiveLaw  # the law, with a leading axis of modes on every array

    def __init__(self, law: AbstractConstitutiveLaw):
        self.law = law

    @property
    def base(self) -> AbstractConstitutiveLaw:
        """The law, of which all is as of it."""
        return self.law

    @property
    def linear_relaxation(self) -> bool:
        """As in the law."""
        return self.law.linear_relaxation

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h of the law, of one mode."""
        return self.law.extra_term(stress, rate)

    def as_terms(self) -> None:
        """Return None: the terms differ from mode to mode."""

    def split(self) -> tuple[AbstractConstitutiveLaw, tuple[LawTerm, ...]]:
        """Return the law of each mode, with no terms beside."""
        return self, ()


def law_of_each_mode(laws: Sequence[AbstractConstitutiveLaw]) -> LawOfEachMode:
    """Law of a fluid with one law for each mode; InputError if they differ in more than numbers."""
    parts = [eqx.partition(law, eqx.is_array) for law in laws]
    kinds = {jax.tree.structure(arrays) for arrays, _ in parts}
    if len(kinds) != 1 or not all(eqx.tree_equal(parts[0][1], rest) for _, rest in parts):
        raise InputError("Laws of the modes of one fluid must be of one kind; got several.")
    if laws[0].tensors:
        raise InputError(
            f"The law {type(laws[0]).__name__} carries several tensors in every mode, and its "
            "constants must be the same in all of them."
        )
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *(arrays for arrays, _ in parts))
    return LawOfEachMode(law=eqx.combine(stacked, parts[0][1]))


def differs_by_mode(law: AbstractConstitutiveLaw) -> bool:
    """Return whether a law, or one that it adds to, differs from mode to mode."""
    return any(isinstance(part, LawOfEachMode) for part in _parts(law))


def over_modes(function: Callable[..., Any], tree: Any, axis: int = 0) -> Callable[..., Any]:
    """Return a function of one mode's law and numbers as one of all modes.

    `tree`: a law, or what holds one. `axis`: of the modes, in the numbers and in what is returned.
    """
    own, shared = apart(tree)

    def of_mode(own, *numbers):
        return function(eqx.combine(own, shared), *numbers)

    def of_all(*numbers):
        mapped = jax.vmap(of_mode, in_axes=(0, *(axis for _ in numbers)), out_axes=axis)
        return mapped(own, *numbers)

    return of_all


def of_each_mode(
    function: Callable[[AbstractConstitutiveLaw], Tree], law: AbstractConstitutiveLaw, count: int
) -> Tree:
    """Return what a law says of each of so many modes, along a first axis."""
    return over_modes(lambda law, _: function(law), law)(jnp.arange(count))


def law_of_mode(law: AbstractConstitutiveLaw, number: int) -> AbstractConstitutiveLaw:
    """Return the law of one mode, counted from 0; where all have the same, that one."""

    def of_mode(part):
        if not isinstance(part, LawOfEachMode):
            return part
        return jax.tree.map(lambda leaf: leaf[number] if eqx.is_array(leaf) else leaf, part.law)

    return jax.tree.map(of_mode, law, is_leaf=_is_of_each)


def with_modes(
    law: AbstractConstitutiveLaw,
    before: Float[Array, " k"] | np.ndarray,
    after: Float[Array, " m"] | np.ndarray,
) -> AbstractConstitutiveLaw:
    """Interpolate a law of modes with times `before` to times `after`, in s, linearly in log λ.

    Beyond the ends constants are those of the end.
    """

    def of_times(part):
        if not isinstance(part, LawOfEachMode):
            return part
        order = jnp.argsort(jnp.asarray(before))
        known, asked = jnp.log(jnp.asarray(before))[order], jnp.log(jnp.asarray(after))

        def between(leaf):
            if not eqx.is_array(leaf):
                return leaf
            rows = leaf[order].reshape(len(known), -1)
            found = jax.vmap(lambda row: jnp.interp(asked, known, row), 1, 1)(rows)
            return found.reshape(len(asked), *leaf.shape[1:])

        return LawOfEachMode(law=jax.tree.map(between, part.law))

    return jax.tree.map(of_times, law, is_leaf=_is_of_each)


def require_modes(law: AbstractConstitutiveLaw, count: int) -> None:
    """Raise InputError if a law has constants of another number of modes."""
    for part in _parts(law):
        if isinstance(part, LawOfEachMode):
            leaves = [leaf for leaf in jax.tree.leaves(part) if eqx.is_array(leaf)]
            wrong = next((leaf for leaf in leaves if leaf.shape[:1] != (count,)), None)
            if wrong is not None:
                raise InputError(
                    f"A law of each mode must have constants for {count} modes, as the fluid has; "
                    f"got the shape {wrong.shape}."
                )


def _is_of_each(part: Any) -> bool:
    return isinstance(part, LawOfEachMode)


def _parts(tree: Any) -> list[Any]:
    return jax.tree.leaves(tree, is_leaf=_is_of_each)


def apart(tree: Tree) -> tuple[Tree, Tree]:
    """Return what differs from mode to mode, and all else, each with None for the other."""
    differs = jax.tree.map(
        lambda part: eqx.is_array if _is_of_each(part) else False, tree, is_leaf=_is_of_each
    )
    return eqx.partition(tree, differs)
