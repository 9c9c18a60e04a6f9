"""A fluid as the integrators that JAX transforms take it: its modes, and nothing beside them."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.forward.exponential_weights import StressWeights, krogstad_weights
from discover.protocols.kinematics import Kinematics
from tensor_library.algebra import contracted


class Modes(NamedTuple):
    """Modes: moduli in Pa, relaxation times in s, both shape (k,)."""

    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]


class Dynamics(NamedTuple):
    """How the modes change.

    `slope`: dimensionless dσ/dt of all modes from their σ, shape (4, k), and their λL: shear rates,
        shape (k,), in simple shear, else (4, k). Structure variables stand behind σ, here and
        below.
    `viscosity`: in Pa s, of the stress that drives the flow beside that of the modes.
    `relaxations`: rates at which each tensor of a mode at rest, and its trace, relax beside −σ,
        over 1/λ, shape (t, 2, k), integrated exactly; None where chains do not retract.
    `columns`: derivatives beside each number of the modes: σ then has shape (s, 1 + columns, k).
    """

    slope: Callable
    linear_relaxation: bool  # whether −σ is part of it; it is then integrated exactly
    modes: Modes
    viscosity: Float[Array, ""]
    relaxations: Float[Array, "t 2 k"] | None = None
    variables: int = 0  # structure variables of each mode that the law has
    shares: Float[Array, "tensors k"] | None = None
    columns: int = 0

    @property
    def tensors(self) -> int:
        """Tensors that stand first among the variables."""
        return 0 if self.shares is None else len(self.shares)

    @property
    def decay(self) -> float:
        """Rate over 1/λ of the relaxation that is integrated exactly."""
        return 1.0 if self.linear_relaxation else 0.0

    def weights(self, width: Float[Array, " s"]) -> Float[Array, "s kinds 11 k"]:
        """Return the weights of steps in s.

        Of each the weights of its stress and, where that relaxes faster, of its trace, then of each
        further tensor.
        """
        h = width[:, None] / self.modes.relaxation_time
        kinds = [krogstad_weights(-self.decay * h, h)]
        if self.relaxations is not None:
            # of the stress as a whole there is nothing to add
            rates = jnp.cumsum(self.relaxations, axis=1).reshape(-1, h.shape[1])[1:]
            kinds += [krogstad_weights(-(self.decay + rate) * h, h) for rate in rates]
        return jnp.stack([jnp.stack(kind, axis=1) for kind in kinds], axis=1)

    def of_step(self, weights: Float[Array, "kinds 11 k"]) -> StressWeights:
        """Return the weights of one step, of those of `weights`."""
        return StressWeights.of_kinds(weights, self.relaxations, self.shares)

    def rest(self) -> Float[Array, "s *c k"]:
        """Return the modes at rest."""
        beside = (1 + self.columns,) if self.columns else ()
        return jnp.zeros((4 + self.variables, *beside, len(self.modes.modulus)))

    def change(self, stress, rate, flow: Kinematics | None):
        """Return dσ/dt of each mode in its own time."""
        gradient = rate if flow is None else flow.gradient[:, None] * rate
        return self.slope(stress, self.modes.relaxation_time * gradient)

    def stage(
        self, w: StressWeights, flow: Kinematics | None
    ) -> Callable[[Float[Array, "s *c k"], Float[Array, ""]], Float[Array, "s *c k"]]:
        """Return the function from stress and rate to the change that is no relaxation."""
        return lambda stress, rate: w.remainder(stress, self.change(stress, rate, flow), self.decay)

    def after_step(
        self,
        stress: Float[Array, "s *c k"],
        rates: Float[Array, "3"],
        width: Float[Array, ""],
        flow: Kinematics | None,
    ) -> Float[Array, "s *c k"]:
        """Return the modes after a step: three rates in 1/s, a width in s."""
        return self.stepped(self.weights(width[None])[0], stress, rates, flow)

    def stepped(self, weights, stress, rates, flow: Kinematics | None):
        """Return the modes after a step of known weights; see `StressWeights.step`."""
        w = self.of_step(weights)
        first, middle, last = rates
        return w.step(stress, self.stage(w, flow), (first, middle, middle, last))[0]

    def recorded(self, stress, flow: Kinematics | None) -> Float[Array, ""]:
        """Return the recorded stress of the modes in Pa."""
        of_modes = stress[3] if flow is None else flow.stress(stress[:4])
        return contracted(of_modes, self.modes.modulus)
