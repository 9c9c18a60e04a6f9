"""Effects that are a free function of one variable, for what no name describes.

A loop fits them after its search, where named effects leave structure. They are no candidates of
the search, and no study names them.
"""

from dataclasses import dataclass
from typing import Literal

import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.effects.base import (
    ConstitutiveEffect,
    EffectParameter,
    Scale,
    SeriesElement,
    StateEffect,
)
from tensor_library.algebra import Symmetric, inner, trace

FreeVariable = Literal["trace of the stress", "rate of deformation", "stress", "shear rate"]

INTERVALS = 6
"""Of the spline, which has one coefficient more."""

ONSET = 0.1
"""Value of a dimensionless variable below which a fluid is all but linear; of a stress, over the
largest. Below it the spline is all but a line."""


@dataclass(frozen=True)
class FreeRelaxation(ConstitutiveEffect):
    """h = f(x) σ, so that each mode relaxes 1 + f times as fast; f(0) = 0.

    x is tr σ (with which PTT and other network models relax faster) or √(γ̇:γ̇/2), the rate times the
    relaxation time (White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867). f is a spline over
    log(1 + x/0.1), so that modes of very different relaxation times share it.

    Attributes
    ----------
    variable
        What x is.
    """

    variable: FreeVariable = "trace of the stress"

    def extra_term(self, values, stress: Symmetric, rate: Symmetric):
        """Return f(x) σ; of the parameters see `_parameters`."""
        x = (
            jnp.sqrt(0.5 * inner(rate, rate))
            if self.variable == "rate of deformation"
            else trace(stress)
        )
        return _value(x, values, onset=ONSET) * stress


class FreeSlip(SeriesElement):
    """A law of slip, γ̇_felt = γ̇ − v(σ) with v odd.

    [Hatzikiriakos 2012, Prog. Polym. Sci. 37, 624]
    """

    variable: FreeVariable = "stress"

    def slip_and_compliance(self, values):
        """Return none that is constant."""
        return jnp.zeros_like(values[0]), jnp.zeros_like(values[0])

    def slip_at(self, values, stress):
        """Return v(σ)/σ at a stress in Pa; of the parameters see `_parameters`."""
        largest = values[1]
        # at rest the ratio is the slope
        size = jnp.maximum(jnp.abs(stress), 1e-3 * largest)
        return _value(size, values, onset=ONSET * largest) / size


@dataclass(frozen=True)
class FreeBreakdown(StateEffect):
    """Stress in proportion to a structure, ds/dt = (1 − s)/t_b − f(|γ̇|) s.

    Moore's kinetics have f = k |γ̇|; others are in Mewis & Wagner 2009, Adv. Colloid Interface Sci.
    147-148, 214, table 1.
    """

    rest = 1.0
    variable: FreeVariable = "shear rate"

    def source_and_decay(self, values, shear_rate, stress):
        """Return 1/t_b and 1/t_b + f(|γ̇|); of the parameters see `_parameters`, the last is t_b."""
        del stress
        build_up = 1.0 / values[-1]
        broken = _value(jnp.abs(shear_rate), values[:-1], onset=ONSET * values[1])
        return build_up, build_up + broken

    def modulus_factor(self, values, state):
        """Return s."""
        del values
        return state


def spline_basis(
    x: Float[Array, "*n"], largest: Float[Array, ""] | float, onset: Float[Array, ""] | float
) -> Float[Array, "*n coefficients"]:
    """Return cubic B-splines of x from 0 to a largest value, less what they are at zero.

    Their knots are even in log(1 + x/onset)   [de Boor 1978, A Practical Guide to Splines, ch. IX].
    """
    place = INTERVALS * jnp.log1p(jnp.clip(x, 0.0, largest) / onset) / jnp.log1p(largest / onset)
    centre = jnp.arange(1.0, INTERVALS + 2.0)
    return _cubic(place[..., None] - centre) - _cubic(-centre)


def _cubic(distance: Float[Array, "*n"]) -> Float[Array, "*n"]:
    far = jnp.clip(2.0 - jnp.abs(distance), 0.0) ** 3
    return (far - 4.0 * jnp.clip(1.0 - jnp.abs(distance), 0.0) ** 3) / 6.0


def _value(x, values, onset):
    """Return the function at x, constant from the third parameter on."""
    switch, largest, end, coefficients = values[0], values[1], values[2], values[3:]
    return switch * (spline_basis(jnp.minimum(x, end), largest, onset) @ coefficients)


def _parameters(
    unit: str, scale: Scale, low: float, high: float, range_scale: Scale, source: str
) -> tuple[EffectParameter, ...]:
    """Return a switch, the largest x of the fitted runs, its end, and the coefficients."""
    of_runs = "of the fitted runs"
    return (
        EffectParameter("on", "1", low=0.0, high=1.0, range_source="a switch"),
        EffectParameter("largest", r"x_\max", low=0.0, first_trial=1.0, range_source=of_runs),
        EffectParameter("end", r"x_e", low=0.0, first_trial=1.0, range_source=of_runs),
        *(
            EffectParameter(
                f"c{i}", f"c_{i}", unit, low=low, high=high, scale=scale, first_trial=0.1,
                range_source=source, range_scale=range_scale,
            )
            for i in range(1, INTERVALS + 2)
        ),
    )  # fmt: skip


FREE_RELAXATIONS: tuple[FreeRelaxation, ...] = tuple(
    FreeRelaxation(
        name=f"free relaxation by {variable}",
        parameters=_parameters(
            "", "one", -1.0, 100.0, "one",
            "from no relaxation at all to a hundred times the linear one: a fluid that flow makes "
            "relax faster has lost its memory",
        ),
        equation=r"h \mathrel{+}= f(x)\,\sigma",
        source="White & Metzner 1963, J. Appl. Polym. Sci. 7, 1867, for the rate",
        check="A flow of another kind, such as a reversal or extension.",
        explicit_rate=variable == "rate of deformation",
        variable=variable,
    )
    for variable in ("trace of the stress", "rate of deformation")
)  # fmt: skip

FREE_SLIP = FreeSlip(
    name="free slip",
    parameters=_parameters(
        "1/s", "rate", -1.0, 10.0, "rate",
        "slip cannot exceed the deformation commanded; ten times leaves room for runs that differ",
    ),
    equation=r"\dot\gamma_\mathrm{felt} = \dot\gamma - v(\sigma)",
    source="Hatzikiriakos 2012, Prog. Polym. Sci. 37, 624",
    check="Repeat with another gap H: slip goes as 1/H; roughen the plates.",
)  # fmt: skip

FREE_BREAKDOWN = FreeBreakdown(
    name="free breakdown",
    parameters=(
        *_parameters(
            "1/s", "rate", 0.0, 1e3, "rate",
            "a strain of a thousandth breaks the most brittle structure: Bonn et al. 2017, Rev. "
            "Mod. Phys. 89, 035005",
        ),
        EffectParameter(
            "build_up_time", r"t_\mathrm{b}", "s", low=1e-3, high=1e6, scale="run_time",
            first_trial=0.3, range_source="as of thixotropy",
        ),
    ),
    equation=r"\sigma = s \sum_k \sigma_k,\quad \frac{ds}{dt} = \frac{1 - s}{t_\mathrm{b}}"
    r" - f(|\dot\gamma|)\,s",
    source="Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147-148, 214",
    check="Start the flow again after rests: the overshoot grows with the length of the rest.",
)  # fmt: skip
