"""Flows in which laws are checked, many at once."""

from collections.abc import Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.equations.equation import mean_relaxation_time
from discover.forward.flow_batch import FlowBatch, lay_out
from discover.forward.fluids import at_samples, in_enough_steps, solve_batch
from discover.laws import AbstractConstitutiveLaw, Fluid
from discover.laws.each_mode import over_modes
from discover.programs import compiled
from discover.protocols.protocol import oscillatory_shear
from discover.words import plainly
from tensor_library import to_shear, uniaxial_extension

_CYCLES = 3
_SAMPLES_A_CYCLE = 48


@dataclass(frozen=True)
class Trajectories:
    """Conformation and dissipation of each mode along flows, least over modes and samples.

    `smallest_conformation`: eigenvalue of I + σ/G, shape (runs,); nan where the law diverges.
    `dissipation`: σ:d − dF/dt over G/λ, with the energy F of Hookean dumbbells; nan if undefined.
    """

    smallest_conformation: Float[np.ndarray, " runs"]
    dissipation: Float[np.ndarray, " runs"]

    @staticmethod
    def lowest(values: Float[np.ndarray, " runs"]) -> tuple[int | None, float]:
        """Return the run with the smallest value, and the value; None where there is none."""
        if not np.any(np.isfinite(values)):
            return None, float("nan")
        run = int(np.nanargmin(values))
        return run, float(values[run])


def trajectories(fluid: Fluid, flows: FlowBatch) -> Trajectories:
    """Return conformation and dissipation of a fluid along flows."""
    states, smallest, dissipation = (np.asarray(part) for part in _along(fluid, flows))
    sampled = np.asarray(flows.sample_mask)[..., None]
    whole = np.all(np.isfinite(states), axis=(1, 2, 3))
    smallest = np.where(sampled, smallest, np.inf).min(axis=(1, 2))
    # without a positive definite conformation the stored energy is not defined
    defined = np.where(sampled, dissipation, np.inf).min(axis=(1, 2))
    return Trajectories(
        np.where(whole, smallest, np.nan), np.where(whole & (smallest > 0.0), defined, np.nan)
    )


@compiled
def _along(fluid, flows):
    def one(protocol, grid):
        _, states, rates = at_samples(fluid, protocol, grid)
        at_mode = over_modes(_energy, fluid.law)
        scaled = rates[:, None] * fluid.relaxation_time
        smallest, dissipation = jax.vmap(at_mode)(states, scaled)
        return states, smallest, dissipation

    return flows.over(one)


def _energy(law, stress, rate):
    """Return the smallest eigenvalue of A = I + σ and the dissipation σ:d − dF/dt, dimensionless.

    F = (tr A − ln det A − 3)/2, so that dF/dt = tr((I − A⁻¹)·dA/dt)/2   [Beris & Edwards 1994,
    Thermodynamics of Flowing Systems; Wapperom & Hulsen 1998, J. Rheol. 42, 999].
    """
    change = law.stress_rate(stress, rate)
    a11, a22, a33, a12 = 1.0 + stress[0], 1.0 + stress[1], 1.0 + stress[2], stress[3]
    determinant = a11 * a22 - a12**2
    middle, radius = 0.5 * (a11 + a22), jnp.hypot(0.5 * (a11 - a22), a12)
    smallest = jnp.minimum(middle - radius, a33)
    trace = change[0] + change[1] + change[2]
    inverse = (a22 * change[0] + a11 * change[1] - 2.0 * a12 * change[3]) / determinant
    stored = 0.5 * (trace - inverse - change[2] / a33)
    return smallest, stress[3] * rate - stored


@dataclass(frozen=True)
class Cycles:
    """Oscillations over a grid of Weissenberg and Deborah numbers.

    `work`: ∫ σ12 γ̇ dt over the last cycle, over its length and the largest stress and rate; nan
    where the law diverges.
    """

    names: tuple[str, ...]  # of the flows, Weissenberg number first
    work: Float[np.ndarray, " flows"]


def time_scale(fluid: Fluid) -> float:
    """Return Σ G λ² / Σ G λ in s."""
    return mean_relaxation_time(np.asarray(fluid.modulus), np.asarray(fluid.relaxation_time))


