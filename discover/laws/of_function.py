"""Laws whose extra term is a plain function, without a class of one's own."""

import inspect
from collections.abc import Callable
from typing import Any

import equinox as eqx
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw, State, as_parameter
from tensor_library.algebra import Symmetric


class LawOfFunction(AbstractConstitutiveLaw):
    """A law with h(σ, γ̇) as a function.

    `function`: h of stress, rate and the parameters by name.
    """

    values: tuple[Float[Array, ""], ...]  # of the parameters, in the order of `names`
    function: Callable[..., Symmetric] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)  # names of the parameters
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: State, rate: Symmetric) -> Any:  # a user's, checked by its shape
        """Return h of the function."""
        return self.function(stress, rate, **dict(zip(self.names, self.values, strict=True)))


def law_of_function(
    name: str, function: Callable[..., Symmetric], names: tuple[str, ...]
) -> Callable[..., LawOfFunction]:
    """Return what makes the law from the values of its parameters, in their order.

    Raises InputError if the function does not take stress, rate and exactly these parameters.
    """
    wanted = f"def {name}(stress, rate{''.join(f', {one}' for one in names)})"
    if not callable(function):
        raise InputError(f"extra_term must be a function, {wanted}; got {function!r}.")
    try:
        inspect.signature(function).bind(None, None, **dict.fromkeys(names))
    except TypeError as error:
        raise InputError(
            f"extra_term of the law {name!r} must be a function {wanted}: {error}. Give the range "
            "of each of its parameters in parameters."
        ) from None

    def build(*values: ArrayLike) -> LawOfFunction:
        return LawOfFunction(
            values=tuple(map(as_parameter, values)), function=function, names=names
        )

    return build
