"""How a state of the fluid is written, so that it can leave this package."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class WrittenState:
    """A state as SymPy expressions over `tensor_library.isotropic_function.scalars`.

    The scalars are the names of the effect's parameters and of its levels, ``shear_rate`` and
    ``shear_stress``: the size of the rate √(½ γ̇:γ̇) in 1/s, and the stress in Pa of a shear of that
    size that does the same work.

    Attributes
    ----------
    rates
        Of change of each level, in 1/s, in their order.
    modulus_factor, time_factor
        On the stress and on the relaxation time of every mode.
    """

    rates: tuple[Any, ...]
    modulus_factor: Any = 1
    time_factor: Any = 1
