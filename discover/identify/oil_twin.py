"""An oil behind a slow motor: what it records is the stress of a Maxwell mode, to the last digit.

The rate behind a motor follows the commanded one, t_m dγ̇ₘ/dt + γ̇ₘ = γ̇, so that η γ̇ₘ is the
stress of a mode with λ = t_m and G = η/t_m. An inertia I adds I dγ̇ₘ/dt = (I/t_m) (γ̇ − γ̇ₘ), which
is that of a solvent beside a smaller mode.
"""

from collections.abc import Sequence
from typing import NamedTuple

from discover.dataset import Run
from discover.effects.registry import make_effect


class OilBehindMotor(NamedTuple):
    """Viscosity in Pa s, rise time of the motor in s, inertia in Pa s²."""

    viscosity: float
    rise_time: float
    inertia: float


def oil_twin(
    modulus: float, time: float, solvent: float, runs: Sequence[Run]
) -> OilBehindMotor | None:
    """Return the oil that records in runs what a Maxwell mode with a solvent does; None without.

    N1, extension and a rate measured at the tool tell the two apart; and no motor is that slow.
    """
    if not all(
        run.flow == "shear" and run.quantity == "sigma12" and run.protocol.control == "rate"
        and not run.rate_is_measured for run in runs
    ):  # fmt: skip
        return None
    (slowest,) = make_effect("rate_rise_time").parameters
    (heaviest,) = make_effect("instrument_inertia").parameters
    if time > slowest.high or solvent * time > heaviest.high:
        return None
    return OilBehindMotor(modulus * time + solvent, time, solvent * time)
