"""A sample that leaves the gap from its edge."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect


class EdgeFracture(SignalEffect):
    """Beyond a strain the sheared area, and with it the torque, shrinks exponentially in strain.

    Edge fracture   [Tanner & Keentok 1983, J. Rheol. 27, 47]; the strain counted is the total one,
    in both directions, since what has left does not come back.
    """

    def recorded_stress(self, values, record):
        """Return σ exp(−k max(0, γ_total − γ_c))."""
        beyond = jnp.maximum(record.total_strain - values[1], 0.0)
        return record.stress * jnp.exp(-values[0] * beyond)


EFFECT = EdgeFracture(
    name="edge_fracture",
    parameters=(
        EffectParameter("loss", "k", low=0.0, first_trial=0.005),
        EffectParameter(
            "critical_strain", r"\gamma_\mathrm{c}", low=0.0, scale="strain", first_trial=0.3
        ),
    ),
    equation=(
        r"\sigma_\mathrm{rec} = \sigma\,e^{-k\,\max(0,\ \gamma_\mathrm{total} -"
        r" \gamma_\mathrm{c})}"
    ),
    source="Tanner & Keentok 1983, J. Rheol. 27, 47",
    check="Watch the edge; repeat with a smaller cone angle or a partitioned plate.",
    visible="k times the strain beyond the critical one of about 0.1.",
    complexity=2,
)
