"""Effects on the deformation that the fluid felt."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import roots_sh_jacobi

from discover.effects.base import (
    EffectParameter,
    KinematicEffect,
    OfRun,
    RadialAverage,
    SeriesElement,
    Signal,
)
from discover.statistics.noise_model import first_order


def first_order_lag(times: Signal, values: Signal, time_constant: OfRun) -> Signal:
    """Return y of τ y' + y = x from y = 0, exact for x linear between times in s; x at τ = 0."""
    if isinstance(values, np.ndarray):
        each = np.broadcast_arrays(times, values, time_constant)
        found, own, lag = (of.reshape(-1, of.shape[-1]) for of in (each[1].copy(), *each[::2]))
        moved = np.flatnonzero(lag[:, 0] > 0.0)
        found[moved] = _lagged(own[moved], found[moved], lag[moved, :1])
        return found.reshape(each[1].shape)
    return _lagged(times, values, time_constant)


def _lagged(times: Signal, values: Signal, time_constant: OfRun) -> Signal:
    of: Any = values.__array_namespace__()
    active = time_constant > 0.0
    safe = of.where(active, time_constant, 1.0)
    step = of.diff(times) / safe
    decay = of.exp(-step)
    # weights of the two ends of an interval: ∫ e^{-(h-s)} (linear) ds
    mean = -of.expm1(-step) / step
    forcing = values[..., 1:] * (1.0 - mean) + values[..., :-1] * (mean - decay)
    carried = _carried_in_numpy if isinstance(values, np.ndarray) else _carried
    return of.where(active, carried(decay, forcing), values)


def _carried(decay: Float[Array, " m"], forcing: Float[Array, " m"]) -> Float[Array, " n"]:
    """Return y from zero on, with y' = decay · y + forcing from one time to the next."""

    def onward(lagged, interval):
        decay, forcing = interval
        lagged = decay * lagged + forcing
        return lagged, lagged

    # one after another: half of the time of a scan in parallel, and a sixth of its compiling
    _, lagged = jax.lax.scan(onward, jnp.zeros(()), (decay, forcing))
    return jnp.concatenate([jnp.zeros(1), lagged])


def _carried_in_numpy(
    decay: Float[np.ndarray, "... m"], forcing: Float[np.ndarray, "... m"]
) -> Float[np.ndarray, "... n"]:
    ends = (*[(0, 0)] * (forcing.ndim - 1), (1, 0))  # from zero on
    kept = np.pad(np.broadcast_to(decay, forcing.shape), ends)
    lagged = np.pad(forcing, ends)
    for at in np.ndindex(lagged.shape[:-1]):
        lagged[at] = first_order(kept[at], lagged[at])
    return lagged


class RateGain(KinematicEffect):
    """The rate felt is (1 + g) times the commanded one."""

    acts_on_steady_states = takes_numpy = True

    def felt_rate(self, values, instrument_times, shear_rate):
        del instrument_times
        return (1.0 + values[0]) * shear_rate


