"""Trajectories of a trial law together with their sensitivities, as one augmented system.

With s the state of a mode and S = ∂s/∂θ, both obey

    ds/dt = f(s; θ),    dS/dt = J S + ∂f/∂θ,    J = ∂f/∂s,

where ∂f/∂c is minus the value of the library term that c multiplies. Integrating the two side by
side needs each library term once per stage, whatever the number of terms; p tangents through the
solver would evaluate the whole library p times.

Which terms are active is an index array, not a program: no support needs a compilation of its own.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from discover.forward.fluids import (
    dynamics_of_modes,
    solved_on_grid,
    with_cheap_tangents,
)
from discover.laws.base import as_state, stress_in
from discover.laws.each_mode import over_modes
from discover.laws.multimode import Fluid
from discover.learners.trajectories.active_terms import evaluate_active
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
from discover.simulate.exponential_runge_kutta import ExponentialRungeKutta4
from discover.simulate.following import Following, follow
from discover.simulate.solve import exponential_steps
from discover.simulate.steady_states import steady_modes
from tensor_library.contraction import contracted
from tensor_library.kinematics import rate_of_deformation

_LAWS_AT_ONCE = 32  # what is kept of every step of all of them stays small

_FEW = 10
"""Sensitivities that are pushed through the terms one by one. The compiler makes one loop of that,
where it fuses nothing with a product of the small matrix J; but of as many terms the work grows
with the square."""


# Compiled as a part of the whole either way; as a unit of its own it is traced once and not once
# for every stage of the integration.
@partial(jax.jit, static_argnums=0)
def _mode_rates(library, active, base, coefficients, inner, state, rate):
    """Return d/dt of one mode's augmented state (s, 1 + q + m), dimensionless."""
    stress, columns = state[:, 0], state[:, 1:]

    def stress_rate(stress, inner):
        own = stress_in(stress)
        terms = evaluate_active(library, active, own, rate_of_deformation(rate), inner)
        # a law's structure variables stand behind σ, and no term touches them
        terms = jax.vmap(lambda term: as_state(term, stress))(terms)
        known = base.stress_rate(stress, rate)
        return known - jnp.sum(coefficients[:, None] * terms, axis=0), terms

    change, push, terms = jax.linearize(stress_rate, stress, inner, has_aux=True)
    push = jax.vmap(push, in_axes=1, out_axes=1)
    n_terms, size = coefficients.shape[0], stress.shape[0]
    if columns.shape[1] <= _FEW:
        along = push(columns, jnp.eye(inner.shape[0], columns.shape[1], n_terms, inner.dtype))
    else:
        unit = jnp.eye(size + inner.shape[0], dtype=stress.dtype)
        jacobian = push(unit[:size], unit[size:])
        along = jacobian[:, :size] @ columns
        along = along.at[:, n_terms:].add(jacobian[:, size:])
    along = along.at[:, :n_terms].add(-terms.T)
    return jnp.concatenate([change[:, None], along], axis=1)


def _vector_field(t, state, args):
    problem, protocol, active, coefficients, inner = args
    rate = jnp.multiply.outer(problem.relaxation_time, protocol.velocity_gradient(t))

    def mode(base, state, rate):
        return _mode_rates(problem.library, active, base, coefficients, inner, state, rate)

    rates = over_modes(mode, problem.base)(state, rate)
    return rates / problem.relaxation_time[:, None, None]


def _observe(t, state, args):
    """Return the recorded stress, N1, N2 and their sensitivities, shape (3, 1 + q + m)."""
    problem, protocol, *_ = args
    total = jnp.tensordot(problem.modulus, state[:, :4], axes=1)
    return _recorded(total.at[:, 0].add(_of_solvent(problem, protocol, t)), protocol)


def _of_solvent(problem, protocol, t):
    return problem.solvent_viscosity * rate_of_deformation(protocol.velocity_gradient(t))


