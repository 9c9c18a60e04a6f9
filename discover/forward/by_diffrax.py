"""Steps by diffrax: to a tolerance, and for derivatives in reverse mode."""

from collections.abc import Callable
from typing import ClassVar

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.exponential_weights import krogstad_weights, turned, with_shares
from discover.forward.grid import IntegrationGrid
from discover.laws.multimode import Fluid
from discover.programs import compiled
from discover.protocols.protocol import FlowProtocol

MAX_STEPS = 100_000


@compiled
def solve_adaptively(fluid, protocol, times, jumps, stiff, rtol, atol):
    """Return the stresses in Pa at some times, to a tolerance, and whether steps were enough.

    `jumps`: of the rate, or None. `stiff`: whether relaxation is to be integrated exactly.
    """
    controller = diffrax.ClipStepSizeController(
        diffrax.PIDController(rtol=rtol, atol=atol), step_ts=times, jump_ts=jumps
    )
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(vector_field),
        exponential_steps(fluid) if stiff else diffrax.Tsit5(),
        protocol.begins,
        times[-1],
        None,
        fluid.rest(),
        args=(fluid, protocol),
        saveat=diffrax.SaveAt(ts=times, fn=stress_of),
        stepsize_controller=controller,
        max_steps=MAX_STEPS,
        throw=False,
    )
    return solution.ys, solution.result == diffrax.RESULTS.successful


def solve_in_reverse(
    fluid: Fluid,
    protocol: FlowProtocol,
    grid: IntegrationGrid,
    start: Float[Array, "k s"],
    adjoint: diffrax.AbstractAdjoint,
) -> Float[Array, "n 4"]:
    """Return the stresses in Pa at the samples of one grid, from dimensionless modes on."""
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(vector_field),
        exponential_steps(fluid),
        grid.times[0],
        grid.times[-1],
        None,
        start,
        args=(fluid, protocol),
        saveat=diffrax.SaveAt(t0=True, steps=True, fn=stress_of),
        stepsize_controller=diffrax.StepTo(grid.times),
        adjoint=adjoint,
        max_steps=grid.times.shape[0] - 1,
        throw=False,
    )
    return jnp.asarray(solution.ys)[grid.sample_index]


def vector_field(t, state, args):
    """Return the rate of change of the modes of a fluid in a flow, as diffrax asks for it."""
    fluid, protocol = args
    return fluid.state_rate(state, protocol.velocity_gradient(t))


def stress_of(t, state, args):
    """Return the stresses in Pa of the modes of a fluid in a flow, as diffrax asks for them."""
    fluid, protocol = args
    return fluid.stress(state, protocol.velocity_gradient(t))


class ExponentialRungeKutta4(diffrax.AbstractAdaptiveSolver):
    """Fourth-order exponential Runge–Kutta method   [Krogstad 2005, JCP 203, 72].

    The vector field is split as f = −decay ∘ y + N(t, y), and the decay integrated exactly, so a
    spectrum over seven decades costs no more steps than its slowest mode. With zero decay it is
    classical Runge–Kutta. The error estimate is the difference to the third-order solution that
    takes the last stage from the new point; in fixed steps it is compiled away.

    `decay`: rates of linear relaxation in 1/s, broadcastable against the state; any value is
    consistent, and no gradient flows through it. `tensors`: how many tensors the rates are of, each
    with its trace first (`turned`): chains that retract relax that faster than the rest. `shares`:
    what the first tensor has of the others; or None.
    """

    decay: Float[Array, " ..."]
    tensors: int = eqx.field(static=True, default=0)
    shares: Float[Array, " tensors"] | None = None
    term_structure: ClassVar = diffrax.ODETerm
    interpolation_cls: ClassVar[Callable[..., diffrax.AbstractPath]] = (
        diffrax.ThirdOrderHermitePolynomialInterpolation
    )

    def order(self, terms):
        """Return the order of convergence."""
        del terms
        return 4

    def error_order(self, terms):
        """Return the order of the local error estimate."""
        del terms
        return 4

    def init(self, terms, t0, t1, y0, args):
        """Return no state: the method has no memory between steps."""
        del terms, t0, t1, y0, args

    def func(self, terms, t0, y0, args):
        """Return the whole vector field."""
        return terms.vf(t0, y0, args)

    def step(self, terms, t0, t1, y0, args, solver_state, made_jump):
        """Make one step from t0 to t1."""
        del solver_state, made_jump
        if not self.tensors:
            return self._step(terms, t0, t1, y0, args)

        def turn(y):
            return turned(with_shares(y, self.shares, -1.0, axis=1), self.tensors)

        def back(y):
            return with_shares(turned(y, self.tensors), self.shares, 1.0, axis=1)

        def field(t, y, args):
            return turn(terms.vf(t, back(y), args))

        y1, *rest = self._step(diffrax.ODETerm(field), t0, t1, turn(y0), args)
        error, dense = jax.tree.map(back, rest[:2])
        return back(y1), error, dense, *rest[2:]

    def _step(self, terms, t0, t1, y0, args):
        step = t1 - t0
        step = jnp.asarray(step)
        z = -self.decay * step
        w = krogstad_weights(z, step)
        decayed, tableau = w.tableau()
        times = t0 + step * jnp.array([0.0, 0.5, 0.5, 1.0])

        # A scan and not four lines: the vector field is then compiled once and not four times
        def stage(remainders, inputs):
            number, kept, weights, t = inputs
            y = kept * y0 + jnp.sum(weights * remainders, axis=0)
            return remainders.at[number].set(terms.vf(t, y, args) + self.decay * y), None

        start = jnp.zeros((4, *y0.shape), y0.dtype)
        (n1, n2, n3, n4), _ = jax.lax.scan(stage, start, (jnp.arange(4), decayed, tableau, times))
        y1 = w.end(y0, n1, n2, n3, n4)
        slope = n1 - self.decay * y0
        slope_after = terms.vf(t1, y1, args)
        error = w.b4 * (slope_after + self.decay * y1 - n4)
        dense = {"y0": y0, "y1": y1, "k0": step * slope, "k1": step * slope_after}
        return y1, error, dense, None, diffrax.RESULTS.successful


def exponential_steps(fluid: Fluid) -> ExponentialRungeKutta4:
    """Return the method that is exact for the linear relaxation of a fluid."""
    # where the split lies is a choice of method, not of model: no gradient through it
    decay = jax.lax.stop_gradient(fluid.decay_rate())
    tensors = 1 + fluid.law.tensors if fluid.law.retracts else 0
    shares = jax.lax.stop_gradient(fluid.law.shares()) if fluid.law.tensors else None
    return ExponentialRungeKutta4(decay, tensors, shares)
