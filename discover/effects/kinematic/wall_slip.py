"""A fluid that slips at the wall."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SeriesElement


class WallSlip(SeriesElement):
    """Slip in proportion to the stress, γ̇_felt = γ̇ − s σ   [Navier 1823; Yoshimura 1988]."""

    acts_on_steady_states = True

    def slip_and_compliance(self, values):
        """Return s and 0."""
        return values[0], jnp.zeros_like(values[0])


EFFECT = WallSlip(
    name="wall_slip",
    parameters=(
        EffectParameter(
            "slip",
            "s",
            "1/(Pa s)",
            low=0.0,
            high=10.0,
            scale="fluidity",
            first_trial=0.01,
            range_source="slip cannot exceed the deformation commanded, s σ = γ̇; ten times leaves "
            "room for runs that differ",
            range_scale="fluidity",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = \dot\gamma - s\,\sigma,\quad s = 2 b / H",
    source="Yoshimura & Prud'homme 1988, J. Rheol. 32, 53 (slip velocity b sigma, gap H)",
    check="Repeat with another gap H: slip goes as 1/H; roughen the plates.",
    visible="s of about 5 % of the inverse zero-shear viscosity.",
)