def cycles(fluid: Fluid, weissenberg: Sequence[float], deborah: Sequence[float]) -> Cycles:
    """Return three cycles of every pair of Wi and De (with the mean relaxation time)."""
    scale = time_scale(fluid)
    pairs = [(wi, de) for wi in weissenberg for de in deborah]
    flows = [oscillatory_shear(wi / scale, de / scale) for wi, de in pairs]
    times = [
        np.linspace(0.0, _CYCLES * 2.0 * np.pi * scale / de, _CYCLES * _SAMPLES_A_CYCLE + 1)
        for _, de in pairs
    ]
    laid_out = in_enough_steps(fluid, lay_out(flows, times, strain_step=0.2))
    stress = np.asarray(solve_batch(fluid, laid_out))[..., 3]
    work = np.full(len(pairs), np.nan)
    for i, ((wi, de), t) in enumerate(zip(pairs, times, strict=True)):
        values = stress[i, : t.size]
        if not np.all(np.isfinite(values)):
            continue
        last = slice(t.size - 1 - _SAMPLES_A_CYCLE, None)
        rate = wi / scale * np.cos(de / scale * t[last])
        largest = np.max(np.abs(values[last])) * wi / scale
        # equally spaced samples over a whole period: the trapezoidal rule is exact to rounding
        power = np.mean((values[last] * rate)[:-1])
        work[i] = power / largest if largest > 0 else 0.0
    return Cycles(
        tuple(f"oscillation at Wi = {plainly(wi)}, De = {plainly(de)}" for wi, de in pairs), work
    )


_NEWTON_STEPS = 25
_CONVERGED = 1e-9


@compiled
def steady_shear(
    law: AbstractConstitutiveLaw, rates: Float[Array, " n"]
) -> tuple[Float[Array, "n s"], Float[Array, "n s s"], Float[Array, " n"]]:
    """Return the steady dimensionless stresses in shear, their Jacobians and residuals.

    Newton's method at each of the increasing rates from the one before, starting at rest: the
    branch that a slow rise of the rate follows. Stresses (11, 22, 33, 12) with the structure
    variables behind, ∂(dσ/dt)/∂σ, and the size of dσ/dt over that of the stress.
    """
    return _follow(law.stress_rate, law.rest(), rates)


@compiled
def steady_uniaxial_extension(
    law: AbstractConstitutiveLaw, rates: Float[Array, " n"]
) -> tuple[Float[Array, "n d"], Float[Array, "n d d"], Float[Array, " n"]]:
    """Return the steady (σ11, σ22 = σ33) in uniaxial extension, Jacobians and residuals.

    Structure variables stand behind these two.
    """

    def slope(state, rate):
        stress = jnp.stack([state[0], state[1], state[1], jnp.zeros(())])
        gradient = to_shear(uniaxial_extension(rate))
        change = law.stress_rate(jnp.concatenate([stress, state[2:]]), gradient)
        return jnp.concatenate([change[:2], change[4:]])

    return _follow(slope, law.rest()[2:], rates)


def _follow(slope, start, rates):
    def at(stress, rate):
        def improve(state, _):
            jacobian = jax.jacfwd(slope)(state, rate)
            return state - jnp.linalg.solve(jacobian, slope(state, rate)), None

        found, _ = jax.lax.scan(improve, stress, None, length=_NEWTON_STEPS)
        residual = jnp.linalg.norm(slope(found, rate)) / (1.0 + jnp.linalg.norm(found))
        # what did not converge does not lead the next rate astray
        good = jnp.isfinite(residual) & (residual < _CONVERGED)
        following = jnp.where(good, found, stress)
        return following, (found, jax.jacfwd(slope)(found, rate), residual)

    return jax.lax.scan(at, start, rates)[1]


def is_steady(residual: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return where Newton's method converged."""
    return np.isfinite(residual) & (residual < _CONVERGED)


def is_stable(jacobian: Float[np.ndarray, "n d d"]) -> np.ndarray:
    """Return where every small homogeneous disturbance decays: no eigenvalue with Re ≥ 0."""
    finite = np.all(np.isfinite(jacobian), axis=(1, 2))
    safe = np.where(finite[:, None, None], jacobian, np.eye(jacobian.shape[-1]))
    return finite & (np.max(np.linalg.eigvals(safe).real, axis=1) < 0.0)
