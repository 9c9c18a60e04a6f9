"""A Newtonian part beside the modes."""

from discover.effects.base import ConstitutiveEffect, EffectParameter


class SolventViscosity(ConstitutiveEffect):
    """Adds η_s γ̇ to the stress   [Oldroyd 1950, Proc. R. Soc. A 200, 523]."""

    def instantaneous_stress(self, values, shear_rate):
        """Return η_s γ̇ in Pa."""
        return values[0] * shear_rate


EFFECT = SolventViscosity(
    name="solvent_viscosity",
    parameters=(
        EffectParameter(
            "eta_s",
            r"\eta_s",
            "Pa s",
            low=0.0,
            high=10.0,
            scale="viscosity",
            first_trial=0.01,
            range_source="a part of the stress cannot exceed the whole in the fastest flow; ten "
            "times leaves room for runs that differ",
            range_scale="viscosity",
        ),
    ),
    equation=r"\sigma \mathrel{+}= \eta_s\,\dot\gamma",
    source="Oldroyd 1950, Proc. R. Soc. A 200, 523",
    check="Step the rate: the stress should jump at once; G'' should end linear in frequency.",
    visible="eta_s of about 5 % of the zero-shear viscosity; less where the rate changes fast.",
)
