"""A structure that slows relaxation, and that a power of the rate breaks."""

from discover.effects.structure import (
    BUILD_UP_TIME,
    EXPONENT,
    INVERSE_RATE,
    BrokenByRate,
)


class ThixotropicRelaxation(BrokenByRate):
    """Relaxation times in proportion to a structure s: less of it flows more easily."""

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


EFFECT = ThixotropicRelaxation(
    name="thixotropic_relaxation",
    parameters=(INVERSE_RATE, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"\lambda_k \to s\,\lambda_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\dot\gamma|}{\dot\gamma_\mathrm{c}}\right)^n s"
    ),
    source="de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673, for a viscosity that a structure "
    "makes; Dullaert & Mewis 2006, J. Non-Newtonian Fluid Mech. 139, 21, and Cross 1965, J. "
    "Colloid Sci. 20, 417, for its kinetics",
    check="Stop flows of several rates: the stress relaxes faster after the faster ones.",
    visible="largest rate over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)
