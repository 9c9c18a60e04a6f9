"""A stress that is recorded late."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect


class TimeDelay(SignalEffect):
    """The stress recorded is the true one some time earlier, on the instrument's clock."""

    def recorded_stress(self, values, record):
        """Return σ(t − δ), which is zero before the flow starts."""
        earlier = record.instrument_times - values[0]
        return jnp.interp(earlier, record.instrument_times, record.stress, left=0.0)

    def response(self, values, frequency):
        """Return exp(−iωδ)."""
        return jnp.exp(-1j * frequency * values[0])


EFFECT = TimeDelay(
    name="time_delay",
    parameters=(
        EffectParameter(
            "delay",
            r"\delta",
            "s",
            low=0.0,
            high=10.0,
            scale="sampling_time",
            first_trial=0.5,
            range_source="channels read one after another differ by a millisecond, and programs "
            "that average each point over seconds delay it by as much",
        ),
    ),
    equation=r"\sigma_\mathrm{rec}(t) = \sigma(t - \delta)",
    source="Macosko 1994, Rheology, ch. 8: data acquisition",
    check="Record the angle and the torque of an elastic spring together.",
    visible=(
        "delta of about 5 % of the time in which the stress changes, 0.05/omega in oscillation."
    ),
)
