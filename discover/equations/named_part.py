"""A law with a name as part of an equation, with its constants, which may differ by mode."""

from collections.abc import Mapping
from dataclasses import dataclass

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.registry import LAWS, make_law
from tensor_library.isotropic_function import IsotropicFunction


@dataclass(frozen=True)
class NamedPart:
    """A law by its name.

    `law`: key of `discover.laws.LAWS`.
    `constants`: its parameters, dimensionless: once for all modes, or once for each.

    Raises InputError if there is no such law, or a parameter is missing, unknown or outside its
    range.

    Examples
    --------
    >>> NamedPart("saramito", ({"yield_strain": 0.3}, {"yield_strain": 0.1})).differing
    ('yield_strain',)
    """

    law: str
    constants: tuple[Mapping[str, float], ...]

    def __post_init__(self):
        if not self.constants:
            raise InputError(f"The law {self.law!r} needs its constants, at least once.")
        for one in self.constants:
            make_law(self.law, one)

    def of_mode(self, mode: int) -> Mapping[str, float]:
        """Return the constants of a mode, counted from 0."""
        return self.constants[mode if len(self.constants) > 1 else 0]

    def built(self) -> AbstractConstitutiveLaw:
        """Return the law, ready to simulate.

        Raises InputError if the constants differ from mode to mode.
        """
        if self.differing:
            raise InputError(
                f"{', '.join(self.differing)} differs from one relaxation mode to the next, so "
                "there is not one law for all. Take one mode at a time: equation.mode(0).law()."
            )
        return make_law(self.law, self.constants[0])

    @property
    def differing(self) -> tuple[str, ...]:
        """Names of the constants that differ from mode to mode."""
        first = self.constants[0]
        return tuple(n for n in first if any(one[n] != first[n] for one in self.constants))

    @property
    def is_written(self) -> bool:
        """Whether somebody said how the law is written."""
        return LAWS[self.law].written is not None

    @property
    def function(self) -> IsotropicFunction:
        """The law written out.

        Raises InputError if nobody said how it is written.
        """
        written = LAWS[self.law].written
        if written is None:
            raise InputError(
                f"Nobody said how the law {self.law!r} is written, so it cannot be exported in "
                "this format. Give register_law its `written`, or use --format json."
            )
        return written()
