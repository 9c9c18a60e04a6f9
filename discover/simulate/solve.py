"""Fluid + protocol → stresses, to a tolerance."""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.errors import InputError
from discover.forward.flow_batch import lay_out
from discover.forward.fluids import observed_in_batch, solve_batch
from discover.forward.grid import had_gone_on
from discover.laws.expansion import in_shared_form
from discover.laws.multimode import Fluid
from discover.programs import on_device
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol, recorded_at, shear_rates

# Lengths rounded up, so that flows share programs
_SAMPLES, _STEPS = 64, 256

_BUCKET = 401
"""Flows with up to so many samples share one program."""


class SimulationError(RuntimeError):
    """The law could not be integrated through the flow: its stress diverges or is too stiff."""


@dataclass(frozen=True)
class ShearStress:
    """Stresses in simple shear at sampling times."""

    times: Float[np.ndarray, " n"]  # in s, shape (n,)
    components: Float[np.ndarray, "n 4"]  # σ11, σ22, σ33, σ12 in Pa, shape (n, 4)

    @property
    def shear_stress(self) -> Float[np.ndarray, " n"]:
        """σ12 in Pa."""
        return self.components[:, 3]

    @property
    def first_normal_stress_difference(self) -> Float[np.ndarray, " n"]:
        """N1 = σ11 − σ22 in Pa."""
        return self.components[:, 0] - self.components[:, 1]

    @property
    def second_normal_stress_difference(self) -> Float[np.ndarray, " n"]:
        """N2 = σ22 − σ33 in Pa."""
        return self.components[:, 1] - self.components[:, 2]


def simulate(
    fluid: Fluid,
    protocol: FlowProtocol,
    times: Float[np.ndarray, " n"],
    rtol: float = 1e-8,
    atol: float = 1e-10,
) -> ShearStress:
    """Return the stresses of a fluid in a shear flow from rest, to a tolerance.

    The method adapts its steps and lands on every sample. A narrow spectrum is integrated with
    Tsitouras' explicit method, a wide one with an exponential method that is exact for linear
    relaxation.

    Parameters
    ----------
    fluid
        The fluid, in the units of `times`; `Fluid.dimensionless` for a bare law.
    protocol
        Flow at a given rate. What begins with a periodic state is followed in fixed steps instead,
        for that state is solved for.
    times
        Sampling times in s, shape (n,), increasing, from 0 on.
    rtol, atol
        Tolerances on the dimensionless stress of each mode.

    Raises
    ------
    InputError
        If the flow is not at a given rate.
    SimulationError
        If no solution to this tolerance was found within 100,000 steps.
    """
    times = np.asarray(times, dtype=float)
    if protocol.control in ("stress", "oscillation"):
        raise InputError(
            "simulate takes flows at a given rate, in time or steady; got one of control "
            f"{protocol.control!r}. A learned law's predict() and compare() take runs of any "
            "control."
        )
    if protocol.control == "steady" or (had_gone_on(protocol) and fluid.settling_time):
        return _solved_for(fluid, protocol, times)
    end = float(times[-1])
    if end == float(protocol.begins):
        gradient = protocol.velocity_gradient(jnp.asarray(end))
        return ShearStress(times, np.asarray(fluid.stress(fluid.rest(), gradient))[None])
    from discover.forward.by_diffrax import MAX_STEPS, solve_adaptively  # diffrax takes a second

    shortest = float(np.min(np.asarray(fluid.relaxation_time)))
    stiff = fluid.n_modes > 1 and end / shortest > 1e3
    fluid = replace(fluid, law=in_shared_form(fluid.law))
    knots = np.asarray(protocol.table_times)
    jumps = np.unique(knots[1:][np.diff(knots) <= 0.0])
    components, successful = solve_adaptively(
        fluid,
        protocol,
        on_device(_padded(times)),
        on_device(jumps) if jumps.size else None,
        stiff,
        rtol,
        atol,
    )
    components = np.asarray(components)[: times.size]
    if not successful or not np.all(np.isfinite(components)):
        raise SimulationError(
            f"The law could not be integrated to t = {end:g}: its stress diverges, or it needs "
            f"more than {MAX_STEPS} steps. Check its parameters and the shear rate."
        )
    return ShearStress(times, components)


def _solved_for(
    fluid: Fluid, protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> ShearStress:
    """Return what `simulate` does of steady states, and of what begins with a periodic one."""
    flows = lay_out([protocol], [times], relaxation_time=fluid.settling_time)
    components = np.asarray(solve_batch(fluid, flows))[0]
    if not np.all(np.isfinite(components)):
        state = "steady state" if protocol.control == "steady" else "periodic state"
        lost = shear_rates(protocol, times)[np.argmax(~np.all(np.isfinite(components), axis=1))]
        raise SimulationError(
            f"The law has no {state} that is reached from rest at a rate of {lost:g} 1/s. Check "
            "its parameters and the rate."
        )
    return ShearStress(times, components)


def observe(
    fluid: Fluid, protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return what is recorded of a fluid in one flow of any control, and N1 and N2 in Pa.

    At a given rate to a tolerance, as `simulate` does.
    """
    if protocol.control in FOLLOWED:
        stress = simulate(fluid, protocol, times)
        recorded = recorded_at(protocol, stress.components)
        n1, n2 = stress.first_normal_stress_difference, stress.second_normal_stress_difference
        return np.stack([recorded, n1, n2], axis=-1)
    n = len(times)
    flows = lay_out([protocol], [times], n + -n % _SAMPLES).with_steps_in(_STEPS)
    observed = np.asarray(observed_in_batch(fluid, flows))[0, :n]
    if not np.all(np.isfinite(observed)):
        what = "bears this stress" if protocol.control == "stress" else "becomes periodic"
        raise SimulationError(
            f"The law could not be integrated: nothing shows that it {what}. Check its parameters "
            "and the flow."
        )
    return observed


def _padded(times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Return the times with a few more just after the end."""
    step = 1e-6 * max(float(times[-1]), 1e-12)
    return np.concatenate([times, times[-1] + step * np.arange(1, -times.size % _BUCKET + 1)])
