"""Torque that accelerates the tool."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect

# Below this fraction of the record a step only marks a jump of the rate, whose torque is over
# before a sample is taken
_JUMP = 1e-9


class InstrumentInertia(SignalEffect):
    """The stress recorded contains the inertia of the moving tool.

    A correction for it that was too large leaves a negative one in the record.
    """

    def recorded_stress(self, values, record):
        """Return σ + I dγ̇/dt, with the rate of the tool, whatever the fluid feels of it."""
        step = jnp.diff(record.instrument_times)
        shortest = _JUMP * (record.instrument_times[-1] - record.instrument_times[0])
        slope = jnp.where(step > shortest, jnp.diff(record.tool_rate) / step, 0.0)
        # slope at the points, from the intervals at both sides
        inside = 0.5 * (slope[1:] + slope[:-1])
        at_points = jnp.concatenate([slope[:1], inside, slope[-1:]])
        # the rate is per second of material time; the tool moves on the instrument's clock
        return record.stress + values[0] * record.clock_factor * at_points

    def inertia(self, values):
        """Return I."""
        return values[0]


EFFECT = InstrumentInertia(
    name="instrument_inertia",
    parameters=(
        EffectParameter(
            "inertia",
            "I",
            "Pa s^2",
            low=-1e3,
            high=1e3,
            scale="inertia",
            first_trial=0.01,
            range_source="2 J H/(πR⁴) of motor and tool with J = 1e-4 N m s², plates of R = 4 mm "
            "and H = 1 mm give 120; a correction for it can be wrong by its whole size, either "
            "way: J is determined empirically, and its precision is rarely stated (Klemuk & Titze "
            "2009)",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + I\,\frac{d\dot\gamma_\mathrm{tool}}{dt}",
    source="Krieger 1990, J. Rheol. 34, 471; Klemuk & Titze 2009, J. Rheol. 53, 765 for its error",
    check="Oscillate a Newtonian oil over the same frequencies; compare the raw phase.",
    visible="I omega of about 5 % of the dynamic viscosity at the highest frequency omega.",
)