def _recorded(total, protocol):
    """Return the recorded stress, N1 and N2 of σ11, σ22, σ33, σ12 along the first axis."""
    recorded = protocol.recorded_stress(total)
    return jnp.stack([recorded, total[0] - total[1], total[1] - total[2]])


def _solve_run(problem, active, coefficients, inner, protocol, grid):
    if protocol.control == "steady":
        return _steady_run(problem, active, coefficients, inner, protocol, grid)
    if protocol.control not in FOLLOWED:
        return _solved_run(problem, active, coefficients, inner, protocol, grid)
    columns = 1 + coefficients.shape[0] + inner.shape[0]
    start = jnp.pad(_rest(problem)[..., None], ((0, 0), (0, 0), (0, columns - 1)))
    args = (problem, protocol, active, coefficients, inner)
    following = Following(_vector_field, _solver(problem, columns=True), start, args)
    alone = _states_alone(problem, active, coefficients, inner, protocol)
    return follow(following, grid, _observe, alone)


def _states_alone(problem, active, coefficients, inner, protocol) -> Following:
    """Return how the states change, without sensitivities."""
    of_modes = _known_less_terms(problem, active, coefficients, inner)

    def field(t, stress, _):
        rate = jnp.multiply.outer(problem.relaxation_time, protocol.velocity_gradient(t))
        return of_modes(stress, rate) / problem.relaxation_time[:, None]

    return Following(field, _solver(problem), _rest(problem), None)


def _rest(problem):
    rest = problem.base.rest()
    return jnp.broadcast_to(rest, (problem.modulus.shape[0], *rest.shape))


def _solver(problem, columns=False):
    """Return the method that is exact for the linear relaxation of the known law.

    Where that too is unknown, a rate of this size is still the natural split, and the split decides
    accuracy only.
    """
    if problem.base.linear_relaxation:
        fluid = Fluid(problem.base, problem.modulus, problem.relaxation_time)
        return exponential_steps(fluid, columns)
    decay = (1.0 / problem.relaxation_time)[:, None]
    return ExponentialRungeKutta4(decay[..., None] if columns else decay)


def _solved_run(problem, active, coefficients, inner, protocol, grid):
    """Return what `_solve_run` does where the rate is solved for."""

    def recorded(*numbers):
        observed = _observed_where_solved(problem, active, numbers, protocol, grid)
        return observed, observed

    columns, value = jax.jacfwd(recorded, argnums=(0, 1), has_aux=True)(coefficients, inner)
    return jnp.concatenate([value[..., None], *columns], axis=-1)


def _observed_where_solved(problem, active, numbers, protocol, grid):
    modes = problem.modulus, problem.relaxation_time, problem.solvent_viscosity

    def make(numbers):
        def of_mode(base, stress, rate):
            law = with_cheap_tangents(partial(_law_of_numbers, problem.library), (active, base))
            return law(numbers, stress, rate)

        return dynamics_of_modes(over_modes(of_mode, problem.base, -1), *modes, protocol)

    return solved_on_grid(make, numbers, protocol, grid, together=True).observed


def _law_of_numbers(library, given, numbers, stress, rate):
    (active, base), (coefficients, inner) = given, numbers
    own = stress_in(stress)
    terms = evaluate_active(library, active, own, rate_of_deformation(rate), inner)
    added = as_state(contracted(coefficients, terms), stress)
    return base.stress_rate(stress, rate) - added


def _steady_run(problem, active, coefficients, inner, protocol, grid):
    """Return what `_solve_run` does of steady states, by the implicit function."""

    def at(time):
        recorded = partial(_observed_in_steady_flow, problem, active, protocol, time)
        value = recorded(coefficients, inner)
        columns = jax.jacfwd(recorded, argnums=(0, 1))(coefficients, inner)
        return jnp.concatenate([value[:, None], *columns], axis=1)

    return grid.of_states(at)


