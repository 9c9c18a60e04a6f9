"""Two structures, a fast and a slow one, that slow relaxation."""

from discover.effects.structure import (
    BUILD_UP_TIME,
    INVERSE_RATE,
    SLOW_SHARE,
    SLOWNESS,
    BrokenByRate,
)


class ThixotropicRelaxationTwoTimes(BrokenByRate):
    """Relaxation times in proportion to s = (1 − w) s₁ + w s₂, with two structure times."""

    levels = 2

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


EFFECT = ThixotropicRelaxationTwoTimes(
    name="thixotropic_relaxation_two_times",
    parameters=(INVERSE_RATE, BUILD_UP_TIME, SLOWNESS, SLOW_SHARE),
    equation=(
        r"\lambda_k \to [(1 - w) s_1 + w s_2]\,\lambda_k,\quad t_i\frac{ds_i}{dt} = 1 - s_i"
        r" - \left(\frac{|\dot\gamma|}{\dot\gamma_\mathrm{c}}\right)^{2/3} s_i,"
        r"\quad t_1 = t_\mathrm{b},\ t_2 = R\,t_\mathrm{b}"
    ),
    source="Wei, Solomon & Larson 2018, J. Rheol. 62, 321, for several times with one steady state",
    check="Rest for different lengths before a start: recovery in two steps.",
    visible="as thixotropic_relaxation.",
    complexity=4,
)
