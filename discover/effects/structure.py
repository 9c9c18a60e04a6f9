"""A structure of the fluid that flow breaks and rest mends, on which the stress depends."""

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

    [Wei, Solomon & Larson 2018, J. Rheol. 62, 321]. R and w stand in the place of m, which is
    Cross's: no record of which we know determines all five constants.
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
