"""A structure of the fluid that flow breaks and rest mends, on which the stress depends."""

from abc import abstractmethod

import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.effects.base import EffectParameter, StateEffect, WrittenState
from tensor_library.isotropic_function import scalars

CROSS = 2.0 / 3.0
"""Exponent of the rate of dispersions   [Cross 1965]."""


class Structure(StateEffect):
    """A structure s, one at rest: ds/dt = (1 − s)/t_b − (X/X_c)ⁿ s/t_b.

    X is the shear rate or the stress, and s = 1/(1 + (X/X_c)ⁿ) in steady flow, which is Cross's
    equation. Parameters are 1/X_c, which is the amplitude, t_b and n; with two structure times,
    s = (1 − w) s₁ + w s₂, the ratio R of the slow one to t_b and the share w instead of n, which
    is then Cross's: no record of which we know tells all five.
    [Cross 1965, J. Colloid Sci. 20, 417; Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147–148,
    214; several times: Wei, Solomon & Larson 2018, J. Rheol. 62, 321]. A member of the family says
    what breaks it, X, and on what s acts, `time_factor` or `modulus_factor`.
    """

    rest = 1.0
    acts_on_steady_states = True
    # each has three constants or more, and few fluids heal: searches of all others stay as fast
    on_request = True

    @staticmethod
    @abstractmethod
    def breaks(shear_rate: Float[Array, ""], stress: Float[Array, ""]) -> Float[Array, ""]:
        """Return X, in 1/s or Pa."""

    def source_and_decay(self, values, shear_rate, stress):
        """Return 1/t_b and (1 + (X/X_c)ⁿ)/t_b, of both structures where there are two."""
        times = values[1] if self.levels == 1 else values[1] * jnp.array([1.0, values[2]])
        return 1.0 / times, (1.0 + self._broken(values, shear_rate, stress)) / times

    def written(self):
        """Return the equation of each structure, and the factor that is s."""
        import sympy

        critical, exponent, time, slowness, share, rate, stress = scalars(
            self.parameters[0].name,
            "exponent",
            "build_up_time",
            "slowness",
            "slow_share",
            "shear_rate",
            "shear_stress",
        )
        power = exponent if self.levels == 1 else sympy.Rational(2, 3)
        broken = (critical * sympy.Abs(self.breaks(rate, stress))) ** power
        levels = [scalars(name) for name in self.level_names]
        times = [time] if self.levels == 1 else [time, slowness * time]
        rates = ((1 - level * (1 + broken)) / t for level, t in zip(levels, times, strict=True))
        whole = levels[0] if self.levels == 1 else (1 - share) * levels[0] + share * levels[1]
        factor = "time_factor" if self.changes_times else "modulus_factor"
        return WrittenState(tuple(rates), **{factor: whole})

    def _broken(self, values, shear_rate, stress):
        size = values[0] * jnp.abs(self.breaks(shear_rate, stress))
        # a power below one has no derivative at zero
        flows = size > 0.0
        exponent = values[2] if self.levels == 1 else CROSS
        return jnp.where(flows, jnp.where(flows, size, 1.0) ** exponent, 0.0)

    def whole(self, values: Float[Array, " p"], state) -> Float[Array, ""]:
        """Return s."""
        if self.levels == 1:
            return state
        return (1.0 - values[3]) * state[0] + values[3] * state[1]


class BrokenByRate(Structure):
    """A structure that a power of the shear rate breaks."""

    @staticmethod
    def breaks(shear_rate, stress):
        """Return the shear rate in 1/s."""
        del stress
        return shear_rate


class BrokenByStress(Structure):
    """A structure that a power of the stress breaks.

    [de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673].
    """

    @staticmethod
    def breaks(shear_rate, stress):
        """Return the shear stress in Pa."""
        del shear_rate
        return stress


INVERSE_RATE = EffectParameter(
    "inverse_critical_rate",
    r"1/\dot\gamma_\mathrm{c}",
    "s",
    low=0.0,
    high=1e5,
    scale="inverse_rate",
    first_trial=0.3,
    range_source="half of a structure is broken at the critical rate: the slowest steady flows of "
    "rheometers, 1e-5 1/s, break those of gels (Mewis & Wagner 2009)",
)
"""Amplitude of what the rate breaks."""

