"""Torque that accelerates the tool."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect

# Below this fraction of the record a step only marks a jump of the rate, whose torque is over
# before a sample is taken
_JUMP = 1e-9


class InstrumentInertia(SignalEffect):
    """The stress recorded contains the inertia of the moving tool."""

    def recorded_stress(self, values, record):
        """Return σ + I dγ̇/dt."""
        step = jnp.diff(record.instrument_times)
        shortest = _JUMP * (record.instrument_times[-1] - record.instrument_times[0])
        slope = jnp.where(step > shortest, jnp.diff(record.shear_rate) / step, 0.0)
        # slope at the points, from the intervals at both sides
        inside = 0.5 * (slope[1:] + slope[:-1])
        at_points = jnp.concatenate([slope[:1], inside, slope[-1:]])
        # the rate is per second of material time; the tool moves on the instrument's clock
        return record.stress + values[0] * record.clock_factor * at_points


EFFECT = InstrumentInertia(
    name="instrument_inertia",
    parameters=(
        EffectParameter("inertia", "I", "Pa s^2", low=0.0, scale="inertia", first_trial=0.01),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + I\,\frac{d\dot\gamma}{dt}",
    source="Krieger 1990, J. Rheol. 34, 471",
    check="Oscillate a Newtonian oil over the same frequencies; compare the raw phase.",
    visible="I omega of about 5 % of the dynamic viscosity at the highest frequency omega.",
)
