"""A motor that needs time to reach the commanded rate."""

from discover.effects.base import EffectParameter, KinematicEffect
from discover.effects.filters import first_order_lag


class RateRiseTime(KinematicEffect):
    """The rate felt follows the commanded one with a first-order lag on the instrument's clock."""

    def felt_rate(self, values, instrument_times, shear_rate):
        """Return the lagged rate: τ γ̇_felt' + γ̇_felt = γ̇, from rest."""
        return first_order_lag(instrument_times, shear_rate, values[0])


EFFECT = RateRiseTime(
    name="rate_rise_time",
    parameters=(
        EffectParameter(
            "tau",
            r"\tau",
            "s",
            low=0.0,
            high=10.0,
            scale="sampling_time",
            first_trial=0.5,
            range_source="motors answer in 0.01 to 0.1 s; a badly tuned loop that controls the "
            "rate of a stress-controlled instrument needs seconds",
        ),
    ),
    equation=(
        r"\tau\,\frac{d\dot\gamma_\mathrm{felt}}{dt} + \dot\gamma_\mathrm{felt} ="
        r" \dot\gamma"
    ),
    source="Macosko 1994, Rheology, ch. 8: response time of the drive",
    check="Record the angle of the motor in start-up; repeat at another rate.",
    visible="tau of about 5 % of the time in which the stress grows.",
    shapes_command=True,
)