INVERSE_STRESS = EffectParameter(
    "inverse_critical_stress",
    r"1/\sigma_\mathrm{c}",
    "1/Pa",
    low=0.0,
    high=100.0,
    scale="inverse_stress",
    first_trial=0.3,
    range_source="half of a structure is broken at the critical stress; if that is a hundredth of "
    "the recorded stress, the structure is broken throughout",
    range_scale="inverse_stress",
)
"""Amplitude of what the stress breaks."""

BUILD_UP_TIME = EffectParameter(
    "build_up_time",
    r"t_\mathrm{b}",
    "s",
    low=1e-3,
    high=1e6,
    scale="run_time",
    first_trial=0.3,
    range_source="as for thixotropy, from some milliseconds to never (Mewis & Wagner 2009)",
    ends=("high",),
)

EXPONENT = EffectParameter(
    "exponent",
    "n",
    low=0.1,
    high=4.0,
    first_trial=1.0,
    range_source="1 in most models of thixotropy, other values in some (Mewis & Wagner 2009), 2/3 "
    "in Cross's equation for dispersions; beyond 4 the whole structure breaks at one rate or "
    "stress",
)

SLOWNESS = EffectParameter(
    "slowness",
    "R",
    meaning="slow over fast structure time",
    low=2.0,
    high=1e4,
    first_trial=30.0,
    range_source="structure times less than a factor of two apart count as one (those of Wei, "
    "Solomon & Larson 2018 spread over decades)",
)
"""The slow structure time over the fast one."""

SLOW_SHARE = EffectParameter(
    "slow_share",
    "w",
    meaning="share of the slow structure",
    low=0.01,
    high=0.99,
    first_trial=0.1,
    range_source="with less than one part in a hundred of either there is only one structure",
)


class ThixotropicModulus(BrokenByRate):
    """Stress in proportion to a structure s; `thixotropy` is the case n = 1."""

    def modulus_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


THIXOTROPIC_MODULUS = ThixotropicModulus(
    name="thixotropic_modulus",
    parameters=(INVERSE_RATE, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"G_k \to s\,G_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\dot\gamma|}{\dot\gamma_\mathrm{c}}\right)^n s"
    ),
    source="Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147-148, 214; Dullaert & Mewis 2006, "
    "J. Non-Newtonian Fluid Mech. 139, 21",
    check="Oscillate gently after flow at several rates: the moduli should grow at rest.",
    visible="largest rate over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)


class ThixotropicModulusByStress(BrokenByStress):
    """Stress in proportion to a structure s, which the stress breaks."""

    def modulus_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


THIXOTROPIC_MODULUS_BY_STRESS = ThixotropicModulusByStress(
    name="thixotropic_modulus_by_stress",
    parameters=(INVERSE_STRESS, BUILD_UP_TIME, EXPONENT),
    equation=(
        r"G_k \to s\,G_k,\quad t_\mathrm{b}\frac{ds}{dt} = 1 - s"
        r" - \left(\frac{|\sigma|}{\sigma_\mathrm{c}}\right)^n s"
    ),
    source="de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673; Mewis & Wagner 2009, Adv. "
    "Colloid Interface Sci. 147-148, 214",
    check="Oscillate gently after creep at several stresses: the moduli should grow at rest.",
    visible="largest stress over the critical one, to the power n, of about 0.05, over t_b.",
    complexity=3,
)


class ThixotropicRelaxation(BrokenByRate):
    """Relaxation times in proportion to a structure s: less of it flows more easily."""

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


THIXOTROPIC_RELAXATION = ThixotropicRelaxation(
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


class ThixotropicRelaxationByStress(BrokenByStress):
    """Relaxation times in proportion to a structure s, which the stress breaks."""

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


THIXOTROPIC_RELAXATION_BY_STRESS = ThixotropicRelaxationByStress(
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


class ThixotropicRelaxationTwoTimes(BrokenByRate):
    """Relaxation times in proportion to s = (1 − w) s₁ + w s₂, with two structure times."""

    levels = 2

    def time_factor(self, values, state):
        """Return s."""
        return self.whole(values, state)


THIXOTROPIC_RELAXATION_TWO_TIMES = ThixotropicRelaxationTwoTimes(
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
