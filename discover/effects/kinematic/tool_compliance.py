"""A tool or transducer that twists under its torque."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, SeriesElement


class ToolCompliance(SeriesElement):
    """The strain felt is the commanded one less C σ   [Gottlieb & Macosko 1982]."""

    def slip_and_compliance(self, values):
        """Return 0 and C."""
        return jnp.zeros_like(values[0]), values[0]


EFFECT = ToolCompliance(
    name="tool_compliance",
    parameters=(
        EffectParameter(
            "compliance",
            "C",
            "1/Pa",
            low=0.0,
            high=0.1,
            scale="inverse_stress",
            first_trial=0.01,
            range_source="πR⁴/(2 H K) of a torsion bar as soft as K = 0.1 N m/rad with R = 50 mm, "
            "H = 1 mm; other transducers are 1000 times as stiff (Gottlieb & Macosko 1982)",
        ),
    ),
    equation=r"\gamma_\mathrm{felt} = \gamma - C\,\sigma",
    source="Gottlieb & Macosko 1982, Rheol. Acta 21, 90",
    check="Glue the tools together and twist; repeat with smaller plates, which need less torque.",
    visible="C times the plateau modulus of about 0.05.",
)
