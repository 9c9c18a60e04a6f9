"""Effects of the fluid with a state: structure that flow breaks, heat, softening by work."""

from dataclasses import dataclass, replace
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.effects.base import EffectParameter, StateEffect, WrittenState
from tensor_library.isotropic_function import scalars

CROSS = 2.0 / 3.0
"""Exponent of the rate of dispersions   [Cross 1965]."""

_MEWIS = "Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147-148, 214"
_MENDES = "de Souza Mendes & Thompson 2013, Rheol. Acta 52, 673"
_DULLAERT = "Dullaert & Mewis 2006, J. Non-Newtonian Fluid Mech. 139, 21"


@dataclass(frozen=True)
class Structure(StateEffect):
    """A structure s, one at rest: ds/dt = (1 − s)/t_b − (X/X_c)^m s/t_b.

    In steady flow s = 1/(1 + (X/X_c)^m), Cross's equation   [Cross 1965, J. Colloid Sci. 20, 417;
    Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147–148, 214]. Parameters: 1/X_c (the
    amplitude), t_b, m. `broken_by`: X, the shear rate or the stress. `scales`: what s multiplies,
    the stress or the relaxation times of all modes.
    """

    broken_by: Literal["rate", "stress"] = "rate"
    scales: Literal["modulus", "time"] = "modulus"

    rest = 1.0
    acts_on_steady_states = True
    # each has three constants or more, and few fluids heal: searches of all others stay as fast
    on_request = True

    @property
    def changes_times(self) -> bool:
        """Whether s multiplies the relaxation times."""
        return self.scales == "time"

    def source_and_decay(self, values, shear_rate, stress):
        times = values[1] if self.levels == 1 else values[1] * jnp.array([1.0, values[2]])
        size = values[0] * jnp.abs(shear_rate if self.broken_by == "rate" else stress)
        # a power below one has no derivative at zero
        flows = size > 0.0
        exponent = values[2] if self.levels == 1 else CROSS
        broken = jnp.where(flows, jnp.where(flows, size, 1.0) ** exponent, 0.0)
        return 1.0 / times, (1.0 + broken) / times

    def written(self):
        import sympy

        critical, exponent, time, slowness, share, breaks = scalars(
            self.parameters[0].name, "exponent", "build_up_time", "slowness", "slow_share",
            f"shear_{self.broken_by}",
        )  # fmt: skip
        power = exponent if self.levels == 1 else sympy.Rational(2, 3)
        broken = (critical * sympy.Abs(breaks)) ** power
        levels = [scalars(name) for name in self.level_names]
        times = [time] if self.levels == 1 else [time, slowness * time]
        rates = ((1 - level * (1 + broken)) / t for level, t in zip(levels, times, strict=True))
        whole = levels[0] if self.levels == 1 else (1 - share) * levels[0] + share * levels[1]
        return WrittenState(tuple(rates), **{f"{self.scales}_factor": whole})

    def whole(self, values: Float[Array, " p"], state) -> Float[Array, ""]:
        """Return s."""
        if self.levels == 1:
            return state
        return (1.0 - values[3]) * state[0] + values[3] * state[1]

    def modulus_factor(self, values, state):
        return jnp.ones(()) if self.changes_times else self.whole(values, state)

    def time_factor(self, values, state):
        return self.whole(values, state) if self.changes_times else jnp.ones(())


class TwoStructures(Structure):
    """Two structures with one steady state: s = (1 − w) q₁ + w q₂, of times t₁ and t₂ = R t₁.

    [Wei, Solomon & Larson 2018, J. Rheol. 62, 321]. m is Cross's: no record determines all five.
    """

    levels = 2


INVERSE_RATE = EffectParameter(
    "inverse_critical_rate", r"1/\dot\gamma_\mathrm{c}", "s", low=0.0, high=1e5,
    scale="inverse_rate", first_trial=0.3,
    range_source="half of a structure is broken at the critical rate: the slowest steady flows of "
    "rheometers, 1e-5 1/s, break those of gels (Mewis & Wagner 2009)",
)  # fmt: skip

INVERSE_STRESS = EffectParameter(
    "inverse_critical_stress", r"1/\sigma_\mathrm{c}", "1/Pa", low=0.0, high=100.0,
    scale="inverse_stress", first_trial=0.3, range_scale="inverse_stress",
    range_source="half of a structure is broken at the critical stress; if that is a hundredth of "
    "the recorded stress, the structure is broken throughout",
)  # fmt: skip

BUILD_UP_TIME = EffectParameter(
    "build_up_time", r"t_\mathrm{b}", "s", low=1e-3, high=1e6, scale="run_time", first_trial=0.3,
    meaning="build-up time",
    range_source="as for thixotropy, from some milliseconds to never (Mewis & Wagner 2009)",
)  # fmt: skip
_FAST = replace(BUILD_UP_TIME, symbol="t_1", meaning="build-up time of the fast structure, q_1")

