"""A state of the whole fluid as part of an equation: a structure that flow breaks, or its heat."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from discover.effects import StateEffect, WrittenState, known_effects
from discover.errors import InputError


@dataclass(frozen=True)
class StatePart:
    """An effect with a state by its name.

    The state is one for all modes. It multiplies their stress, or their relaxation times wherever
    these occur in their equations.

    `effect`: name of the effect, one of `dc.effects()` with a state.
    `values`: its parameters by name, in their units.

    Raises InputError if there is no such effect, it has no state or nobody said how it is written,
    or a parameter is missing, unknown or outside its range.

    Examples
    --------
    >>> StatePart("thixotropy", {"breakdown": 0.2, "build_up_time": 5.0}).at_rest
    (1.0,)
    """

    effect: str
    values: Mapping[str, float]

    def __post_init__(self):
        self.written  # noqa: B018  # whatever is wrong is said here

    @property
    def own(self) -> StateEffect:
        """The effect."""
        (known,) = known_effects({self.effect: dict(self.values)}, "the law's states")
        if not isinstance(known.effect, StateEffect) or any(v is None for v in known.values):
            raise InputError(f"The effect {self.effect!r} has no state, or a parameter no value.")
        return known.effect

    @property
    def written(self) -> WrittenState:
        """The equation of the state."""
        written = self.own.written()
        if written is None:
            raise InputError(
                f"Nobody said how the state of the effect {self.effect!r} is written, so the law "
                "cannot be written out. Give its class the method `written`."
            )
        return written

    @property
    def names(self) -> tuple[str, ...]:
        """A name of each level of the state."""
        return self.own.level_names

    @property
    def at_rest(self) -> tuple[float, ...]:
        """Each level at rest."""
        return (self.own.rest,) * self.own.levels

    def spell(
        self, spelled: Callable[[object, Mapping[str, str]], str], letters: Mapping[str, str]
    ) -> tuple[list[str], str, str]:
        """Return the rates of change, and the factors on stress and times, as text.

        `spelled`: writes an expression with given texts for its scalars. `letters`: the texts of
        the parameters, the levels, ``shear_rate`` and ``shear_stress``.
        """
        import sympy

        written = self.written
        factors = (written.modulus_factor, written.time_factor)
        modulus, time = (spelled(sympy.sympify(one), letters) for one in factors)
        return [spelled(rate, letters) for rate in written.rates], modulus, time
