"""Effects of the fluid with a state: structure that flow breaks, heat, softening by work."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, StateEffect, WrittenState
from tensor_library.isotropic_function import scalars


class Thixotropy(StateEffect):
    """Stress in proportion to a structure s with ds/dt = (1 − s)/t_b − k |γ̇| s.

    [Moore 1959, Trans. Br. Ceram. Soc. 58, 470; Mewis & Wagner 2009]
    """

    rest = 1.0
    acts_on_steady_states = True

    def source_and_decay(self, values, shear_rate, stress):
        del stress
        build_up = 1.0 / values[1]
        return build_up, build_up + values[0] * jnp.abs(shear_rate)

    def written(self):
        s, breakdown, time, rate = scalars(self.name, "breakdown", "build_up_time", "shear_rate")
        return WrittenState(((1 - s) / time - breakdown * rate * s,), modulus_factor=s)

    def modulus_factor(self, values, state):
        del values
        return state


THIXOTROPY = Thixotropy(
    name="thixotropy", complexity=2,
    parameters=(
        EffectParameter(
            "breakdown", r"k_\mathrm{b}", meaning="breakdown per unit strain", low=0.0, high=1e3,
            first_trial=0.02,
            range_source="a strain of 1/k_b breaks the structure: suspensions of attractive "
            "particles, the most brittle, yield from 0.001 on (Bonn et al. 2017, Rev. Mod. Phys. "
            "89, 035005)",
        ),
        EffectParameter(
            "build_up_time", r"t_\mathrm{b}", "s", low=1e-3, high=1e6, scale="run_time",
            first_trial=0.3, endless="damping_by_total_strain",
            meaning="build-up time",
            range_source="from the Brownian time 6πηa³/kT of particles of 0.1 µm in water, some "
            "milliseconds, to structures that build up over weeks or never (Mewis & Wagner 2009)",
        ),
    ),
    equation=r"G_k \to s\,G_k,\quad \frac{ds}{dt} = \frac{1 - s}{t_\mathrm{b}} - "
    r"k_\mathrm{b}\,|\dot\gamma|\,s",
    source="Moore 1959, Trans. Br. Ceram. Soc. 58, 470; Mewis & Wagner 2009, Adv. Colloid "
    "Interface Sci. 147-148, 214",
    check="Start the flow again after rests: the overshoot grows with the length of the rest.",
    visible="k_b times the strain of about 0.05, where that strain is reached within t_b.",
)  # fmt: skip


class ViscousHeating(StateEffect):
    """Relaxation times shortened by the heat of the flow by exp(−Θ) [Winter 1977].

    dΘ/dt = b_h σγ̇ − Θ/t_h: b_h is −d ln a_T/dT over the heat capacity per volume, t_h the time in
    which heat leaves the gap.
    """

    def source_and_decay(self, values, shear_rate, stress):
        return values[0] * stress * shear_rate, 1.0 / values[1]

    def written(self):
        import sympy

        softening, time = scalars(*(parameter.name for parameter in self.parameters))
        theta, rate, stress = scalars(self.name, "shear_rate", "shear_stress")
        changes = softening * stress * rate - theta / time
        return WrittenState((changes,), time_factor=sympy.exp(-theta))

    def time_factor(self, values, state):
        del values
        return jnp.exp(-state)


VISCOUS_HEATING = ViscousHeating(
    name="viscous_heating", complexity=2,
    parameters=(
        EffectParameter(
            "heating", r"b_\mathrm{h}", "1/Pa", meaning="fall of ln λ per unit work", low=0.0,
            high=1.0, scale="inverse_stress", first_trial=0.01, range_scale="softening_by_heat",
            range_source="work that all becomes heat, with −d ln a_T/dT from the shift factors of "
            "the runs; without these 0.8 1/K, as at a glass transition (Ferry 1980, ch. 11: 2.303 "
            "· 17.44/51.6 K), where most liquids have 0.01 to 0.1; the heat capacity per volume of "
            "liquids is 1 to 4 MJ/(m³ K)",
        ),
        EffectParameter(
            "heat_loss_time", r"t_\mathrm{h}", "s", low=1e-4, high=25.0, scale="run_time",
            first_trial=0.3, range_scale="shift_factor",
            range_source="H²/(π² a) with the diffusivity of heat of liquids, a = 1e-7 m²/s, and a "
            "gap H of 10 µm to 5 mm between walls of metal (Winter 1977)",
        ),
    ),
    equation=r"\lambda_k \to \lambda_k e^{-\Theta},\quad "
    r"\frac{d\Theta}{dt} = b_\mathrm{h}\,\sigma\dot\gamma "
    r"- \frac{\Theta}{t_\mathrm{h}}",
    source="Winter 1977, Adv. Heat Transfer 13, 205",
    check="Repeat with half the gap, which cools faster; measure the temperature of the sample.",
    visible="b_h times the work done per volume within t_h of about 0.05.",
)  # fmt: skip


# the equation of viscous heating; the cause is junctions or structure that work breaks
SOFTENING_BY_WORK = ViscousHeating(
    name="softening_by_work", complexity=3,
    parameters=(
        EffectParameter(
            "softening", r"b_\mathrm{r}", "1/Pa", meaning="fall of ln λ per unit work", low=0.0,
            high=10.0, scale="inverse_stress", first_trial=0.01, range_scale="inverse_stress",
            range_source="the work 1/b_r, σ times a strain, takes a deformation of more than 10 %: "
            "networks of chains, which are known to soften by work, are linear up to there "
            "(Treloar 1975, The Physics of Rubber Elasticity, ch. 5)",
        ),
        EffectParameter(
            "recovery_time", r"t_\mathrm{r}", "s", low=1e-3, high=1e6, scale="run_time",
            first_trial=0.3,
            range_source="like the build-up time of thixotropy, from milliseconds to never: "
            "rubber stays as soft as its first stretch made it (Mullins 1969)",
        ),
    ),
    equation=r"\lambda_k \to \lambda_k e^{-\Theta},\quad "
    r"\frac{d\Theta}{dt} = b_\mathrm{r}\,\sigma\dot\gamma "
    r"- \frac{\Theta}{t_\mathrm{r}}",
    source="Mullins 1969, Rubber Chem. Technol. 42, 339, and Ogden & Roxburgh 1999, Proc. R. Soc. "
    "A 455, 2861 for softening by work; that it shortens times, as heat would, is an assumption",
    check="Repeat a weak flow after a strong one, at once and after rests; the temperature does "
    "not change.",
    visible="b_r times the work done per volume within t_r of about 0.05.",
)  # fmt: skip
