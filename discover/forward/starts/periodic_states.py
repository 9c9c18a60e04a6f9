"""Periodic states of a fluid in oscillatory shear, and the moduli of their first harmonic."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from discover.forward.dynamics import Dynamics
from discover.forward.starts.half_cycles import (
    HalfCycle,
    counted_half_cycle,
    first_harmonic,
    half_cycle,
)
from discover.forward.starts.steady_states import (
    FROM_REST,
    Approximation,
    first_approximation,
    goes_on,
    next_approximation,
    relative_change,
)

# Most iterations in all, and the relative change of what is followed by iteration below which the
# next one would change nothing that is seen
MOST_CYCLES, _TOLERANCE = 60, 1e-8

# The same of the modes' steps: Newton's error goes as their square
NEWTON_STEP = 1e-6

# Bounds of the secant's slope
_SECANT = 0.2, 5.0

# ωt at which what needs no steps is looked at: a stress beside the modes, a signal
PHASE = np.linspace(0.0, np.pi, 161)


class _Iterate(NamedTuple):
    """An approximation to the state at zero strain, and what is felt there of the amplitude."""

    modes: Approximation
    levels: tuple[Float[Array, "..."], ...]
    felt: Float[Array, ""]
    felt_before: Float[Array, ""]
    lacking_before: Float[Array, ""]
    moved: Float[Array, ""]
    change: Float[Array, ""]


def complex_modulus(
    dynamics: Dynamics,
    strain: Float[Array, ""],
    frequency: Float[Array, ""],
    steps: Int[Array, ""],
    beside: Callable[[Float[Array, " s"]], Float[Array, " s"]],
) -> Complex[Array, ""]:
    """Return G′ + iG″ in Pa of the first harmonic at a strain γ₀ sin ωt of the tool.

    The periodic state is solved for: the fixed point of half a cycle and the mirror image that half
    a period is in simple shear. Newton's steps take the derivative along the components of each
    mode   [shooting and the modified Newton method: Stoer & Bulirsch 2002, Introduction to
    Numerical Analysis, sections 7.3 and 5.4]. Not finite where this does not converge.

    G′ = (2/Tγ₀) ∫ σ sin ωt dt and G″ = (2/Tγ₀) ∫ σ cos ωt dt   [Hyun et al. 2011, Prog. Polym. Sci.
    36, 1697]. Slip and compliance in series take their share of the first harmonic alone.

    `steps`: over half a cycle. `beside`: recorded stress beside the modes in Pa, of rates in 1/s.
    """
    half = counted_half_cycle(dynamics, frequency, steps)

    def modulus(found: HalfCycle, felt):
        rate = felt * frequency * jnp.cos(PHASE)
        return (found.recorded + first_harmonic(beside(rate), PHASE)) / felt

    def taken(whole):
        """Return by how much the tool turns further than the fluid."""
        series = dynamics.series
        if series is None:
            return jnp.ones((), dtype=complex)
        return 1.0 + (series.compliance + series.slip / (1j * frequency)) * whole

    def improved(now: _Iterate) -> _Iterate:
        found, jacobian = _end_with_derivative(half, now.modes.stress, now.levels, now.felt)
        modes, better = next_approximation(now.modes, found.stress, jacobian, now.moved)
        return moved_to(now, found, modes, better)

    def followed(_, now: _Iterate) -> _Iterate:
        """Return where half a cycle ends: those from rest need no derivative."""
        found = half(now.modes.stress, now.levels, now.felt)
        modes = first_approximation(found.stress, FROM_REST)
        return moved_to(now, found, modes, jnp.asarray(True))

    def moved_to(now: _Iterate, found: HalfCycle, modes: Approximation, better) -> _Iterate:
        levels = tuple(
            # what a cycle adds and leaves decides where a level comes to rest
            (after - left * before) / (1.0 - left)
            for before, after, left in zip(now.levels, found.levels, found.left, strict=True)
        )
        felt, lacking = next_felt(now, found)
        slowness = frequency * dynamics.modes.relaxation_time
        changes = [
            _TOLERANCE / NEWTON_STEP * relative_change(now.modes, modes, slowness, NEWTON_STEP),
            jnp.abs(felt / now.felt - 1.0),
            *(jnp.max(jnp.abs(a - b)) for a, b in zip(levels, now.levels, strict=True)),
        ]
        return _Iterate(
            modes=modes,
            levels=levels,
            felt=felt,
            felt_before=now.felt,
            lacking_before=lacking,
            moved=jnp.max(jnp.stack(changes[1:])),
            change=jnp.where(jnp.all(better), jnp.max(jnp.stack(changes)), jnp.inf),
        )

    def next_felt(now: _Iterate, found: HalfCycle):
        """Return the next amplitude that the fluid feels, by the secant, and what it lacked."""
        if dynamics.series is None:
            return now.felt, now.lacking_before
        lacking = jnp.log(strain / now.felt) - jnp.log(jnp.abs(taken(modulus(found, now.felt))))
        lacking = jnp.where(jnp.isfinite(lacking), lacking, 0.0)
        passed = jnp.log(now.felt / now.felt_before)
        slope = (now.lacking_before - lacking) / jnp.where(passed == 0.0, 1.0, passed)
        # 1 of a linear fluid; small of one that thins and gives way
        slope = jnp.where(passed == 0.0, 1.0, jnp.clip(slope, *_SECANT))
        return now.felt * jnp.exp(lacking / slope), lacking

    stress, levels = dynamics.rest()
    amplitude, zero = jnp.asarray(strain), jnp.zeros(())
    start = _Iterate(
        modes=first_approximation(stress),
        levels=levels,
        felt=amplitude,
        felt_before=amplitude,
        lacking_before=zero,
        moved=zero,
        change=jnp.asarray(jnp.inf),
    )
    end = jax.lax.while_loop(
        lambda now: goes_on(now.modes, now.change, MOST_CYCLES, _TOLERANCE),
        improved,
        jax.lax.fori_loop(0, FROM_REST, followed, start),
    )
    whole = modulus(half(end.modes.stress, end.levels, end.felt), end.felt)
    found = whole / taken(whole)
    return jnp.where(end.change < _TOLERANCE, found, jnp.nan)


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
    """Return what `complex_modulus` solves for, of modes alone, with implicit derivatives.

    `fixed`: the fluid once more, through which no derivative passes.
    """
    wave = frequency * jnp.cos(phase)
    width = (phase[2] - phase[0]) / frequency
    solve = half_cycle(fixed, wave, width, by_mode=True)
    half = half_cycle(dynamics, wave, width, by_mode=True)
    slowness = frequency * fixed.modes.relaxation_time

    def turned(now, unit):
        """Return where half a cycle ends, its harmonics, and how a direction moves both."""

        def of(stress):
            end = solve(stress, (), strain)
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

    size, modes = fixed.rest()[0].shape
    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(
        0, FROM_REST, lambda _, stress: solve(stress, (), strain).stress, fixed.rest()[0]
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
    found = half(end.modes.stress, (), strain)
    # Newton's step from a solution moves it by nothing, and by θ as the implicit function does
    matrix = jnp.eye(size) - jnp.swapaxes(end.jacobian, 1, 2)
    step = jnp.linalg.solve(matrix, (found.stress - end.modes.stress).T[:, :, None])[:, :, 0].T
    recorded = found.recorded + dynamics.viscosity * strain * wave[::2]
    whole = first_harmonic(recorded, phase[::2]) + jnp.sum(end.harmonics * step)
    whole = jnp.where(end.change < NEWTON_STEP, whole / strain, jnp.nan)
    return PeriodicState(end.modes.stress + step, whole)


def _end_with_derivative(half, stress, levels, felt) -> tuple[HalfCycle, Float[Array, "k s s"]]:
    """Return half a cycle, and of each mode the derivative of its end: direction, component."""

    def along(unit):
        direction = unit[:, None] * jnp.ones(stress.shape)
        end, moved = jax.jvp(lambda stress: half(stress, levels, felt), (stress,), (direction,))
        return end, moved.stress

    found, tangents = jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(stress)))
    return found, jnp.moveaxis(tangents, 2, 0)
