"""A zero of the transducer that drifts."""

from discover.effects.base import EffectParameter, SignalEffect


class StressDrift(SignalEffect):
    """A stress that grows linearly with instrument time is added to the one recorded."""

    def recorded_stress(self, values, record):
        """Return σ + d t."""
        return record.stress + values[0] * record.instrument_times


EFFECT = StressDrift(
    name="stress_drift",
    parameters=(
        EffectParameter(
            "drift",
            "d",
            "Pa/s",
            low=-2.0,
            high=2.0,
            scale="stress_rate",
            first_trial=0.01,
            range_source="at twice the stress over the length of a run, half of the record is the "
            "drift of an instrument that measures nothing",
            range_scale="stress_rate",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + d\,t",
    source="Macosko 1994, Rheology, ch. 8: transducer drift",
    check="Record the stress of a sample at rest for as long as the longest run.",
    visible="d times the length of a run of about 10 % of its root-mean-square stress.",
)
