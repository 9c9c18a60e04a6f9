"""A structure that carries the stress, and that a power of the rate breaks."""

from discover.effects.structure import (
    BUILD_UP_TIME,
    EXPONENT,
    INVERSE_RATE,
    BrokenByRate,
)


class ThixotropicModulus(BrokenByRate):
    """Stress in proportion to a structure s; `thixotropy` is the case n = 1."""

    def modulus_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


EFFECT = ThixotropicModulus(
    name="thixotropic_modulus",
    parameters=(INVERSE_RATE, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"\sigma = s\sum_k\sigma_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\dot\gamma|}{\dot\gamma_\mathrm{c}}\right)^n s"
    ),
    source="Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147-148, 214; Dullaert & Mewis 2006, "
    "J. Non-Newtonian Fluid Mech. 139, 21",
    check="Oscillate gently after flow at several rates: the moduli should grow at rest.",
    visible="largest rate over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)
