"""A structure that flow breaks down and rest builds up."""

import jax.numpy as jnp

from discover.effects.base import EffectParameter, StateEffect
from discover.effects.written_state import WrittenState
from tensor_library.isotropic_function import scalars


class Thixotropy(StateEffect):
    """Stress in proportion to a structure s that obeys ds/dt = (1 − s)/t_b − k |γ̇| s.

    Moore's kinetics   [Moore 1959, Trans. Br. Ceram. Soc. 58, 470; Mewis & Wagner 2009].
    """

    rest = 1.0
    acts_on_steady_states = True

    def source_and_decay(self, values, shear_rate, stress):
        """Return 1/t_b and 1/t_b + k |γ̇|."""
        del stress
        build_up = 1.0 / values[1]
        return build_up, build_up + values[0] * jnp.abs(shear_rate)

    def written(self):
        """Return the equation of s, and s."""
        s, breakdown, time, rate = scalars(self.name, "breakdown", "build_up_time", "shear_rate")
        return WrittenState(((1 - s) / time - breakdown * rate * s,), modulus_factor=s)

    def modulus_factor(self, values, state):
        """Return s."""
        del values
        return state


EFFECT = Thixotropy(
    name="thixotropy",
    parameters=(
        EffectParameter(
            "breakdown",
            "k",
            low=0.0,
            high=1e3,
            first_trial=0.02,
            range_source="a strain of 1/k breaks the structure: suspensions of attractive "
            "particles, the most brittle, yield from 0.001 on (Bonn et al. 2017, Rev. Mod. Phys. "
            "89, 035005)",
        ),
        EffectParameter(
            "build_up_time",
            r"t_\mathrm{b}",
            "s",
            low=1e-3,
            high=1e6,
            scale="run_time",
            first_trial=0.3,
            range_source="from the Brownian time 6πηa³/kT of particles of 0.1 µm in water, some "
            "milliseconds, to structures that build up over weeks or never (Mewis & Wagner 2009)",
            ends=("high",),
            endless="damping_by_total_strain",
        ),
    ),
    equation=(
        r"\sigma = s \sum_k \sigma_k,\quad \frac{ds}{dt} = \frac{1 - s}{t_\mathrm{b}}"
        r" - k\,|\dot\gamma|\,s"
    ),
    source="Moore 1959, Trans. Br. Ceram. Soc. 58, 470; Mewis & Wagner 2009, Adv. Colloid "
    "Interface Sci. 147-148, 214",
    check="Start the flow again after rests: the overshoot grows with the length of the rest.",
    visible="k times the strain of about 0.05, where that strain is reached within t_b.",
    complexity=2,
)
