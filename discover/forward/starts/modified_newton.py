"""Newton's method for states that a cycle of flow brings back, each mode by itself."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

FROM_REST = 2
"""Cycles from rest before Newton's steps."""

# A step that made things worse is tried again this much shorter; below the other, it is rounding
_SHORTER, _EXACT = 0.25, 1e-12

# Of a mode that relaxes over many cycles, a cycle tells so little that rounding moves the step
_STATE_ROUNDING = 1e-13

# Of a change beside the modes, what it may add to their misfit
_BESIDE = 10.0

# Five steps in a row that led astray: of sixty laws at six strengths none came round later than
# that, but for states at the very edge of those that there are
_HOPELESS = 5e-4


class Approximation(NamedTuple):
    """An approximation to the modes, and the best one of each that was tried.

    `stress`, `best`: dimensionless, shape (s, k): four components of σ, and structure variables.
    `best_misfit`, `best_step`: what a cycle changes in the best one, relative, and Newton's step
        from it.
    """

    stress: Float[Array, "s k"]
    best: Float[Array, "s k"]
    best_misfit: Float[Array, " k"]
    best_step: Float[Array, "s k"]
    share: Float[Array, " k"]  # of that step that is taken
    number: Float[Array, ""]  # of cycles gone through


def first_approximation(stress: Float[Array, "s k"], number: int = 0) -> Approximation:
    """Return where the iteration begins, after so many cycles from rest."""
    free = jnp.full(stress.shape[1], jnp.inf)
    return Approximation(
        stress=stress,
        best=stress,
        best_misfit=free,
        best_step=jnp.zeros_like(stress),
        share=jnp.ones_like(free),
        number=jnp.asarray(float(number)),
    )


def next_approximation(
    now: Approximation,
    after: Float[Array, "s k"],
    jacobian: Float[Array, "k s s"],
    moved: Float[Array, ""] | float = 0.0,
) -> tuple[Approximation, Bool[Array, " k"]]:
    """Return the next approximation, and of which modes this one was better than all before.

    A step that leads astray is shortened   [modified Newton method: Stoer & Bulirsch 2002,
    Introduction to Numerical Analysis, section 5.4].

    `now`, `after`: the modes, and what a cycle makes of them. `jacobian`: of that in these, for
    each mode: direction, component. `moved`: by how much something beside the modes has changed
    since, a state or what is felt. It puts the modes off, which is no step of theirs that led
    astray.
    """
    difference = after - now.stress
    misfit = _size(difference) / (1.0 + _size(now.stress))
    begins = now.number <= FROM_REST
    # never where it is not a number
    better = (misfit <= now.best_misfit + _BESIDE * moved) | (misfit < _EXACT)
    better = better | (begins & jnp.isfinite(misfit))
    matrix = jnp.eye(len(after)) - jnp.swapaxes(jacobian, 1, 2)
    step = jnp.linalg.solve(matrix, difference.T[:, :, None])[:, :, 0].T
    step = jnp.where(now.number < FROM_REST, difference, step)
    step = jnp.where(better, step, now.best_step)
    best = jnp.where(better, now.stress, now.best)
    share = jnp.where(better, 1.0, _SHORTER * now.share)
    following = Approximation(
        stress=best + share * step,
        best=best,
        best_misfit=jnp.where(better, misfit, now.best_misfit),
        best_step=step,
        share=share,
        number=now.number + 1.0,
    )
    return following, better


def goes_on(
    now: Approximation, change: Float[Array, ""], most: int, tolerance: float
) -> Bool[Array, ""]:
    """Return whether to go through another cycle."""
    begins = now.number <= FROM_REST
    hopeful = (now.number < most) & (jnp.min(now.share) > _HOPELESS)
    return begins | (hopeful & ~(change < tolerance))


def relative_change(
    now: Approximation, following: Approximation, slowness: Float[Array, " k"], tolerance: float
) -> Float[Array, ""]:
    """Return how far the modes moved, relative, but for what rounding moves of slow ones.

    `now`, `following`: approximations one after the other. `slowness`: relaxation time of each mode
    over that of a cycle. `tolerance`: change below which the iteration ends.
    """
    told = 1.0 + _STATE_ROUNDING / tolerance * slowness
    moved = _size(following.stress - now.stress) / (1.0 + _size(now.stress))
    return jnp.max(moved / told)


def _size(stress: Float[Array, "s k"]) -> Float[Array, " k"]:
    return jnp.max(jnp.abs(stress), axis=0)
