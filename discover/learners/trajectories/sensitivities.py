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

from discover.forward.cheap_tangents import with_cheap_tangents
from discover.forward.fluids import dynamics_of_fluid, solved_on_grid
from discover.forward.integrators.at_given_rate import follow, without_derivatives
from discover.laws.base import as_state, stress_in
from discover.laws.each_mode import over_modes
from discover.laws.multimode import Fluid, moduli_and_solvent
from discover.learners.trajectories.active_terms import evaluate_active
from discover.learners.trajectories.problem import TrajectoryProblem
from discover.programs import compiled
from discover.protocols.kinematics import FOLLOWED
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


def _solve_run(problem, active, coefficients, inner, protocol, grid):
    if protocol.control not in FOLLOWED or protocol.control == "steady":
        return _of_implicit_function(problem, active, coefficients, inner, protocol, grid)

    def of_mode(base, state, rate):
        return _mode_rates(problem.library, active, base, coefficients, inner, state, rate)

    n_columns = coefficients.shape[0] + inner.shape[0]
    alone = _dynamics(problem, active, protocol)((coefficients, inner))
    beside = alone._replace(slope=over_modes(of_mode, problem.base, -1), columns=n_columns)
    return follow(beside, alone, protocol, grid, _observation(problem, protocol))


def _dynamics(problem, active, protocol, cheaply=False):
    """Return the function from the numbers of a trial law to its modes, as the integrators take it.

    Parameters
    ----------
    cheaply
        Whether its tangents are to cost little, however many there are.
    """
    law = partial(_law_of_numbers, problem.library)
    known = Fluid(problem.base, problem.modulus, problem.relaxation_time, problem.solvent_viscosity)

    def make(numbers):
        def of_mode(base, stress, rate):
            if cheaply:
                return with_cheap_tangents(law, (active, base))(numbers, stress, rate)
            return law((active, base), numbers, stress, rate)

        # where the known law does not relax linearly, −σ is still the natural split, and the split
        # decides accuracy only
        dynamics = dynamics_of_fluid(known, protocol)._replace(linear_relaxation=True)
        return dynamics._replace(slope=over_modes(of_mode, problem.base, -1))

    return make


def _law_of_numbers(library, given, numbers, stress, rate):
    (active, base), (coefficients, inner) = given, numbers
    own = stress_in(stress)
    terms = evaluate_active(library, active, own, rate_of_deformation(rate), inner)
    added = as_state(contracted(coefficients, terms), stress)
    return base.stress_rate(stress, rate) - added


def _observation(problem, protocol):
    """Return what is seen of the modes: the recorded stress, N1 and N2, shape (3, *c)."""

    def observe(stress, gradient):
        total = contracted(stress[:4], problem.modulus)
        solvent = problem.solvent_viscosity * rate_of_deformation(gradient)
        # no number of the trial law changes the solvent
        total = total + solvent if total.ndim == 1 else total.at[:, 0].add(solvent)
        recorded = protocol.recorded_stress(total)
        return jnp.stack([recorded, total[0] - total[1], total[1] - total[2]])

    return observe


def _of_implicit_function(problem, active, coefficients, inner, protocol, grid):
    """Return what `_solve_run` does where a state, or the rate, is solved for."""

    def observed(*numbers):
        found = _observed(problem, active, numbers, protocol, grid)
        return found, found

    columns, value = jax.jacfwd(observed, argnums=(0, 1), has_aux=True)(coefficients, inner)
    return jnp.concatenate([value[..., None], *columns], axis=-1)


def _observed(problem, active, numbers, protocol, grid):
    """Return what is recorded, N1 and N2 of a trial law in one run, without sensitivities."""
    if protocol.control not in FOLLOWED:
        make = _dynamics(problem, active, protocol, cheaply=True)
        return solved_on_grid(make, numbers, protocol, grid, together=True).observed
    make = _dynamics(problem, active, protocol)
    fluids = make(numbers), make(without_derivatives(numbers))
    return follow(*fluids, protocol, grid, _observation(problem, protocol))


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
    modulus: Float[Array, "laws c"] | None = None,
) -> Float[Array, "laws rows"]:
    """Return the weighted predictions of many laws of the same terms, without sensitivities.

    Parameters as in `observe`, with a leading axis of laws, and moduli of each law in Pa, the
    solvent viscosity behind them or not, by default those of the problem. Not finite where a law
    runs away.
    """

    def run(problem, numbers, protocol, grid):
        return _observed(problem, active, numbers, protocol, grid)

    def law(numbers):
        coefficients, inner, modulus = numbers
        at = problem
        if modulus is not None:
            k, solvent = len(problem.modulus), problem.solvent_viscosity
            both = moduli_and_solvent(modulus, k, solvent)
            at = eqx.tree_at(lambda p: (p.modulus, p.solvent_viscosity), problem, both)
        predicted = problem.flows.over(partial(run, at, (coefficients, inner)))
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
