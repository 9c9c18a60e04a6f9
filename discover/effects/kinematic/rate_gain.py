"""A commanded rate that is wrong by a factor."""

from discover.effects.base import EffectParameter, KinematicEffect


class RateGain(KinematicEffect):
    """The rate felt is (1 + g) times the commanded one."""

    acts_on_steady_states = True

    def felt_rate(self, values, instrument_times, shear_rate):
        """Return (1 + g) γ̇."""
        del instrument_times
        return (1.0 + values[0]) * shear_rate


EFFECT = RateGain(
    name="rate_gain",
    parameters=(
        EffectParameter(
            "gain_error",
            "g",
            low=-0.5,
            high=1.0,
            first_trial=0.01,
            range_source="a gap or an angle wrong by a factor of two; the zero of a gap is off by "
            "10 to 100 µm (Davies & Stokes 2008, J. Non-Newtonian Fluid Mech. 148, 73)",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = (1 + g)\,\dot\gamma",
    source="Macosko 1994, Rheology, ch. 8: errors of cone angle and gap",
    check="Measure a Newtonian oil; measure the gap and the cone angle.",
    visible="g of about 0.05.",
)
