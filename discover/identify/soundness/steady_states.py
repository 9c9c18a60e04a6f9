"""Steady states of a law, followed from rest as the rate of deformation grows."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw
from discover.programs import compiled
from tensor_library.algebra import to_shear
from tensor_library.kinematics import uniaxial_extension

_NEWTON_STEPS = 25
_CONVERGED = 1e-9


@compiled
def steady_shear(
    law: AbstractConstitutiveLaw, rates: Float[Array, " n"]
) -> tuple[Float[Array, "n s"], Float[Array, "n s s"], Float[Array, " n"]]:
    """Return the steady dimensionless stresses in shear, their Jacobians and residuals.

    Newton's method at each rate from the solution at the one before, starting at rest: the branch
    that a slow rise of the rate follows.

    `rates`: dimensionless shear rates, increasing, close enough for Newton's method to follow.

    Returns stress (11, 22, 33, 12) with the law's structure variables behind it, ∂(dσ/dt)/∂σ, and
    the size of dσ/dt over that of the stress.
    """
    return _follow(law.stress_rate, law.rest(), rates)


@compiled
def steady_uniaxial_extension(
    law: AbstractConstitutiveLaw, rates: Float[Array, " n"]
) -> tuple[Float[Array, "n d"], Float[Array, "n d d"], Float[Array, " n"]]:
    """Return the steady (σ11, σ22 = σ33) in uniaxial extension, Jacobians and residuals.

    Behind these two stand the structure variables of the law.
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
