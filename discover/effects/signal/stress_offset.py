"""A zero of the transducer that is off."""

from discover.effects.base import EffectParameter, SignalEffect


class StressOffset(SignalEffect):
    """A constant is added to the stress recorded."""

    acts_on_steady_states = True

    def recorded_stress(self, values, record):
        """Return σ + σ₀."""
        return record.stress + values[0]


EFFECT = StressOffset(
    name="stress_offset",
    parameters=(
        EffectParameter(
            "offset",
            r"\sigma_0",
            "Pa",
            low=-1.0,
            high=1.0,
            scale="stress",
            first_trial=0.01,
            range_source="with more offset than stress, most records would show only the zero of "
            "the transducer",
            range_scale="stress",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + \sigma_0",
    source="Macosko 1994, Rheology, ch. 8: transducer zero",
    check="Record the stress before the flow starts.",
    visible="sigma_0 of about 5 % of the root-mean-square stress.",
)
