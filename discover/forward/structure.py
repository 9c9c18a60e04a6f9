"""What of a declared model decides which program is compiled, and what is data to it."""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from discover.effects import AbstractEffect, ModeEffect, built_in_effects
from discover.laws import AbstractConstitutiveLaw


class Numbers(eqx.Module):
    """What of a declared model is data to the compiled program."""

    law: AbstractConstitutiveLaw
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]


class Structure(NamedTuple):
    """What decides which program is compiled; models that share it share the program."""

    effects: tuple[AbstractEffect, ...]
    free_parameters: tuple[str, ...]
    law_name: str
    parameters: tuple[tuple[str, float], ...]
    fit_modulus: bool
    by_mode: tuple[tuple[str, int, int], ...] = ()
    """Constants that may differ from mode to mode, and where what varies them begins and ends."""
    step_instants: int = 0
    """How many instants of steps of the rate are fitted, each as a share of its interval."""
    added_modes: int = 0
    """How many modes that effects add have constants by mode of their own."""

    def with_every_effect(self) -> "Structure":
        """Return the structure that all sets of effects share: an absent one is at zero.

        It has every effect that is built in, and after them, by name, those of a user's own that
        are asked for. What a declared model leaves as it is, is not moved.
        """
        asked = {effect.name: effect for effect in self.effects}
        every = {name: asked.pop(name, effect) for name, effect in built_in_effects().items()}
        every |= {name: asked[name] for name in sorted(asked)}
        if self.added_modes:
            # their constants follow one another in the order of these modes
            added = [e for e in self.effects if isinstance(e, ModeEffect)]
            plain = [e for e in every.values() if not isinstance(e, ModeEffect)]
            every = {effect.name: effect for effect in (*added, *plain)}
        return self._replace(effects=tuple(every.values()), fit_modulus=True)

    def without_constants(self) -> "Structure":
        """Return the structure of the effects alone: constants of a law are data to its code."""
        of_effects = (name for name, *_ in self.by_mode if name not in self.free_parameters)
        return Structure(self.effects, (), "", (), True, tuple((name, 0, 0) for name in of_effects))
