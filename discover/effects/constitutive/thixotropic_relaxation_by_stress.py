"""A structure that slows relaxation, and that a power of the stress breaks."""

from discover.effects.structure import (
    BUILD_UP_TIME,
    EXPONENT,
    INVERSE_STRESS,
    BrokenByStress,
)


class ThixotropicRelaxationByStress(BrokenByStress):
    """Relaxation times in proportion to a structure s, which the stress breaks."""

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


EFFECT = ThixotropicRelaxationByStress(
    name="thixotropic_relaxation_by_stress",
    parameters=(INVERSE_STRESS, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"\lambda_k \to s\,\lambda_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\sigma|}{\sigma_\mathrm{c}}\right)^n s"
    ),
    source="de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673; Larson & Wei 2019, J. Rheol. "
    "63, 477",
    check="Creep: below the critical stress the rate falls with time, above it rises.",
    visible="largest stress over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)
