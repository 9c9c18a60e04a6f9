"""A relaxation time that the declared spectrum lacks."""

from discover.effects.base import EffectParameter, ModeEffect


class RelaxationMode(ModeEffect):
    """One more mode under the declared law   [generalised Maxwell model, Ferry 1980, ch. 1]."""

    def mode(self, values):
        """Return G and λ."""
        return values[0], values[1]


EFFECT = RelaxationMode(
    name="relaxation_mode",
    parameters=(
        EffectParameter(
            "G",
            "G_+",
            "Pa",
            low=0.0,
            high=1e10,
            scale="stress",
            first_trial=0.05,
            range_source="Ferry 1980, ch. 2: glasses have 1e9 Pa, and nothing that flows has more",
        ),
        EffectParameter(
            "lambda",
            r"\lambda_+",
            "s",
            low=1e-6,
            high=30.0,
            scale="run_time",
            first_trial=0.1,
            range_source="a mode that is a millionth of a run long cannot be told from a solvent, "
            "nor one that is 30 runs long from a spring (Davies & Anderssen 1997, J. "
            "Non-Newtonian Fluid Mech. 73, 163: records determine times little beyond their own "
            "window)",
            range_scale="run_time",
        ),
    ),
    equation=(
        r"\sigma \mathrel{+}= G_+\,\sigma_+,\quad \lambda_+\overset{\nabla}{\sigma}_+ + \sigma_+"
        r" + h(\sigma_+) = \lambda_+\dot\gamma"
    ),
    source="Ferry 1980, Viscoelastic Properties of Polymers, ch. 1",
    check="Measure small-amplitude oscillation around the angular frequency 1/λ.",
    visible="G lambda of about 5 % of the zero-shear viscosity.",
    complexity=2,
)