def _observed_in_steady_flow(problem, active, protocol, time, coefficients, inner):
    gradient = jnp.multiply.outer(problem.relaxation_time, protocol.velocity_gradient(time))
    law = _known_less_terms(problem, active, coefficients, inner)
    state = steady_modes(law, gradient, _rest(problem), problem.base.scalars)
    return _observed(problem, protocol, time, state)


def _known_less_terms(problem, active, coefficients, inner):
    """Return the dimensionless dσ/dt of all modes, of their σ and their λL."""
    numbers = coefficients, inner

    def of_mode(base, stress, rate):
        return _law_of_numbers(problem.library, (active, base), numbers, stress, rate)

    return over_modes(of_mode, problem.base)


def _observed(problem, protocol, time, state):
    """Return the recorded stress, N1 and N2 of modes, shape (k, s)."""
    total = jnp.tensordot(problem.modulus, state[:, :4], axes=1)
    return _recorded(total + _of_solvent(problem, protocol, time), protocol)


def observe(
    problem: TrajectoryProblem,
    active: Int[Array, " q"],
    coefficients: Float[Array, " q"],
    inner: Float[Array, " m"],
) -> tuple[Float[Array, "runs n 3"], Float[Array, "runs n 3 q+m"]]:
    """Return what a trial law predicts of every observation, and its sensitivities.

    Parameters
    ----------
    problem
        Data and known physics.
    active
        Positions in the library of the terms with a sensitivity; repeated positions add up.
    inner
        Inner parameters of the closed forms.

    Returns
    -------
    What is recorded, N1 and N2, and their derivatives with respect to coefficients, then inner
    parameters. Not finite where the trial law runs away.
    """
    run = partial(_solve_run, problem, active, coefficients, inner)
    observed = problem.flows.over(run)
    return observed[..., 0], observed[..., 1:]


@compiled
def predict_many(
    problem: TrajectoryProblem,
    active: Int[Array, " q"],
    coefficients: Float[Array, "laws q"],
    inner: Float[Array, "laws m"],
    modulus: Float[Array, "laws k"] | None = None,
) -> Float[Array, "laws rows"]:
    """Return the weighted predictions of many laws of the same terms, without sensitivities.

    Parameters as in `observe`, with a leading axis of laws, and moduli of each law in Pa, by
    default those of the problem. Not finite where a law runs away.
    """

    def run(problem, coefficients, inner, protocol, grid):
        if protocol.control == "steady":
            return grid.of_states(
                lambda time: _observed_in_steady_flow(
                    problem, active, protocol, time, coefficients, inner
                )
            )
        if protocol.control not in FOLLOWED:
            numbers = coefficients, inner
            return _observed_where_solved(problem, active, numbers, protocol, grid)
        return follow(
            _states_alone(problem, active, coefficients, inner, protocol),
            grid,
            lambda t, stress, _: _observed(problem, protocol, t, stress),
        )

    def law(numbers):
        coefficients, inner, modulus = numbers
        at = problem if modulus is None else eqx.tree_at(lambda p: p.modulus, problem, modulus)
        predicted = problem.flows.over(partial(run, at, coefficients, inner))
        return problem.records.weighted(predicted).reshape(-1)

    # side by side, a law that is given up at once would cost as much as the slowest beside it
    followed = all(protocols.control in FOLLOWED for protocols, _ in problem.flows.parts)
    at_once = _LAWS_AT_ONCE if followed else None
    return jax.lax.map(law, (coefficients, inner, modulus), batch_size=at_once)


@compiled
def linearise(
    problem: TrajectoryProblem,
    coefficients: Float[Array, " n"],
    inner: Float[Array, " m"],
) -> tuple[Float[Array, " rows"], Float[Array, "rows n+m"]]:
    """Return the residual and its derivatives with respect to every term.

    Rows are run × sample × kind, flattened; those without an observation are zero.
    """
    everything = jnp.arange(len(problem.library))
    predicted, sensitivity = observe(problem, everything, coefficients, inner)
    residual, columns = problem.records.linearised(predicted, sensitivity)
    return residual.reshape(-1), columns.reshape(residual.size, -1)
