"""Fluid + protocol → stresses, to a tolerance."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.dataset.tables.table import as_column
from discover.errors import InputError
from discover.forward.flows import make_batch
from discover.forward.grid import MAX_GRID_POINTS, STRAIN_STEP, was_periodic
from discover.forward.of_fluids import (
    bare_run,
    components,
    followed,
    observed_in,
    of_solvent,
    recorded_and_normal,
)
from discover.laws.multimode import Fluid
from discover.protocols.kinematics import FOLLOWED
from discover.protocols.protocol import FlowProtocol, shear_rates

# Of the finest grid: the most of a grid that is made, halved once. A step takes some 3 µs
MAX_STEPS = 2 * MAX_GRID_POINTS

# What is left of the error when all steps are halved, by a method of fourth order, of which less
# is counted on
_HALVED = 1.0 / 8.0


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

    By an exponential method of fourth order that is exact for linear relaxation, in steps that land
    on every sample and are halved until that changes nothing.

    Parameters
    ----------
    fluid
        The fluid, in the units of `times`; `Fluid.dimensionless` for a bare law.
    protocol
        Flow at a given rate. A steady state, and a periodic one with which a flow begins, are
        solved for.
    times
        Sampling times in s, shape (n,), increasing, from 0 on.
    rtol, atol
        Tolerances on the stress, relative to the largest until then and to the sum of the moduli.

    Raises
    ------
    InputError
        If the flow is not at a given rate, or an argument is none of these.
    SimulationError
        If no solution to this tolerance was found within 400,000 steps.
    """
    times = _sampling(fluid, protocol, times)
    if protocol.control in ("stress", "oscillation"):
        raise InputError(
            "simulate takes flows at a given rate, in time or steady; got one of control "
            f"{protocol.control!r}. A learned law's predict() and compare() take runs of any "
            "control."
        )
    rates = shear_rates(protocol, times)
    viscous = of_solvent(fluid, protocol, rates)
    if float(times[-1]) == float(protocol.begins):
        return ShearStress(times, viscous)
    run = followed(fluid, bare_run(protocol, times))
    is_periodic = was_periodic(run.protocol)
    if protocol.control == "steady":
        found = components([fluid], make_batch([run]))[0, 0]
    else:
        total = float(np.sum(np.asarray(fluid.modulus)))
        found = _halved(fluid, run, rtol, atol * total)
    whole = np.all(np.isfinite(found), axis=1)
    if not np.all(whole) and (is_periodic or protocol.control == "steady"):
        state = "periodic state" if is_periodic else "steady state"
        raise SimulationError(
            f"The law has no {state} that is reached from rest at a rate of "
            f"{rates[np.argmax(~whole)]:g} 1/s. Check its parameters and the rate."
        )
    if not np.all(whole):
        raise SimulationError(
            f"The law could not be integrated to t = {times[-1]:g}: its stress diverges, or it "
            f"needs more than {MAX_STEPS} steps. Check its parameters and the shear rate."
        )
    return ShearStress(times, found[:, :4] + viscous)


def _sampling(fluid: Any, protocol: Any, times: Any) -> Float[np.ndarray, " n"]:
    """Return the sampling times as an array; raises InputError if an argument is none."""
    if not isinstance(fluid, Fluid):
        raise InputError(
            f"simulate takes a Fluid; got a {type(fluid).__name__}. Make one of a law with "
            "Fluid(law, modulus, relaxation_time)."
        )
    if not isinstance(protocol, FlowProtocol):
        raise InputError(
            f"simulate takes a flow, such as start_up(0.5); got a {type(protocol).__name__}."
        )
    times = as_column(times, "times of simulate")
    if not len(times) or times[0] < 0.0 or not np.all(np.diff(times) > 0.0):
        raise InputError(
            "times of simulate must start at or after 0 and increase strictly. Sort them and "
            "remove repeated ones."
        )
    return times


def _halved(fluid: Fluid, run: Run, rtol: float, atol: float) -> Float[np.ndarray, "n s"]:
    """Return the stress of the modes in steps that are halved until that changes nothing.

    Not a number where it never ceases to.
    """
    settles, pieces, known = fluid.settling_time, (1, 2), []
    while True:
        runs, limits = [run] * len(pieces), {"relaxation_time": settles}
        batch = make_batch(runs, STRAIN_STEP, pieces=pieces, **limits)
        coarse, found = [*known, *components([fluid], batch)[0, :, :, :4]][-2:]
        if np.all(np.isfinite(found)):
            size = np.maximum.accumulate(np.max(np.abs(found), axis=1))
            error = _HALVED * np.max(np.abs(found - coarse), axis=1)
            if np.all(error <= rtol * size + atol):
                return found
        pieces, known = (2 * pieces[-1],), [found]
        part: Any = batch.parts[0]  # at a given rate in time
        if 2 * int(np.sum(part.pieces[-1])) > MAX_STEPS:  # twice as many steps would be too many
            return np.full_like(found, np.nan)


def observe(
    fluid: Fluid, protocol: FlowProtocol, times: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return what is recorded of a fluid in one flow of any control, and N1 and N2 in Pa.

    At a given rate to a tolerance, as `simulate` does.
    """
    if protocol.control in FOLLOWED:
        return recorded_and_normal(protocol, simulate(fluid, protocol, times).components)
    found = observed_in(fluid, protocol, times)
    if not np.all(np.isfinite(found)):
        what = "bears this stress" if protocol.control == "stress" else "becomes periodic"
        raise SimulationError(
            f"The law could not be integrated: nothing shows that it {what}. Check its parameters "
            "and the flow."
        )
    return found