RATE_GAIN = RateGain(
    name="rate_gain",
    parameters=(
        EffectParameter(
            "gain_error", r"g_\mathrm{r}", low=-0.5, high=1.0, first_trial=0.01,
            range_source="a gap or an angle wrong by a factor of two; the zero of a gap is off by "
            "10 to 100 µm (Davies & Stokes 2008, J. Non-Newtonian Fluid Mech. 148, 73)",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = (1 + g_\mathrm{r})\,\dot\gamma",
    source="Macosko 1994, Rheology, ch. 8: errors of cone angle and gap",
    check="Measure a Newtonian oil; measure the gap and the cone angle.",
    visible="g_r of about 0.05.",
)  # fmt: skip


def _torque_between_plates() -> tuple[tuple[float, ...], ...]:
    """Radii, and weights of stress and of moduli, for 4 ∫ x² σ(x γ̇) dx: Gauss–Radau for σ/x.

    Stress vanishes on the axis, the zero of a transducer does not: it gets what is missing to one.
    """
    # of the three interior nodes Gauss's rule has the weight (1 − x) x³
    radii, weights = roots_sh_jacobi(3, 5, 4)
    weights = 4.0 * weights / (1.0 - radii)
    of_modulus = np.array([0.0, *weights, 1.0 - np.sum(weights)])
    radii = np.array([0.0, *radii, 1.0])
    of_stress = np.array([0.0, *of_modulus[1:] / radii[1:]])
    of_stress[0] = 1.0 - np.sum(of_stress)
    return tuple(tuple(each.tolist()) for each in (radii, of_stress, of_modulus))


_RADII, _OF_STRESS, _OF_MODULUS = _torque_between_plates()

PARALLEL_PLATES = RadialAverage(
    name="parallel_plates", radii=_RADII, of_stress=_OF_STRESS, of_modulus=_OF_MODULUS,
    parameters=(
        EffectParameter(
            "share", "p", low=0.0, high=1.0, first_trial=0.1,
            # the torque is corrected or it is not; it goes as the third power of the radius to
            # which the sample ends, known to 1 to 2 %   [Macosko 1994, ch. 5]
            sound=(1.0, 0.05),
            range_source="0 of a cone, or after the correction of Weissenberg and Rabinowitsch, "
            "and 1 between plates without it",
            meaning="of the torque between plates without correction",
        ),
    ),
    equation=r"\sigma_\mathrm{rec}(\dot\gamma) = (1 - p)\,\sigma(\dot\gamma)"
    r" + 4 p \int_0^1 x^2\,\sigma(x \dot\gamma)\,dx",
    source="Bird, Armstrong & Hassager 1987, Dynamics of Polymeric Liquids 1, eq. 10.2-15",
    check="Repeat with a cone; see whether the export corrects the torque of plates.",
    visible="p of about one where the stress is a tenth below a straight line.",
)  # fmt: skip


class RateRiseTime(KinematicEffect):
    """The rate felt follows the commanded one with a first-order lag on the instrument's clock."""

    takes_numpy = True

    def felt_rate(self, values, instrument_times, shear_rate):
        return first_order_lag(instrument_times, shear_rate, values[0])


RATE_RISE_TIME = RateRiseTime(
    name="rate_rise_time", shapes_command=True,
    parameters=(
        EffectParameter(
            "tau", r"t_\mathrm{m}", "s", low=0.0, high=10.0, scale="sampling_time", first_trial=0.5,
            range_source="motors answer in 0.01 to 0.1 s; a badly tuned loop that controls the "
            "rate of a stress-controlled instrument needs seconds",
        ),
    ),
    equation=r"t_\mathrm{m}\,\frac{d\dot\gamma_\mathrm{felt}}{dt} + \dot\gamma_\mathrm{felt}"
    r" = \dot\gamma",
    source="Macosko 1994, Rheology, ch. 8: response time of the drive",
    check="Record the motor's angle in start-up.",
    visible="t_m of about 5 % of the time in which the stress grows.",
)  # fmt: skip


class ToolCompliance(SeriesElement):
    """The strain felt is the commanded one less C σ   [Gottlieb & Macosko 1982]."""

    def slip_and_compliance(self, values):
        return jnp.zeros_like(values[0]), values[0]


TOOL_COMPLIANCE = ToolCompliance(
    name="tool_compliance",
    parameters=(
        EffectParameter(
            "compliance", "C", "1/Pa", low=0.0, high=0.1, scale="compliance", first_trial=0.01,
            range_source="πR⁴/(2 H K) of a torsion bar as soft as K = 0.1 N m/rad with R = 50 mm, "
            "H = 1 mm; other transducers are 1000 times as stiff (Gottlieb & Macosko 1982)",
        ),
    ),
    equation=r"\gamma_\mathrm{felt} = \gamma - C\,\sigma",
    source="Gottlieb & Macosko 1982, Rheol. Acta 21, 90",
    check="Glue the tools together and twist; repeat with smaller plates, which need less torque.",
    visible="C times the plateau modulus of about 0.05.",
)  # fmt: skip


class WallSlip(SeriesElement):
    """Slip in proportion to the stress, γ̇_felt = γ̇ − s_w σ   [Navier 1823; Yoshimura 1988]."""

    acts_on_steady_states = True

    def slip_and_compliance(self, values):
        return values[0], jnp.zeros_like(values[0])


WALL_SLIP = WallSlip(
    name="wall_slip",
    parameters=(
        EffectParameter(
            "slip", r"s_\mathrm{w}", "1/(Pa s)", low=0.0, high=10.0, scale="fluidity",
            first_trial=0.01, range_scale="fluidity",
            range_source="slip cannot exceed the deformation commanded, s_w σ = γ̇; ten times "
            "leaves room for runs that differ",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = \dot\gamma - s_\mathrm{w}\,\sigma,"
    r"\quad s_\mathrm{w} = 2 b / H",
    source="Yoshimura & Prud'homme 1988, J. Rheol. 32, 53 (slip velocity b sigma, gap H)",
    check="Repeat with another gap H: slip goes as 1/H; roughen the plates.",
    visible="s_w of about 5 % of the inverse zero-shear viscosity.",
)  # fmt: skip
