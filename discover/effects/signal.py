"""Effects that change what was recorded."""

import jax.numpy as jnp
import numpy as np

from discover.effects.base import EffectParameter, SignalEffect
from discover.effects.kinematic import first_order_lag


class BearingFriction(SignalEffect):
    """A constant torque against the tool's motion is recorded with the stress (Coulomb)."""

    acts_on_steady_states = takes_numpy = True

    def recorded_stress(self, values, record):
        sign = record.tool_rate.__array_namespace__().sign
        return record.stress + values[0] * sign(record.tool_rate)


BEARING_FRICTION = BearingFriction(
    name="bearing_friction",
    parameters=(
        EffectParameter(
            "friction", r"\sigma_\mathrm{f}", "Pa", low=0.0, high=1.0, scale="stress",
            first_trial=0.01, range_scale="stress",
            range_source="with more friction than stress, most records would be records of the "
            "bearing",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + "
    r"\sigma_\mathrm{f}\,\mathrm{sign}(\dot\gamma_\mathrm{tool})",
    source="Macosko 1994, Rheology, ch. 8: friction and residual torque of bearings",
    check="Turn the tool in air, slowly, both ways.",
    visible="sigma_f of about 5 % of the root-mean-square stress.",
)  # fmt: skip


class EdgeFracture(SignalEffect):
    """Beyond a strain the sheared area, and with it the torque, shrinks exponentially.

    The strain is the total one, in both directions. Empirical: theory says when an edge breaks
    [Tanner & Keentok 1983, J. Rheol. 27, 47], experiment that the torque then falls cycle by cycle
    [Mattes, Vogt & Friedrich 2008, Rheol. Acta 47, 929].
    """

    takes_numpy = True

    def recorded_stress(self, values, record):
        of = record.stress.__array_namespace__()
        beyond = of.maximum(record.total_strain - values[1], 0.0)
        return record.stress * of.exp(-values[0] * beyond)


EDGE_FRACTURE = EdgeFracture(
    name="edge_fracture", complexity=2,
    parameters=(
        EffectParameter(
            "loss", r"k_\mathrm{e}", meaning="of the stress per unit strain", low=0.0, high=10.0,
            first_trial=0.005,
            range_source="a strain of 1/k_e empties the gap: a crack grows inwards with the flow, "
            "and melts lose their torque over strains of ten and more (Mattes et al. 2008)",
        ),
        EffectParameter(
            "critical_strain", r"\gamma_\mathrm{c}", low=0.0, high=10.0, scale="strain",
            first_trial=0.3, range_scale="strain",
            range_source="an edge that is still whole at the largest strain has no effect; it may "
            "also be broken from the start",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma\,e^{-k_\mathrm{e}\,\max(0,\ \gamma_\mathrm{total} - "
    r"\gamma_\mathrm{c})}",
    source="Mattes, Vogt & Friedrich 2008, Rheol. Acta 47, 929: the torque of melts falls from "
    "cycle to cycle. Tanner & Keentok 1983, J. Rheol. 27, 47, say when an edge breaks (by N2), "
    "not how the torque falls: the exponential in strain is an empirical form",
    check="Watch the edge; repeat with a smaller cone angle.",
    visible="k_e times the strain beyond the critical one of about 0.1.",
)  # fmt: skip


# Below this fraction of the record a step only marks a jump of the rate, whose torque is over
# before a sample is taken
_JUMP = 1e-9


class InstrumentInertia(SignalEffect):
    """The stress recorded contains the inertia of the tool; negative if over-corrected."""

    takes_numpy = True

    def recorded_stress(self, values, record):
        of, times = record.tool_rate.__array_namespace__(), record.instrument_times
        step = of.diff(times)
        shortest = _JUMP * (times[..., -1:] - times[..., :1])
        slope = of.where(step > shortest, of.diff(record.tool_rate) / step, 0.0)
        # slope at the points, from the intervals at both sides
        inside = 0.5 * (slope[..., 1:] + slope[..., :-1])
        at_points = of.concatenate([slope[..., :1], inside, slope[..., -1:]], axis=-1)
        # the rate is per second of material time; the tool moves on the instrument's clock
        return record.stress + values[0] * record.clock_factor * at_points

    def inertia(self, values):
        return values[0]


INSTRUMENT_INERTIA = InstrumentInertia(
    name="instrument_inertia",
    parameters=(
        EffectParameter(
            "inertia", r"I_\mathrm{t}", "Pa s^2", low=-1e3, high=1e3, scale="inertia",
            first_trial=0.01,
            range_source="2 J H/(πR⁴) of motor and tool with J = 1e-4 N m s², plates of R = 4 mm "
            "and H = 1 mm give 120; a correction for it can be wrong by its whole size, either "
            "way: J is determined empirically, and its precision is rarely stated (Klemuk & Titze "
            "2009)",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + I_\mathrm{t}\,\frac{d\dot\gamma_\mathrm{tool}}{dt}",
    source="Krieger 1990, J. Rheol. 34, 471; Klemuk & Titze 2009, J. Rheol. 53, 765 for its error",
    check="Oscillate a Newtonian oil over the same frequencies; compare the raw phase.",
    visible="I_t omega of about 5 % of the dynamic viscosity at the highest frequency omega.",
)  # fmt: skip


class StressDrift(SignalEffect):
    """A stress that grows linearly with instrument time is added to the one recorded."""

    takes_numpy = True

    def recorded_stress(self, values, record):
        return record.stress + values[0] * record.instrument_times


STRESS_DRIFT = StressDrift(
    name="stress_drift",
    parameters=(
        EffectParameter(
            "drift", "a", "Pa/s", low=-2.0, high=2.0, scale="stress_rate", first_trial=0.01,
            range_scale="stress_rate",
            range_source="at twice the stress over the length of a run, half of the record is the "
            "drift of an instrument that measures nothing",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + a\,t",
    source="Macosko 1994, Rheology, ch. 8: transducer drift",
    check="Record the stress of a sample at rest for as long as the longest run.",
    visible="a times the length of a run of about 10 % of its root-mean-square stress.",
)  # fmt: skip


class StressGain(SignalEffect):
    """The stress recorded is (1 + g_s) times the true one."""

    acts_on_steady_states = takes_numpy = True

    def recorded_stress(self, values, record):
        return (1.0 + values[0]) * record.stress


STRESS_GAIN = StressGain(
    name="stress_gain",
    parameters=(
        EffectParameter(
            "gain_error", r"g_\mathrm{s}", low=-0.8, high=4.0, first_trial=0.01,
            range_source="a factor of five either way: the stress goes as 1/R³, and 25 mm entered "
            "for plates of 40 mm gives a factor of four (Macosko 1994, ch. 5)",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = (1 + g_\mathrm{s})\,\sigma",
    source="Macosko 1994, Rheology, ch. 8: calibration and sample radius",
    check="Calibrate the transducer with a dead weight; look at the filling of the gap.",
    visible="g_s of about 0.05.",
)  # fmt: skip


class NormalForceGain(StressGain):
    """The normal or tensile stress recorded is (1 + g_N) times the true one, the torque is not."""

    of_force = True


NORMAL_FORCE_GAIN = NormalForceGain(
    name="normal_force_gain",
    parameters=(
        EffectParameter(
            "gain_error", r"g_\mathrm{N}", low=-0.8, high=4.0, first_trial=0.01,
            range_source="a factor of five either way: N1 goes as 1/R², and 25 mm entered for "
            "plates of 40 mm gives a factor of 2.6 (Macosko 1994, ch. 5)",
        ),
    ),
    equation=r"N_{1,\mathrm{rec}} = (1 + g_\mathrm{N})\,N_1",
    source="Macosko 1994, Rheology, ch. 8: a transducer of normal force is one of its own, softer "
    "than that of the torque",
    check="Calibrate the normal force with a dead weight.",
    visible="g_N of about 0.05.",
)  # fmt: skip


class StressOffset(SignalEffect):
    """A constant is added to the stress recorded."""

    acts_on_steady_states = takes_numpy = is_zero = True

    def recorded_stress(self, values, record):
        return record.stress + values[0]


STRESS_OFFSET = StressOffset(
    name="stress_offset",
    parameters=(
        EffectParameter(
            "offset", r"\sigma_0", "Pa", low=-1.0, high=1.0, scale="stress", first_trial=0.01,
            range_scale="stress",
            range_source="with more offset than stress, most records would show only the zero of "
            "the transducer",
        ),
    ),
    equation=r"\sigma_\mathrm{rec} = \sigma + \sigma_0",
    source="Macosko 1994, Rheology, ch. 8: transducer zero",
    check="Record the stress before the flow starts.",
    visible="sigma_0 of about 5 % of the root-mean-square stress.",
)  # fmt: skip


class TimeDelay(SignalEffect):
    """The stress recorded is the true one earlier on the instrument's clock, zero at first."""

    takes_numpy = True

    def recorded_stress(self, values, record):
        earlier = record.instrument_times - values[0]
        if not isinstance(record.stress, np.ndarray):
            return jnp.interp(earlier, record.instrument_times, record.stress, left=0.0)
        each = np.broadcast_arrays(earlier, record.instrument_times, record.stress)
        asked, times, stress = (of.reshape(-1, of.shape[-1]) for of in each)
        found = stress.copy()
        for row in np.flatnonzero(asked[:, 0] != times[:, 0]):
            found[row] = np.interp(asked[row], times[row], stress[row], left=0.0)
        return found.reshape(earlier.shape)

    def response(self, values, frequency):
        return jnp.exp(-1j * frequency * values[0])


TIME_DELAY = TimeDelay(
    name="time_delay",
    parameters=(
        EffectParameter(
            "delay", r"\delta", "s", low=0.0, high=10.0, scale="sampling_time", first_trial=0.5,
            range_source="channels read one after another differ by a millisecond, and programs "
            "that average each point over seconds delay it by as much",
        ),
    ),
    equation=r"\sigma_\mathrm{rec}(t) = \sigma(t - \delta)",
    source="Macosko 1994, Rheology, ch. 8: data acquisition",
    check="Record the angle and the torque of an elastic spring together.",
    visible="delta of about 5 % of the time in which the stress changes, 0.05/omega in "
    "oscillation.",
)  # fmt: skip


class TransducerLag(SignalEffect):
    """The stress recorded follows the true one with a first-order lag on the instrument's clock."""

    takes_numpy = True

    def recorded_stress(self, values, record):
        return first_order_lag(record.instrument_times, record.stress, values[0])

    def response(self, values, frequency):
        return 1.0 / (1.0 + 1j * frequency * values[0])


TRANSDUCER_LAG = TransducerLag(
    name="transducer_lag",
    parameters=(
        EffectParameter(
            "tau", r"t_\mathrm{f}", "s", low=0.0, high=10.0, scale="sampling_time", first_trial=0.5,
            range_source="transducers answer in 0.001 to 0.1 s, and filters behind them average "
            "over seconds at most",
        ),
    ),
    equation=r"t_\mathrm{f}\,\frac{d\sigma_\mathrm{rec}}{dt} + \sigma_\mathrm{rec} = \sigma",
    source="Doebelin 2004, Measurement Systems, ch. 3: instruments of first order; transducers of "
    "rheometers: Macosko 1994, Rheology, ch. 8",
    check="Look up the filter of the transducer; strike it and record the response.",
    visible="t_f of about 5 % of the time in which the stress changes, 0.05/omega in oscillation.",
)  # fmt: skip
