"""Dry friction in the bearing of the tool."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect


class BearingFriction(SignalEffect):
    """A torque against the motion, of constant size, is recorded with the stress (Coulomb)."""

    acts_on_steady_states = True

    def recorded_stress(self, values, record):
        """Return σ + σ_f sign(γ̇), with the rate of the tool, whatever the fluid feels of it."""
        return record.stress + values[0] * jnp.sign(record.tool_rate)


EFFECT = BearingFriction(
    name="bearing_friction",
    parameters=(
        EffectParameter(
            "friction",
            r"\sigma_\mathrm{f}",
            "Pa",
            low=0.0,
            high=1.0,
            scale="stress",
            first_trial=0.01,
            range_source="with more friction than stress, most records would be records of the "
            "bearing",
            range_scale="stress",
        ),
    ),
    equation=(
        r"\sigma_\mathrm{rec} = \sigma"
        r" + \sigma_\mathrm{f}\,\mathrm{sign}(\dot\gamma_\mathrm{tool})"
    ),
    source="Macosko 1994, Rheology, ch. 8: friction and residual torque of bearings",
    check="Turn the tool in air, slowly, both ways.",
    visible="sigma_f of about 5 % of the root-mean-square stress.",
)
