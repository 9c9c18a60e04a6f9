"""Half a cycle of oscillatory shear: where it ends, and the stress on the way."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Complex, Float, Int

from discover.forward.dynamics import Dynamics
from discover.forward.integrators.exponential_weights import relax
from discover.forward.starts.steady_states import (
    FROM_REST,
    Approximation,
    first_approximation,
    goes_on,
    next_approximation,
    relative_change,
)

# Half a period later the flow is its own mirror image in the plane across it
_MIRROR = (1.0, 1.0, 1.0, -1.0)


class HalfCycle(NamedTuple):
    """Half a cycle: where it ends, mirrored; what is left of each level; and σ12 on the way.

    `recorded`: its first harmonic where steps are counted, else its values at step ends.
    `of_modes`: these of each mode where asked for, without the factor of the states.
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


def first_harmonic(
    stress: Float[Array, " s"], phase: Float[Array | np.ndarray, " s"]
) -> Complex[Array, ""]:
    """Return G′γ₀ + iG″γ₀ of a stress G′γ₀ sin ωt + G″γ₀ cos ωt + higher odd harmonics.

    `stress` in Pa over half a cycle, its ends included. `phase`: ωt there, 0 to π, evenly spaced.
    """
    # of a periodic function the trapezoidal rule over a period is exact to all orders
    share = jnp.ones(stress.shape).at[jnp.array([0, -1])].set(0.5) / (len(stress) - 1)
    return 2j * jnp.sum(share * jnp.exp(-1j * phase) * stress)


def half_cycle(dynamics: Dynamics, wave, width, by_mode: bool = False):
    """Return the function from state and strain amplitude to what half a cycle makes of them.

    `wave`: rate over strain amplitude at step ends and middles in turn. `width`: of a step in s.
    """
    step, begun = _step(dynamics, width, 1 if by_mode else 4)

    def of_modes(stress):
        return stress[3] * dynamics.modes.modulus if by_mode else jnp.zeros(0)

    def half(stress, levels, amplitude) -> HalfCycle:
        rate = amplitude * wave

        def taken(carry: _Carry, rates):
            carry, recorded = step(carry, rates)
            return carry, (recorded, of_modes(carry.stress))

        start, first = begun(stress, levels, rate[0])
        end, (recorded, each) = jax.lax.scan(taken, start, (rate[:-2:2], rate[1::2], rate[2::2]))
        recorded = jnp.concatenate([first[None], recorded])
        each = jnp.concatenate([of_modes(stress)[None], each])
        return HalfCycle(
            _mirrored(dynamics, end), tuple(end.levels), tuple(end.left), recorded, each
        )

    return half


def counted_half_cycle(dynamics: Dynamics, frequency, steps):
    """Return the function from state and strain amplitude to what half a cycle makes of them.

    In as many steps as are asked for when it runs: no derivative goes backwards through it.
    """
    turn = jnp.pi / steps
    step, begun = _step(dynamics, turn / frequency, 4)

    def half(stress, levels, amplitude) -> HalfCycle:
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
        return HalfCycle(
            _mirrored(dynamics, end), tuple(end.levels), tuple(end.left), whole, jnp.zeros(0)
        )

    return half


def _of_harmonic(stress, phase, share) -> Float[Array, "2"]:
    """Return what a stress at ωt adds to the two parts of the first harmonic."""
    return 2.0 * share * stress * jnp.stack([jnp.sin(phase), jnp.cos(phase)])


def _mirrored(dynamics: Dynamics, end: _Carry) -> Float[Array, "s k"]:
    """Return the modes at the end of half a cycle as its mirror image begins with them."""
    scalars = dynamics.variables - 4 * dynamics.tensors
    return jnp.asarray(mirror(scalars, dynamics.tensors))[:, None] * end.stress


def mirror(scalars: int, tensors: int) -> Float[np.ndarray, " s"]:
    """Return the signs by which a state with so many tensors and scalars behind σ is mirrored."""
    return np.concatenate([np.tile(_MIRROR, 1 + tensors), np.ones(scalars)])