EXPONENT = EffectParameter(
    "exponent", "m", low=0.1, high=4.0, first_trial=1.0,
    range_source="1 in most models of thixotropy, other values in some (Mewis & Wagner 2009), 2/3 "
    "in Cross's equation for dispersions; beyond 4 the whole structure breaks at one rate or "
    "stress",
)  # fmt: skip

SLOWNESS = EffectParameter(
    "slowness", "R", low=2.0, high=1e4, first_trial=30.0,
    meaning="slow over fast build-up time, t_2/t_1",
    range_source="structure times less than a factor of two apart count as one (those of Wei, "
    "Solomon & Larson 2018 spread over decades)",
)  # fmt: skip

SLOW_SHARE = EffectParameter(
    "slow_share", "w", low=0.01, high=0.99, first_trial=0.1,
    meaning="share of the slow structure, q_2",
    range_source="with less than one part in a hundred of either there is only one structure",
)  # fmt: skip


def _one_structure(
    name: str, scales: Literal["modulus", "time"], broken_by: Literal["rate", "stress"],
    source: str, check: str,
) -> Structure:  # fmt: skip
    """Return a structure; its equation follows from what it scales and what breaks it."""
    scaled = {"modulus": "G_k", "time": r"\lambda_k"}[scales]
    letter = {"rate": r"\dot\gamma", "stress": r"\sigma_{12}"}[broken_by]
    return Structure(
        name=name,
        parameters=(
            INVERSE_RATE if broken_by == "rate" else INVERSE_STRESS, BUILD_UP_TIME, EXPONENT,
        ),
        equation=rf"{scaled} \to s\,{scaled},\quad t_\mathrm{{b}}\frac{{ds}}{{dt}} = 1 - s"
        rf" - \left(\frac{{|{letter}|}}{{{letter.partition('_')[0]}_\mathrm{{c}}}}\right)^m s",
        source=source,
        check=check,
        visible=f"largest {broken_by} over the critical one, to the power m, of about 0.05, over "
        "t_b.",
        complexity=3,
        broken_by=broken_by,
        scales=scales,
    )  # fmt: skip


THIXOTROPIC_MODULUS = _one_structure(  # `thixotropy` is the case m = 1
    "thixotropic_modulus", "modulus", "rate",
    source=f"{_MEWIS}; {_DULLAERT}",
    check="Oscillate gently after flow at several rates: the moduli should grow at rest.",
)  # fmt: skip

THIXOTROPIC_MODULUS_BY_STRESS = _one_structure(
    "thixotropic_modulus_by_stress", "modulus", "stress",
    source=f"{_MENDES}; {_MEWIS}",
    check="Oscillate gently after creep at several stresses: the moduli should grow at rest.",
)  # fmt: skip

THIXOTROPIC_RELAXATION = _one_structure(
    "thixotropic_relaxation", "time", "rate",
    source=f"{_MENDES}, for a viscosity that a structure makes; {_DULLAERT}, and Cross 1965, J. "
    "Colloid Sci. 20, 417, for its kinetics",
    check="Stop flows of several rates: the stress relaxes faster after the faster ones.",
)  # fmt: skip

THIXOTROPIC_RELAXATION_BY_STRESS = _one_structure(
    "thixotropic_relaxation_by_stress", "time", "stress",
    source=f"{_MENDES}; Larson & Wei 2019, J. Rheol. 63, 477",
    check="Creep: below the critical stress the rate falls with time, above it rises.",
)  # fmt: skip

THIXOTROPIC_RELAXATION_TWO_TIMES = TwoStructures(
    name="thixotropic_relaxation_two_times",
    parameters=(INVERSE_RATE, _FAST, SLOWNESS, SLOW_SHARE),
    equation=r"\lambda_k \to [(1 - w)\,q_1 + w\,q_2]\,\lambda_k,\quad t_i\frac{dq_i}{dt} = 1 - q_i"
    r" - \left(\frac{|\dot\gamma|}{\dot\gamma_\mathrm{c}}\right)^{2/3} q_i,\quad t_2 = R\,t_1,"
    r"\quad 2/3\ \mathrm{fixed}",
    source="Wei, Solomon & Larson 2018, J. Rheol. 62, 321, for several times with one steady state",
    check="Rest for different lengths before a start: recovery in two steps.",
    visible="as thixotropic_relaxation.",
    complexity=4,
    scales="time",
)


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
    """Times shortened by heat, exp(−Θ), with dΘ/dt = b_h σγ̇ − Θ/t_h   [Winter 1977]."""

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
