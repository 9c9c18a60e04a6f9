"""A sample that leaves the gap from its edge."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SignalEffect


class EdgeFracture(SignalEffect):
    """Beyond a strain the sheared area, and with it the torque, shrinks exponentially in strain.

    The strain counted is the total one, in both directions, since what has left does not come back.
    An empirical form: theory says when an edge breaks   [Tanner & Keentok 1983, J. Rheol. 27, 47],
    experiment that the torque then falls cycle by cycle   [Mattes, Vogt & Friedrich 2008, Rheol.
    Acta 47, 929].
    """

    def recorded_stress(self, values, record):
        """Return σ exp(−k max(0, γ_total − γ_c))."""
        beyond = jnp.maximum(record.total_strain - values[1], 0.0)
        return record.stress * jnp.exp(-values[0] * beyond)


EFFECT = EdgeFracture(
    name="edge_fracture",
    parameters=(
        EffectParameter(
            "loss",
            "k",
            low=0.0,
            high=10.0,
            first_trial=0.005,
            range_source="a strain of 1/k empties the gap: a crack grows inwards with the flow, "
            "and melts lose their torque over strains of ten and more (Mattes et al. 2008)",
        ),
        EffectParameter(
            "critical_strain",
            r"\gamma_\mathrm{c}",
            low=0.0,
            high=10.0,
            scale="strain",
            first_trial=0.3,
            range_source="an edge that is still whole at the largest strain has no effect; it may "
            "also be broken from the start",
            range_scale="strain",
            ends=("low",),
        ),
    ),
    equation=(
        r"\sigma_\mathrm{rec} = \sigma\,e^{-k\,\max(0,\ \gamma_\mathrm{total} -"
        r" \gamma_\mathrm{c})}"
    ),
    source="Mattes, Vogt & Friedrich 2008, Rheol. Acta 47, 929: the torque of melts falls from "
    "cycle to cycle. Tanner & Keentok 1983, J. Rheol. 27, 47, say when an edge breaks (by N2), "
    "not how the torque falls: the exponential in strain is an empirical form",
    check="Watch the edge; repeat with a smaller cone angle or a partitioned plate.",
    visible="k times the strain beyond the critical one of about 0.1.",
    complexity=2,
)
