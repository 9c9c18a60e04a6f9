"""A law that can be asked for by name."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from discover.laws.base import AbstractConstitutiveLaw
from tensor_library.isotropic_function import IsotropicFunction


@dataclass(frozen=True)
class NamedLaw:
    """A law that can be asked for by name.

    `build`: makes the law from its parameters, in the order of `parameters`.
    `parameters`: name and physical range of each parameter; laws are dimensionless, and so are
        these.
    `range_sources`: where each range comes from: literature, or the argument in a sentence.
    `written`: returns h with its constants as letters, by the names of `parameters`, so that the
        law can be written out; None where nobody said.
    `is_one_mode`: whether at small strain the law is one Maxwell mode. One that is not brings a
        spectrum of its own, so that modes found in a sweep are not its modes; ``"any"`` leaves it
        out.
    `contains`: laws that this one is, exactly or in the limit, with some of its constants at these
        values and the others as those of the law of that name.
    """

    title: str  # name as a rheologist writes it
    build: Callable[..., AbstractConstitutiveLaw]
    parameters: Mapping[str, tuple[float, float]]
    range_sources: Mapping[str, str] = field(default_factory=dict)
    source: str = ""  # literature on the law
    written: Callable[[], IsotropicFunction] | None = None
    is_one_mode: bool = True
    contains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def described(self, values: Mapping[str, float]) -> str:
        """Return the title with the values of the parameters, by their names in study files."""
        text = ", ".join(f"{key} = {value:g}" for key, value in values.items())
        return f"{self.title} ({text})" if text else self.title
