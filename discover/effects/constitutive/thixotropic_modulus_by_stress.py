"""A structure that carries the stress, and that a power of the stress breaks."""

from discover.effects.structure import (
    BUILD_UP_TIME,
    EXPONENT,
    INVERSE_STRESS,
    BrokenByStress,
)


class ThixotropicModulusByStress(BrokenByStress):
    """Stress in proportion to a structure s, which the stress breaks."""

    def modulus_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


EFFECT = ThixotropicModulusByStress(
    name="thixotropic_modulus_by_stress",
    parameters=(INVERSE_STRESS, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"\sigma = s\sum_k\sigma_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\sigma|}{\sigma_\mathrm{c}}\right)^n s"
    ),
    source="de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673; Mewis & Wagner 2009, Adv. "
    "Colloid Interface Sci. 147-148, 214",
    check="Oscillate gently after creep at several stresses: the moduli should grow at rest.",
    visible="largest stress over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)