def _step(dynamics: Dynamics, width, unroll: int):
    """Return the functions that take one step, and that begin with the first.

    A step is of rates at its beginning, middle and end, and comes with σ12 at its end.
    """
    combined = dynamics.combined
    weights = dynamics.weights_alone(width)

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

        remainder = dynamics.stage(w, slow[1], None)
        felt = jnp.stack([first, middle, middle, last])
        factors = jnp.stack([slow[0], slow[1], slow[1], slow[2]])
        stress, _ = w.step(stress, lambda *given: (remainder(*given), ()), (felt, factors), unroll)
        after = combined("modulus_factor", at_end) * sheared(stress, middle)
        levels, kept = relaxed(levels, middle, 0.5 * (before + after), 1.0)
        left = [a * b for a, b in zip(left, kept, strict=True)]
        recorded = combined("modulus_factor", levels) * sheared(stress, last)
        return _Carry(stress, levels, left), recorded

    return step, begun


# Most iterations in all, and the relative change below which the next step would change nothing
# that is seen: Newton's error goes as its square
MOST, TOLERANCE = 40, 1e-7

Levels = tuple[Float[Array, "..."], ...]


class Cycle(NamedTuple):
    """The steps of the last cycle before the first sample; none of a run that is not periodic.

    `start`, `end`: positions of its first and last step ends.
    """

    start: Int[Array, ""]
    end: Int[Array, ""]
    steps: int  # the most that a run of the batch has in it, at least ``end − start``


class _Iterate(NamedTuple):
    """An approximation to modes and states, and by how much these and both together moved last."""

    modes: Approximation
    levels: Levels
    moved: Float[Array, ""]
    change: Float[Array, ""]


def periodic_start(
    after_cycle: Callable,
    rest: tuple[Float[Array, "s k"], Levels],
    slowness: Float[Array, " k"],
    is_periodic: Bool[Array, ""],
) -> tuple[Float[Array, "s k"], Levels]:
    """Return modes and states that a cycle brings back; not a number where none is found.

    Solved for and not waited for, by Newton's steps along the components of each mode and along
    each state, which change nearly by themselves   [shooting: Stoer & Bulirsch 2002, Introduction
    to Numerical Analysis, section 7.3; `next_approximation`].

    `after_cycle`: from modes and states to what they are a cycle later. `rest`: these at rest.
    `slowness`: relaxation times, in cycles. `is_periodic`: where not, rest is returned.
    """

    def with_derivative(stress, levels):
        def along(stress_direction, level_directions):
            (stress_end, levels_end), (stress_slope, level_slopes) = jax.jvp(
                after_cycle, (stress, levels), (stress_direction, level_directions)
            )
            return stress_end, levels_end, stress_slope, level_slopes

        own = len(stress)
        unit = jnp.eye(own + len(levels))
        directions = unit[:, :own, None] * jnp.ones((1, *stress.shape))
        of_levels = tuple(
            jnp.multiply.outer(unit[:, own + i], jnp.ones_like(level))
            for i, level in enumerate(levels)
        )
        ends, levels_ends, slopes, level_slopes = jax.vmap(along)(directions, of_levels)
        jacobian = jnp.moveaxis(slopes[:own], 2, 0)  # mode, direction, component
        of_own = tuple(slope[own + i] for i, slope in enumerate(level_slopes))
        return ends[0], tuple(level[0] for level in levels_ends), jacobian, of_own

    def improved(now: _Iterate) -> _Iterate:
        after, levels_after, jacobian, own = with_derivative(now.modes.stress, now.levels)
        modes, better = next_approximation(now.modes, after, jacobian, now.moved)
        levels = tuple(
            before + (end - before) / (1.0 - slope)
            for before, end, slope in zip(now.levels, levels_after, own, strict=True)
        )
        moves = [jnp.max(jnp.abs(a - b)) for a, b in zip(levels, now.levels, strict=True)]
        moved = jnp.max(jnp.stack([jnp.zeros(()), *moves]))
        largest = jnp.maximum(moved, relative_change(now.modes, modes, slowness, TOLERANCE))
        change = jnp.where(is_periodic, jnp.where(jnp.all(better), largest, jnp.inf), 0.0)
        return _Iterate(modes, levels, moved, change)

    # the cycles from rest need no derivative
    begun = jax.lax.fori_loop(0, FROM_REST, lambda _, state: after_cycle(*state), rest)
    never = jnp.asarray(jnp.inf)
    start = _Iterate(first_approximation(begun[0], FROM_REST), begun[1], jnp.zeros(()), never)
    end = jax.lax.while_loop(
        lambda now: goes_on(now.modes, now.change, MOST, TOLERANCE), improved, start
    )
    found = jnp.where(end.change < TOLERANCE, end.modes.stress, jnp.nan)
    stress, levels = rest
    levels = tuple(jnp.where(is_periodic, a, b) for a, b in zip(end.levels, levels, strict=True))
    return jnp.where(is_periodic, found, stress), levels
