"""The fluid and what gives way in series with it, as the integrators take them."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from discover.effects import StateEffect
from discover.forward.integrators.exponential_weights import StressWeights, krogstad_weights, relax
from discover.protocols.kinematics import Kinematics
from tensor_library.algebra import contracted

Levels = tuple[Float[Array, "..."], ...]
"""States of the fluid."""


class Modes(NamedTuple):
    """Modes: moduli in Pa, relaxation times in s, both shape (k,)."""

    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]


class Series(NamedTuple):
    """Elements in series with the fluid: slip s in 1/(Pa s) and compliance C in 1/Pa.

    `slip_by_stress`: further slip at a stress in Pa; None for nothing.
    """

    slip: Float[Array, ""]
    compliance: Float[Array, ""]
    slip_by_stress: Callable[[Float[Array, ""]], Float[Array, ""]] | None = None

    def slip_at(self, stress: Float[Array, ""]) -> Float[Array, ""]:
        """Return s at a stress in Pa."""
        return self.slip if self.slip_by_stress is None else self.slip + self.slip_by_stress(stress)


class Dynamics(NamedTuple):
    """How the modes change, and what changes with them.

    `slope`: dimensionless dσ/dt of all modes from their σ, shape (4, k), and their λL: shear rates,
        shape (k,), in simple shear, else (4, k). Structure variables stand behind σ, here and
        below.
    `declared`, `extra`: the declared modes and those of effects, apart because the weights of the
        former are computed once for all trials.
    `viscosity`: in Pa s, of the stress that drives the flow beside that of the modes.
    `relaxations`: rates at which each tensor of a mode at rest, and its trace, relax beside −σ,
        over 1/λ, shape (t, 2, k), integrated exactly; None where chains do not retract.
    `states_in_use`: 0 for none, i + 1 for the i-th alone, one past the last for several; None for
        all.
    `columns`: derivatives beside each number of the modes: σ then has shape (s, 1 + columns, k).
    """

    slope: Callable
    linear_relaxation: bool  # whether −σ is part of it; it is then integrated exactly
    declared: Modes
    extra: Modes | None
    states: dict[StateEffect, Float[Array, " p"]]  # state effects and their parameters
    series: Series | None  # elements in series with the fluid; None where there can be none
    viscosity: Float[Array, ""]
    relaxations: Float[Array, "t 2 k"] | None = None
    times_change: Int[Array, ""] | int = 0  # 1 where a state changes the relaxation times, else 0
    states_in_use: Int[Array, ""] | None = None
    variables: int = 0  # structure variables of each mode that the law has
    shares: Float[Array, "tensors k"] | None = None
    columns: int = 0

    @property
    def tensors(self) -> int:
        """Tensors that stand first among the variables."""
        return 0 if self.shares is None else len(self.shares)

    @property
    def modes(self) -> Modes:
        """All modes, the declared ones first."""
        if self.extra is None:
            return self.declared
        return Modes(
            *(jnp.concatenate(pair) for pair in zip(self.declared, self.extra, strict=True))
        )

    @property
    def decay(self) -> float:
        """Rate over 1/λ of the relaxation that is integrated exactly."""
        return 1.0 if self.linear_relaxation else 0.0

    def weights(self, width: Float[Array, " s"]) -> tuple[Float[Array, "s kinds 11 _"], ...]:
        """Return the weights of steps in s, apart for declared modes and those of effects.

        Of each the weights of its stress and, where that relaxes faster, of its trace, then of each
        further tensor.
        """
        pieces, first = [], 0
        for modes in [self.declared] if self.extra is None else [self.declared, self.extra]:
            last = first + len(modes.relaxation_time)
            h = width[:, None] / modes.relaxation_time
            kinds = [krogstad_weights(-self.decay * h, h)]
            if self.relaxations is not None:
                # of the stress as a whole there is nothing to add
                faster = jnp.cumsum(self.relaxations[..., first:last], axis=1)
                rates = faster.reshape(-1, last - first)[1:]
                kinds += [krogstad_weights(-(self.decay + rate) * h, h) for rate in rates]
            pieces.append(jnp.stack([jnp.stack(kind, axis=1) for kind in kinds], axis=1))
            first = last
        return tuple(pieces)

    def weights_alone(self, width: Float[Array, ""]) -> tuple[Float[Array, "kinds 11 _"], ...]:
        """Return what `weights_of_step` wants of one step of this width in s."""
        return tuple(piece[0] for piece in self.weights(width[None]))

    def weights_of_step(
        self,
        pieces: tuple[Float[Array, "kinds 11 _"], ...],
        width: Float[Array, ""],
        slow: Float[Array, ""] | float,
    ) -> StressWeights:
        """Return the weights of one step, of those of `weights`, its width and a factor on times.

        A step in time over that factor is exact for the relaxation as it is there: a structure may
        shorten times a hundredfold, which explicit steps as long as the flow asks for cannot
        follow.
        """
        if any(effect.changes_times for effect in self.states):
            pieces = jax.lax.cond(
                self.times_change, lambda: self.weights_alone(width / slow), lambda: pieces
            )
        joined = pieces[0] if len(pieces) == 1 else jnp.concatenate(pieces, axis=-1)
        return StressWeights.of_kinds(joined, self.relaxations, self.shares)

    def rest(self) -> tuple[Float[Array, "s *c k"], Levels]:
        """Return modes and states at rest."""
        modulus = self.modes.modulus
        levels = (
            jnp.full((effect.levels,) if effect.levels > 1 else (), effect.rest, modulus.dtype)
            for effect in self.states
        )
        beside = (1 + self.columns,) if self.columns else ()
        return jnp.zeros((4 + self.variables, *beside, len(modulus))), tuple(levels)

    def later(
        self,
        levels: Levels,
        rate: Float[Array, ""],
        stress: Float[Array, ""],
        widths: Sequence[Float[Array, ""]],
    ) -> tuple[Levels, ...]:
        """Return the states after steps of these widths in s, source and decay constant in each."""
        pairs = list(self.states.items())

        def of(numbers: Sequence[int]) -> Callable[[], tuple[Levels, ...]]:
            def changed():
                out = []
                for width in widths:
                    after = list(levels)
                    for i in numbers:
                        effect, values = pairs[i]
                        terms = effect.source_and_decay(values, rate, stress)
                        after[i] = relax(*terms, levels[i], width)
                    out.append(tuple(after))
                return tuple(out)

            return changed

        every = of(range(len(pairs)))
        if self.states_in_use is None or not pairs:
            return every()
        branches = [of([]), *(of([i]) for i in range(len(pairs))), every]
        return jax.lax.switch(self.states_in_use, branches)

    def combined(self, factor: str, levels) -> Float[Array, ""]:
        """Return the product of a factor of all states: ``modulus_factor`` or ``time_factor``."""
        total = jnp.ones(())
        for (effect, values), level in zip(self.states.items(), levels, strict=True):
            total = total * getattr(effect, factor)(values, level)
        return total

    def change(self, stress, rate, slow, flow: Kinematics | None):
        """Return dσ/dt of each mode in its own time; longer times are a law in a slower time."""
        gradient = rate if flow is None else flow.gradient[:, None] * rate
        if not self.states:
            return self.slope(stress, self.modes.relaxation_time * gradient)
        return self.slope(stress, slow * self.modes.relaxation_time * gradient) / slow

    def stage(
        self, w: StressWeights, slow: Float[Array, ""] | float, flow: Kinematics | None
    ) -> Callable[[Float[Array, "s *c k"], tuple], Float[Array, "s *c k"]]:
        """Return the function from stress, rate and factor to the change that is no relaxation.

        `slow`: the factor on all times in the middle of the step.
        """

        def remainder(stress, given):
            rate, now = given
            change = slow * self.change(stress, rate, now, flow)
            return w.remainder(stress, change, self.decay)

        return remainder

    def after_step(
        self,
        stress: Float[Array, "s *c k"],
        rates: Float[Array, "3"],
        width: Float[Array, ""],
        flow: Kinematics | None,
    ) -> Float[Array, "s *c k"]:
        """Return the modes after a step without states: three rates in 1/s, a width in s."""
        w = self.weights_of_step(self.weights_alone(width), width, 1.0)
        stage = self.stage(w, 1.0, flow)
        first, middle, last = rates
        felt = jnp.stack([first, middle, middle, last])
        return w.step(stress, lambda state, rate: (stage(state, (rate, 1.0)), ()), felt)[0]

    def summed(self, of_modes: Float[Array, "*c k"]) -> Float[Array, " *c"]:
        """Return a stress in Pa of that of each mode over its modulus."""
        return contracted(of_modes, self.modes.modulus)

    def recorded(self, stress, flow: Kinematics | None) -> Float[Array, ""]:
        """Return the recorded stress of the modes in Pa, without the factor of the states."""
        of_modes = stress[3] if flow is None else flow.stress(stress[:4])
        return self.summed(of_modes)

    def sheared(self, stress, rate, flow: Kinematics | None):
        """Return stress and rate of a shear of the same intensity that does the same work."""
        if flow is None:
            return self.summed(stress[3]), rate
        of_modes = flow.equivalent_shear_stress(stress[:4])
        return self.summed(of_modes), flow.intensity * rate
