"""An oil behind a slow motor: what it records is the stress of a Maxwell mode, to the last digit.

The rate behind a motor follows the commanded one, t_m dγ̇ₘ/dt + γ̇ₘ = γ̇, so that η γ̇ₘ is the
stress of a mode with λ = t_m and G = η/t_m. An inertia I adds I dγ̇ₘ/dt = (I/t_m) (γ̇ − γ̇ₘ), which
is that of a solvent beside a smaller mode.
"""

from collections.abc import Sequence

from discover.dataset import Run
from discover.effects.registry import make_effect


def oil_twin(
    modulus: float, time: float, solvent: float, runs: Sequence[Run]
) -> dict[str, float] | None:
    """Return viscosity, rise time and inertia that record in runs what a Maxwell mode does.

    None where N1, extension or a rate measured at the tool tells the two apart, and where no motor
    is that slow. All in units of Pa and s; `solvent`: the viscosity beside the mode.
    """
    found = {"viscosity": modulus * time + solvent, "rise_time": time, "inertia": solvent * time}
    rise, inertia = (
        make_effect(name).parameters[0] for name in ("rate_rise_time", "instrument_inertia")
    )
    told = any(
        (run.flow, run.quantity, run.protocol.control) != ("shear", "sigma12", "rate")
        or run.rate_is_measured
        for run in runs
    )
    return None if told or time > rise.high or solvent * time > inertia.high else found
