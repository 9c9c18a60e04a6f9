"""A stress that is wrong by a factor."""

from discover.effects.base import EffectParameter, SignalEffect


class StressGain(SignalEffect):
    """The stress recorded is (1 + g) times the true one."""

    acts_on_steady_states = True

    def recorded_stress(self, values, record):
        """Return (1 + g) σ."""
        return (1.0 + values[0]) * record.stress


EFFECT = StressGain(
    name="stress_gain",
    parameters=(
        EffectParameter(
            "gain_error",
            "g",
            low=-0.8,
            high=4.0,
            first_trial=0.01,
            range_source="a factor of five either way: the stress goes as 1/R³, and 25 mm entered "
            "for plates of 40 mm gives a factor of four (Macosko 1994, ch. 5)",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = (1 + g)\,\sigma",
    source="Macosko 1994, Rheology, ch. 8: calibration and sample radius",
    check="Calibrate the transducer with a dead weight; look at the filling of the gap.",
    visible="g of about 0.05.",
)
