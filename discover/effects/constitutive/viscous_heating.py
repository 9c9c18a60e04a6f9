"""A sample that its own dissipation warms."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, StateEffect
from discover.effects.written_state import WrittenState
from tensor_library.isotropic_function import scalars


class ViscousHeating(StateEffect):
    """Relaxation times shortened by the heat of the flow   [Winter 1977].

    Θ is the logarithm of the shift factor: dΘ/dt = b σγ̇ − Θ/t_h, where b is −d ln a_T/dT over
    the heat capacity per volume, and t_h the time in which the heat leaves the gap. All
    relaxation times carry the factor exp(−Θ).
    """

    def source_and_decay(self, values, shear_rate, stress):
        """Return b σγ̇ and 1/t_h."""
        return values[0] * stress * shear_rate, 1.0 / values[1]

    def written(self):
        """Return the equation of Θ, and exp(−Θ)."""
        import sympy

        softening, time = scalars(*(parameter.name for parameter in self.parameters))
        theta, rate, stress = scalars(self.name, "shear_rate", "shear_stress")
        changes = softening * stress * rate - theta / time
        return WrittenState((changes,), time_factor=sympy.exp(-theta))

    def time_factor(self, values, state):
        """Return exp(−Θ)."""
        del values
        return jnp.exp(-state)


EFFECT = ViscousHeating(
    name="viscous_heating",
    parameters=(
        EffectParameter(
            "heating",
            "b",
            "1/Pa",
            low=0.0,
            high=1e-6,
            scale="inverse_stress",
            first_trial=0.01,
            range_source="−d ln a_T/dT is 0.01 to 0.1 1/K, and 0.8 at a glass transition (Ferry "
            "1980, ch. 11: 2.303 · 17.44/51.6 K); the heat capacity per volume of liquids is 1 to "
            "4 MJ/(m³ K)",
        ),
        EffectParameter(
            "heat_loss_time",
            r"t_\mathrm{h}",
            "s",
            low=1e-4,
            high=1e5,
            scale="run_time",
            first_trial=0.3,
            range_source="H²/(π² a) with the diffusivity of heat of liquids, a = 1e-7 m²/s, and a "
            "gap H from 10 µm on; insulating walls, and times shifted to another temperature, "
            "lengthen it without limit (Winter 1977)",
            ends=("high",),
        ),
    ),
    equation=(
        r"\lambda_k \to \lambda_k e^{-\Theta},\quad \frac{d\Theta}{dt} ="
        r" b\,\sigma\dot\gamma - \frac{\Theta}{t_\mathrm{h}}"
    ),
    source="Winter 1977, Adv. Heat Transfer 13, 205",
    check="Repeat with half the gap, which cools faster; measure the temperature of the sample.",
    visible="b times the work done per volume within t_h of about 0.05.",
    complexity=2,
)
