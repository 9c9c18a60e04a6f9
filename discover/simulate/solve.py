"""Fluid + protocol → stresses: an adaptive reference and a fast path on fixed grids."""

from dataclasses import dataclass
from functools import partial

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.programs import compiled, on_device
from discover.protocols.protocol import FlowProtocol, shear_rates
from discover.simulate.exponential_runge_kutta import ExponentialRungeKutta4
from discover.simulate.flow_batch import FlowBatch, lay_out
from discover.simulate.following import Following, begun, follow
from discover.simulate.grid import IntegrationGrid, had_gone_on
from discover.simulate.steady_states import steady_state

MAX_STEPS = 100_000

_BUCKET = 401
"""Flows with up to so many samples share one program."""


class SimulationError(RuntimeError):
    """The law could not be integrated through the flow: its stress runs away or is too stiff."""


@dataclass(frozen=True)
class ShearStress:
    """Stresses in simple shear at sampling times.

    Attributes
    ----------
    times
        In s, shape (n,).
    components
        σ11, σ22, σ33, σ12 in Pa, shape (n, 4).
    """

    times: Float[np.ndarray, " n"]
    components: Float[np.ndarray, "n 4"]

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


def _vector_field(t, state, args):
    fluid, protocol = args
    return fluid.state_rate(state, protocol.velocity_gradient(t))


def _observe(t, state, args):
    fluid, protocol = args
    return fluid.stress(state, protocol.velocity_gradient(t))


def exponential_steps(fluid: Fluid, columns: bool = False) -> ExponentialRungeKutta4:
    """Return the method that is exact for the linear relaxation of a fluid.

    Parameters
    ----------
    columns
        Whether states have derivatives beside them, along a third axis.
    """
    # where the split lies is a choice of method, not of model: no gradient through it
    decay = jax.lax.stop_gradient(fluid.decay_rate())
    tensors = 1 + fluid.law.tensors if fluid.law.retracts else 0
    shares = jax.lax.stop_gradient(fluid.law.shares()) if fluid.law.tensors else None
    return ExponentialRungeKutta4(decay[..., None] if columns else decay, tensors, shares)


