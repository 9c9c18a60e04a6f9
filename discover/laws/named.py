"""A law that can be asked for by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from discover.laws.base import AbstractConstitutiveLaw


@dataclass(frozen=True)
class NamedLaw:
    """A law that can be asked for by name.

    Attributes
    ----------
    title
        Name as a rheologist writes it.
    build
        Makes the law from its parameters, in the order of `parameters`.
    parameters
        Name and admissible range of each parameter.
    """

    title: str
    build: Callable[..., AbstractConstitutiveLaw]
    parameters: Mapping[str, tuple[float, float]]
