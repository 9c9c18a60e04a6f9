"""A sample that its own dissipation warms."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, StateEffect


class ViscousHeating(StateEffect):
    """Relaxation times shortened by the heat of the flow   [Winter 1977].

    Θ is the logarithm of the shift factor: dΘ/dt = b σγ̇ − Θ/t_h, where b is −d ln a_T/dT over
    the heat capacity per volume, and t_h the time in which the heat leaves the gap. All
    relaxation times carry the factor exp(−Θ).
    """

    def source_and_decay(self, values, shear_rate, stress):
        """Return b σγ̇ and 1/t_h."""
        return values[0] * stress * shear_rate, 1.0 / values[1]

    def time_factor(self, values, state):
        """Return exp(−Θ)."""
        del values
        return jnp.exp(-state)


EFFECT = ViscousHeating(
    name="viscous_heating",
    parameters=(
        EffectParameter("heating", "b", "1/Pa", low=0.0, scale="inverse_stress", first_trial=0.01),
        EffectParameter(
            "heat_loss_time", r"t_\mathrm{h}", "s", low=1e-9, scale="run_time", first_trial=0.3
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
