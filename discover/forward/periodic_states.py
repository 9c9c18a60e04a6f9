"""Periodic states of a fluid in oscillatory shear, and the moduli of their first harmonic."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float, Int

from discover.forward.dynamics import Dynamics
from discover.simulate.exponential_runge_kutta import relax
from discover.simulate.modified_newton import (
    FROM_REST,
    Approximation,
    first_approximation,
    goes_on,
    next_approximation,
    relative_change,
)

# Most iterations in all, and the relative change of what is followed by iteration below which the
# next one would change nothing that is seen
_MOST, _TOLERANCE = 60, 1e-8

# The same of the modes' steps: Newton's error goes as their square
_STEP = 1e-6

# Of a change beside the modes, what it may add to their misfit; and bounds of the secant's slope
_SHARE, _SECANT = 10.0, (0.2, 5.0)

# Half a period later the flow is its own mirror image in the plane across it
_MIRROR = (1.0, 1.0, 1.0, -1.0)


# ωt at which what needs no steps is looked at: a stress beside the modes, a signal
PHASE = np.linspace(0.0, np.pi, 161)


class _Half(NamedTuple):
    """Half a cycle: where it ends, mirrored; what is left of each level; and σ12 on the way.

    Attributes
    ----------
    recorded
        Its first harmonic where steps are counted, shape (), else its values at step ends, (s,).
    of_modes
        These of each mode, where they are asked for, without the factor of the states, shape
        (s, k).
    """

    stress: Float[Array, "s k"]
    levels: tuple[Float[Array, "..."], ...]
    left: tuple[Float[Array, "..."], ...]
    recorded: Complex[Array, ""] | Float[Array, " s"]
    of_modes: Float[Array, "s k"]


class _Carry(NamedTuple):
    """What a step changes: the modes, the levels, and what is left of each of these so far."""

    stress: Float[Array, "s k"]
    levels: list[Float[Array, "..."]]
    left: list[Float[Array, "..."]]


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

    The periodic state is solved for and not waited for: it is the fixed point of half a cycle
    followed by the mirror image that half a period is in simple shear. Newton's steps take the
    derivative of that map along the components of each mode, which change by themselves; a
    step that leads astray is shortened   [shooting and the modified Newton method: Stoer & Bulirsch
    2002, Introduction to Numerical Analysis, sections 7.3 and 5.4]. Not finite where this does not
    converge.

    G′ = (2/Tγ₀) ∫ σ sin ωt dt and G″ = (2/Tγ₀) ∫ σ cos ωt dt   [Hyun et al. 2011, Prog. Polym. Sci.
    36, 1697]. Slip and compliance in series take their share of the first harmonic; that they also
    feel the higher ones is neglected.

    Parameters
    ----------
    dynamics
        The fluid, with what gives way in series with it.
    strain, frequency
        Amplitude γ₀ and ω in rad/s.
    steps
        Over half a cycle.
    beside
        Recorded stress beside the modes in Pa, of rates in 1/s.
    """
    half = _counted_half_cycle(dynamics, frequency, steps)

    def modulus(found: _Half, felt):
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
        # what changed beside the modes since may cost its share
        modes, better = next_approximation(now.modes, found.stress, jacobian, _SHARE * now.moved)
        return moved_to(now, found, modes, better)

    def followed(_, now: _Iterate) -> _Iterate:
        """Return where half a cycle ends: those from rest need no derivative."""
        found = half(now.modes.stress, now.levels, now.felt)
        modes = first_approximation(found.stress, FROM_REST)
        return moved_to(now, found, modes, jnp.asarray(True))

    def moved_to(now: _Iterate, found: _Half, modes: Approximation, better) -> _Iterate:
        levels = tuple(
            # what a cycle adds and leaves decides where a level comes to rest
            (after - left * before) / (1.0 - left)
            for before, after, left in zip(now.levels, found.levels, found.left, strict=True)
        )
        felt, lacking = next_felt(now, found)
        slowness = frequency * dynamics.modes.relaxation_time
        changes = [
            _TOLERANCE / _STEP * relative_change(now.modes, modes, slowness, _STEP),
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

    def next_felt(now: _Iterate, found: _Half):
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
        lambda now: goes_on(now.modes, now.change, _MOST, _TOLERANCE),
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
    """Where a cycle of an oscillation begins and ends, at zero strain, and its moduli.

    Attributes
    ----------
    stress
        Dimensionless, of the modes, shape (s, k).
    modulus
        G′ + iG″ in Pa of the first harmonic.
    """

    stress: Float[Array, "s k"]
    modulus: Complex[Array, ""]


def periodic_state(
    dynamics: Dynamics,
    fixed: Dynamics,
    strain: Float[Array, ""],
    frequency: Float[Array, ""],
    phase: Float[Array, " m"],
    together: str | None = None,
) -> PeriodicState:
    """Return what `complex_modulus` solves for, of modes alone, with derivatives in both modes.

    They are those of the implicit function: none passes through the iteration.

    Parameters
    ----------
    dynamics
        The fluid; no state changes with it, and nothing gives way in series.
    fixed
        The same, through which no derivative passes.
    strain, frequency, phase
        As in `complex_modulus`.
    together
        The name of an axis of states that are of use only together, over which this is mapped: once
        one of them is given up, so are the others.
    """
    wave = frequency * jnp.cos(phase)
    width = (phase[2] - phase[0]) / frequency
    solve = _half_cycle(fixed, wave, width, by_mode=True)
    half = _half_cycle(dynamics, wave, width, by_mode=True)
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
        change = relative_change(now.modes, following, slowness, _STEP)
        change = jnp.where(jnp.all(better), change, jnp.inf)
        return _Solving(following, change, jacobian, harmonics)

    def hopeful(now: _Solving):
        further = goes_on(now.modes, now.change, _MOST, _STEP)
        if together is None:
            return further
        given_up = ~further & ~(now.change < _STEP)
        return further & (jax.lax.pmax(given_up.astype(int), together) == 0)

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
    whole = jnp.where(end.change < _STEP, whole / strain, jnp.nan)
    return PeriodicState(end.modes.stress + step, whole)


def first_harmonic(
    stress: Float[Array, " s"], phase: Float[Array | np.ndarray, " s"]
) -> Complex[Array, ""]:
    """Return G′γ₀ + iG″γ₀ of a stress G′γ₀ sin ωt + G″γ₀ cos ωt + higher odd harmonics.

    Parameters
    ----------
    stress
        In Pa over half a cycle, its ends included.
    phase
        ωt there, 0 to π, evenly spaced.
    """
    # of a periodic function the trapezoidal rule over a period is exact to all orders
    share = jnp.ones(stress.shape).at[jnp.array([0, -1])].set(0.5) / (len(stress) - 1)
    return 2j * jnp.sum(share * jnp.exp(-1j * phase) * stress)


def _end_with_derivative(half, stress, levels, felt) -> tuple[_Half, Float[Array, "k s s"]]:
    """Return half a cycle, and of each mode the derivative of its end: direction, component."""

    def along(unit):
        direction = unit[:, None] * jnp.ones(stress.shape)
        end, moved = jax.jvp(lambda stress: half(stress, levels, felt), (stress,), (direction,))
        return end, moved.stress

    found, tangents = jax.vmap(along, out_axes=(None, 0))(jnp.eye(len(stress)))
    return found, jnp.moveaxis(tangents, 2, 0)


def _half_cycle(dynamics: Dynamics, wave, width, by_mode: bool = False):
    """Return the function from state and strain amplitude to what half a cycle makes of them.

    Parameters
    ----------
    dynamics
        The fluid.
    wave
        Rate over strain amplitude at step ends and middles in turn.
    width
        Of a step in s.
    by_mode
        Whether stresses of each mode are asked for too.
    """
    step, begun = _step(dynamics, width, 1 if by_mode else 4)

    def of_modes(stress):
        return stress[3] * dynamics.modes.modulus if by_mode else jnp.zeros(0)

    def half(stress, levels, amplitude) -> _Half:
        rate = amplitude * wave

        def taken(carry: _Carry, rates):
            carry, recorded = step(carry, rates)
            return carry, (recorded, of_modes(carry.stress))

        start, first = begun(stress, levels, rate[0])
        end, (recorded, each) = jax.lax.scan(taken, start, (rate[:-2:2], rate[1::2], rate[2::2]))
        recorded = jnp.concatenate([first[None], recorded])
        each = jnp.concatenate([of_modes(stress)[None], each])
        return _Half(_mirrored(dynamics, end), tuple(end.levels), tuple(end.left), recorded, each)

    return half


def _counted_half_cycle(dynamics: Dynamics, frequency, steps):
    """Return the function from state and strain amplitude to what half a cycle makes of them.

    In as many steps as are asked for when it runs: no derivative goes backwards through it.
    """
    turn = jnp.pi / steps
    step, begun = _step(dynamics, turn / frequency, 4)

    def half(stress, levels, amplitude) -> _Half:
        def rate(number):
            return amplitude * frequency * jnp.cos(turn * number)

        def taken(number, state):
            carry, harmonic = state
            carry, recorded = step(carry, (rate(number), rate(number + 0.5), rate(number + 1.0)))
            share = jnp.where(number + 1 == steps, 0.5, 1.0) / steps
            return carry, harmonic + _of_harmonic(recorded, turn * (number + 1.0), share)

        start, first = begun(stress, levels, rate(0.0))
        harmonic = _of_harmonic(first, 0.0, 0.5 / steps)
        end, harmonic = jax.lax.fori_loop(0, steps, taken, (start, harmonic))
        whole = jax.lax.complex(*harmonic)
        return _Half(
            _mirrored(dynamics, end), tuple(end.levels), tuple(end.left), whole, jnp.zeros(0)
        )

    return half


def _of_harmonic(stress, phase, share) -> Float[Array, "2"]:
    """Return what a stress at ωt adds to the two parts of the first harmonic."""
    return 2.0 * share * stress * jnp.stack([jnp.sin(phase), jnp.cos(phase)])


def _mirrored(dynamics: Dynamics, end: _Carry) -> Float[Array, "s k"]:
    """Return the modes at the end of half a cycle as its mirror image begins with them."""
    tensors = jnp.tile(jnp.array(_MIRROR), 1 + dynamics.tensors)
    mirror = jnp.ones(4 + dynamics.variables).at[: len(tensors)].set(tensors)[:, None]
    return mirror * end.stress


def _step(dynamics: Dynamics, width, unroll: int):
    """Return the functions that take one step, and that begin with the first.

    A step is of rates at its beginning, middle and end, and comes with σ12 at its end.
    """
    combined = dynamics.combined
    weights = tuple(piece[0] for piece in dynamics.weights(width[None]))

    def relaxed(levels, rate, stress, share):
        pairs = [e.source_and_decay(v, rate, stress) for e, v in dynamics.states.items()]
        after = [
            relax(source, decay, level, share * width)
            for (source, decay), level in zip(pairs, levels, strict=True)
        ]
        return after, [jnp.exp(-decay * share * width) for _, decay in pairs]

    def sheared(stress, rate):
        return dynamics.sheared(stress, rate, None)[0]

    def begun(stress, levels, rate) -> tuple[_Carry, Float[Array, ""]]:
        recorded = combined("modulus_factor", levels) * sheared(stress, rate)
        return _Carry(stress, list(levels), [jnp.ones_like(level) for level in levels]), recorded

    def step(carry: _Carry, rates) -> tuple[_Carry, Float[Array, ""]]:
        stress, levels, left = carry
        first, middle, last = rates
        before = combined("modulus_factor", levels) * sheared(stress, middle)
        halfway, _ = relaxed(levels, middle, before, 0.5)
        at_end, _ = relaxed(levels, middle, before, 1.0)
        slow = [combined("time_factor", some) for some in (levels, halfway, at_end)]
        w = dynamics.weights_of_step(weights, width, slow[1])

        def stage(stress, given):
            rate, now = given
            change = slow[1] * dynamics.change(stress, rate, now, None)
            return w.remainder(stress, change, dynamics.decay), ()

        felt = jnp.stack([first, middle, middle, last])
        factors = jnp.stack([slow[0], slow[1], slow[1], slow[2]])
        stress, _ = w.step(stress, stage, (felt, factors), unroll)
        after = combined("modulus_factor", at_end) * sheared(stress, middle)
        levels, kept = relaxed(levels, middle, 0.5 * (before + after), 1.0)
        left = [a * b for a, b in zip(left, kept, strict=True)]
        recorded = combined("modulus_factor", levels) * sheared(stress, last)
        return _Carry(stress, levels, left), recorded

    return step, begun
