"""Half a cycle of oscillatory shear: where it ends, and the stress on the way."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from discover.forward.dynamics import Dynamics
from discover.forward.integrators.exponential_weights import relax

# Half a period later the flow is its own mirror image in the plane across it
_MIRROR = (1.0, 1.0, 1.0, -1.0)


class HalfCycle(NamedTuple):
    """Half a cycle: where it ends, mirrored; what is left of each level; and σ12 on the way.

    `recorded`: its first harmonic where steps are counted, shape (), else its values at step ends,
        (s,).
    `of_modes`: these of each mode, where they are asked for, without the factor of the states,
        shape (s, k).
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

    `dynamics`: the fluid. `wave`: rate over strain amplitude at step ends and middles in turn.
    `width`: of a step in s. `by_mode`: whether stresses of each mode are asked for too.
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
