"""Periodic states of modes: where an oscillation in steady alternation begins, and its moduli."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float

from discover.forward.dynamics import Dynamics
from discover.forward.steady_states import (
    FROM_REST,
    Approximation,
    first_approximation,
    goes_on,
    next_approximation,
    relative_change,
)

# Most iterations for half a cycle, and the relative change below which the next step would change
# nothing that is seen: Newton's error goes as its square
MOST_CYCLES, NEWTON_STEP = 60, 1e-6

# The same for a whole cycle with which a run begins
MOST, TOLERANCE = 40, 1e-7

# Half a period later the flow is its own mirror image in the plane across it
_MIRROR = (1.0, 1.0, 1.0, -1.0)

# ωt at which what needs no steps is looked at: a stress beside the modes, a signal
PHASE = np.linspace(0.0, np.pi, 161)


def first_harmonic(
    stress: Float[Array, " s"], phase: Float[Array | np.ndarray, " s"]
) -> Complex[Array, ""]:
    """Return G′γ₀ + iG″γ₀ of a stress G′γ₀ sin ωt + G″γ₀ cos ωt + higher odd harmonics.

    G′ = (2/Tγ₀) ∫ σ sin ωt dt and G″ = (2/Tγ₀) ∫ σ cos ωt dt   [Hyun et al. 2011, Prog. Polym. Sci.
    36, 1697]. `stress` in Pa over half a cycle, its ends included. `phase`: ωt there, 0 to π,
    evenly spaced.
    """
    # of a periodic function the trapezoidal rule over a period is exact to all orders
    share = jnp.ones(stress.shape).at[jnp.array([0, -1])].set(0.5) / (len(stress) - 1)
    return 2j * jnp.sum(share * jnp.exp(-1j * phase) * stress)


def mirror(scalars: int, tensors: int) -> Float[np.ndarray, " s"]:
    """Return the signs by which a state with so many tensors and scalars behind σ is mirrored."""
    return np.concatenate([np.tile(_MIRROR, 1 + tensors), np.ones(scalars)])


class HalfCycle(NamedTuple):
    """Half a cycle: where it ends, mirrored, and σ12 in Pa at step ends, of all modes and each."""

    stress: Float[Array, "s k"]
    recorded: Float[Array, " s"]
    of_modes: Float[Array, "s k"]


def half_cycle(
    dynamics: Dynamics, wave: Float[Array, " m"], width: Float[Array, ""]
) -> Callable[[Float[Array, "s k"], Float[Array, ""]], HalfCycle]:
    """Return the function from state and strain amplitude to what half a cycle makes of them.

    `wave`: rate over strain amplitude at step ends and middles in turn. `width`: of a step in s.
    """
    weights = dynamics.weights(jnp.asarray(width)[None])[0]
    back = mirror(dynamics.variables - 4 * dynamics.tensors, dynamics.tensors)

    def half(stress, amplitude) -> HalfCycle:
        rate = amplitude * wave

        def step(stress, rates):
            stress = dynamics.stepped(weights, stress, rates, None)
            return stress, stress[3]

        end, later = jax.lax.scan(step, stress, (rate[:-2:2], rate[1::2], rate[2::2]))
        sheared = jnp.concatenate([stress[3][None], later])
        of_modes = sheared * dynamics.modes.modulus
        return HalfCycle(jnp.asarray(back)[:, None] * end, jnp.sum(of_modes, axis=-1), of_modes)

    return half


class _Solving(NamedTuple):
    """An approximation, its last change, and the derivatives of half a cycle and its harmonic."""

    modes: Approximation
    change: Float[Array, ""]
    jacobian: Float[Array, "k s s"]
    harmonics: Complex[Array, "s k"]


class PeriodicState(NamedTuple):
    """Where a cycle of an oscillation begins and ends, at zero strain, and its moduli."""

    stress: Float[Array, "s k"]  # dimensionless, of the modes, shape (s, k)
    modulus: Complex[Array, ""]  # G′ + iG″ in Pa of the first harmonic


def periodic_state(
    dynamics: Dynamics,
    fixed: Dynamics,
    strain: Float[Array, ""],
    frequency: Float[Array, ""],
    phase: Float[Array, " m"],
) -> PeriodicState:
    """Return the state that half a cycle and the mirror image bring back, and its moduli.

    With the derivatives of the implicit function; not finite where none is found. Newton's steps
    take the derivative along the components of each mode   [shooting and the modified Newton
    method: Stoer & Bulirsch 2002, Introduction to Numerical Analysis, sections 7.3 and 5.4].

    `fixed`: the fluid once more, through which no derivative passes. `phase`: ωt at step ends and
    middles in turn over half a cycle.
    """
    wave = frequency * jnp.cos(phase)
    width = (phase[2] - phase[0]) / frequency
    solve = half_cycle(fixed, wave, width)
    half = half_cycle(dynamics, wave, width)
    slowness = frequency * fixed.modes.relaxation_time

    def turned(now, unit):
        """Return where half a cycle ends, its harmonics, and how a direction moves both."""

        def of(stress):
            end = solve(stress, strain)
            of_mode = jax.vmap(first_harmonic, in_axes=(-1, None))
            return end.stress, of_mode(end.of_modes, phase[::2])

        direction = unit[:, None] * jnp.ones(now.shape)
        return jax.jvp(of, (now,), (direction,))

    def improved(now: _Solving) -> _Solving:
        units = jnp.eye(len(now.modes.stress))
        (end, _), (ends, harmonics) = jax.vmap(
            partial(turned, now.modes.stress), out_axes=(None, 0)
        )(units)
        jacobian = jnp.moveaxis(ends, 2, 0)
        following, better = next_approximation(now.modes, end, jacobian)
        change = relative_change(now.modes, following, slowness, NEWTON_STEP)
        change = jnp.where(jnp.all(better), change, jnp.inf)
        return _Solving(following, change, jacobian, harmonics)

    def hopeful(now: _Solving):
        return goes_on(now.modes, now.change, MOST_CYCLES, NEWTON_STEP)

    size, modes = fixed.rest().shape
    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(
        0, FROM_REST, lambda _, stress: solve(stress, strain).stress, fixed.rest()
    )
    end = jax.lax.while_loop(
        hopeful,
        improved,
        _Solving(
            first_approximation(begun, FROM_REST),
            jnp.asarray(jnp.inf),
            jnp.zeros((modes, size, size)),
            jnp.zeros((size, modes), dtype=complex),
        ),
    )
    end = jax.lax.stop_gradient(end)
    found = half(end.modes.stress, strain)
    # Newton's step from a solution moves it by nothing, and by θ as the implicit function does
    matrix = jnp.eye(size) - jnp.swapaxes(end.jacobian, 1, 2)
    step = jnp.linalg.solve(matrix, (found.stress - end.modes.stress).T[:, :, None])[:, :, 0].T
    recorded = found.recorded + dynamics.viscosity * strain * wave[::2]
    whole = first_harmonic(recorded, phase[::2]) + jnp.sum(end.harmonics * step)
    whole = jnp.where(end.change < NEWTON_STEP, whole / strain, jnp.nan)
    return PeriodicState(end.modes.stress + step, whole)


class _Iterate(NamedTuple):
    """An approximation to the modes, and by how much they moved last."""

    modes: Approximation
    change: Float[Array, ""]


def periodic_start(
    after_cycle: Callable[[Float[Array, "s k"]], Float[Array, "s k"]],
    rest: Float[Array, "s k"],
    slowness: Float[Array, " k"],
    is_periodic: Bool[Array, ""],
) -> Float[Array, "s k"]:
    """Return modes that a whole cycle brings back; not a number where none are found.

    Solved for and not waited for, by Newton's steps along the components of each mode, which change
    nearly by themselves   [shooting: Stoer & Bulirsch 2002, Introduction to Numerical Analysis,
    section 7.3; `next_approximation`].

    `after_cycle`: from modes to what they are a cycle later. `slowness`: relaxation times, in
    cycles. `is_periodic`: where not, `rest` is returned.
    """

    def improved(now: _Iterate) -> _Iterate:
        def along(unit):
            direction = unit[:, None] * jnp.ones(rest.shape)
            return jax.jvp(after_cycle, (now.modes.stress,), (direction,))

        after, slopes = jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(rest)))
        jacobian = jnp.moveaxis(slopes, 2, 0)  # mode, direction, component
        modes, better = next_approximation(now.modes, after, jacobian)
        change = relative_change(now.modes, modes, slowness, TOLERANCE)
        change = jnp.where(is_periodic, jnp.where(jnp.all(better), change, jnp.inf), 0.0)
        return _Iterate(modes, change)

    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(0, FROM_REST, lambda _, stress: after_cycle(stress), rest)
    end = jax.lax.while_loop(
        lambda now: goes_on(now.modes, now.change, MOST, TOLERANCE),
        improved,
        _Iterate(first_approximation(begun, FROM_REST), jnp.asarray(jnp.inf)),
    )
    found = jnp.where(end.change < TOLERANCE, end.modes.stress, jnp.nan)
    return jnp.where(is_periodic, found, rest)