@compiled
def _solve_adaptively(fluid, protocol, times, jumps, solver, rtol, atol):
    controller = diffrax.ClipStepSizeController(
        diffrax.PIDController(rtol=rtol, atol=atol), step_ts=times, jump_ts=jumps
    )
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_vector_field),
        solver,
        protocol.begins,
        times[-1],
        None,
        fluid.rest(),
        args=(fluid, protocol),
        saveat=diffrax.SaveAt(ts=times, fn=_observe),
        stepsize_controller=controller,
        max_steps=MAX_STEPS,
        throw=False,
    )
    return solution.ys, solution.result == diffrax.RESULTS.successful


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
        Shear rate as a function of time.
    times
        Sampling times, shape (n,), increasing, from 0 on.
    rtol, atol
        Tolerances on the dimensionless stress of each mode. What begins with a periodic state is
        followed in fixed steps instead, for that state is solved for.

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
    shortest = float(np.min(np.asarray(fluid.relaxation_time)))
    stiff = fluid.n_modes > 1 and end / shortest > 1e3
    solver = exponential_steps(fluid) if stiff else diffrax.Tsit5()
    knots = np.asarray(protocol.table_times)
    jumps = np.unique(knots[1:][np.diff(knots) <= 0.0])
    components, successful = _solve_adaptively(
        fluid,
        protocol,
        on_device(_padded(times)),
        on_device(jumps) if jumps.size else None,
        solver,
        rtol,
        atol,
    )
    components = np.asarray(components)[: times.size]
    if not successful or not np.all(np.isfinite(components)):
        raise SimulationError(
            f"The law could not be integrated to t = {end:g}: its stress runs away, or it needs "
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


def _padded(times: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Return the times with a few more just after the end."""
    step = 1e-6 * max(float(times[-1]), 1e-12)
    return np.concatenate([times, times[-1] + step * np.arange(1, -times.size % _BUCKET + 1)])


def solve_on_grid(
    fluid: Fluid,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    adjoint: diffrax.AbstractAdjoint | None = None,
) -> Float[Array, "n 4"]:
    """Return the stresses at the samples of one grid, by fixed exponential Runge–Kutta steps.

    Made to be transformed: `jax.vmap` over runs, `jax.jvp`, reverse mode with an adjoint. A law
    that runs away gives infinite or nan values, never an error, so that a fit can reject the trial.

    Parameters
    ----------
    fluid, protocol
        As in `simulate`.
    adjoint
        How diffrax differentiates in reverse mode, such as ``RecursiveCheckpointAdjoint()``. None
        is for values and forward mode: the same steps, traced and compiled in a third of the time.

    Returns
    -------
    σ11, σ22, σ33, σ12 in Pa, shape (n, 4).
    """
    if adjoint is None or protocol.control == "steady":
        return _in_fixed_steps(fluid, protocol, grid, _observe)
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_vector_field),
        exponential_steps(fluid),
        grid.times[0],
        grid.times[-1],
        None,
        begun(_following(fluid, protocol), grid),
        args=(fluid, protocol),
        saveat=diffrax.SaveAt(t0=True, steps=True, fn=_observe),
        stepsize_controller=diffrax.StepTo(grid.times),
        adjoint=adjoint,
        max_steps=grid.times.shape[0] - 1,
        throw=False,
    )
    return jnp.asarray(solution.ys)[grid.sample_index]


def solve_states_on_grid(
    fluid: Fluid, protocol: FlowProtocol, grid: IntegrationGrid
) -> Float[Array, "n k s"]:
    """Return the dimensionless state of every mode at the samples of one grid.

    As `solve_on_grid` without an adjoint, but before the modes are added. Structure variables of
    the law stand behind the four components of σ.
    """
    return _in_fixed_steps(fluid, protocol, grid, None)


def _in_fixed_steps(fluid, protocol, grid, observe):
    if protocol.control == "steady":
        return _in_steady_flow(fluid, protocol, grid, observe)
    return follow(_following(fluid, protocol), grid, observe)


def _following(fluid, protocol) -> Following:
    return Following(_vector_field, exponential_steps(fluid), fluid.rest(), (fluid, protocol))


def _in_steady_flow(fluid, protocol, grid, observe):
    def at(time):
        state = steady_state(fluid, protocol.velocity_gradient(time))
        return state if observe is None else observe(time, state, (fluid, protocol))

    return grid.of_states(at)


@compiled
def solve_batch(fluid: Fluid, flows: FlowBatch) -> Float[Array, "runs n 4"]:
    """Return the stresses of one fluid in a batch of runs, on fixed grids."""
    return flows.over(partial(solve_on_grid, fluid))


def _change_in_any_flow(t, stress, args):
    law, velocity_gradient = args
    return law.stress_rate(stress, velocity_gradient(t))


@compiled
def _solve_in_any_flow(law, velocity_gradient, times, rtol, atol):
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(_change_in_any_flow),
        diffrax.Tsit5(),
        0.0,
        times[-1],
        None,
        jnp.zeros((3, 3)),
        args=(law, velocity_gradient),
        saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=diffrax.ClipStepSizeController(
            diffrax.PIDController(rtol=rtol, atol=atol), step_ts=times
        ),
        max_steps=MAX_STEPS,
        throw=False,
    )
    return solution.ys, solution.result == diffrax.RESULTS.successful


def simulate_homogeneous_flow(
    law: AbstractConstitutiveLaw,
    velocity_gradient,
    times: Float[np.ndarray, " n"],
    rtol: float = 1e-8,
    atol: float = 1e-10,
) -> Float[np.ndarray, "n 3 3"]:
    """Return the full dimensionless stress of a law in any homogeneous flow from rest.

    Parameters
    ----------
    velocity_gradient
        Function of time that returns L, shape (3, 3). Flows that differ in the arrays of a
        `jax.tree_util.Partial` alone share a program.
    times
        Dimensionless sampling times, shape (n,), increasing, from 0 on.
    rtol, atol
        Tolerances.

    Raises
    ------
    SimulationError
        If the stress runs away, as it does in UCM beyond a critical extension rate.
    """
    found, successful = _solve_in_any_flow(
        law, velocity_gradient, jnp.asarray(times, dtype=float), rtol, atol
    )
    stress = np.asarray(found)
    if not successful or not np.all(np.isfinite(stress)):
        raise SimulationError(
            f"The law could not be integrated to t = {float(times[-1]):g}: its stress runs away. "
            "Check its parameters and the rate of deformation."
        )
    return stress
