"""A transducer or filter that follows the stress with a lag."""

from discover.effects.base import EffectParameter, SignalEffect
from discover.effects.filters import first_order_lag


class TransducerLag(SignalEffect):
    """The stress recorded follows the true one with a first-order lag on the instrument's clock."""

    def recorded_stress(self, values, record):
        """Return the lagged stress: τ σ_rec' + σ_rec = σ, from rest."""
        return first_order_lag(record.instrument_times, record.stress, values[0])

    def response(self, values, frequency):
        """Return 1/(1 + iωτ)."""
        return 1.0 / (1.0 + 1j * frequency * values[0])


EFFECT = TransducerLag(
    name="transducer_lag",
    parameters=(
        EffectParameter(
            "tau",
            r"\tau",
            "s",
            low=0.0,
            high=10.0,
            scale="sampling_time",
            first_trial=0.5,
            range_source="transducers answer in 0.001 to 0.1 s, and filters behind them average "
            "over seconds at most",
        ),
    ),
    equation=r"\tau\,\frac{d\sigma_\mathrm{rec}}{dt} + \sigma_\mathrm{rec} = \sigma",
    source="Doebelin 2004, Measurement Systems, ch. 3: instruments of first order; transducers of "
    "rheometers: Macosko 1994, Rheology, ch. 8",
    check="Look up the filter of the transducer; strike it and record the response.",
    visible="tau of about 5 % of the time in which the stress changes, 0.05/omega in oscillation.",
)
