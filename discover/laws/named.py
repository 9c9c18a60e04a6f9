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

    def described(self, values: Mapping[str, float]) -> str:
        """Return the title with the values of the parameters, by their names in study files."""
        text = ", ".join(f"{key} = {value:g}" for key, value in values.items())
        return f"{self.title} ({text})" if text else self.title
