"""What of a declared model decides which program is compiled, and what is data to it."""

from typing import NamedTuple

import equinox as eqx
from jaxtyping import Array, Float

from discover.effects import AbstractEffect
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
