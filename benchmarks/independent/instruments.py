"""A rheometer with faults: what it does to the flow, and what it does to the record.

Friction and inertia follow the rate of the tool; slip and compliance come between the tool and the
fluid, so that with them the fluid feels another rate than the tool has.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from independent.flow import Flow, oscillation, step_strain
from independent.material import Material, RateLaw, Stresses, differences, integrate

_STEP = 1e-6  # of a finite difference, relative


@dataclass(frozen=True)
class Recording:
    """One run as a rheometer hands it out.

    `time`, `rate`, `stress` in s, 1/s (commanded) and Pa, shape (n,).
    `true`: what the fluid did: stresses at the same times, without the faults of the record.
    `felt_rate`, `tool_rate`: rate of the fluid and of the tool, in 1/s.
    `N1`, `N2`: recorded normal stress differences in Pa, or None.
    `strain`: recorded strain, or None.
    """

    time: np.ndarray
    rate: np.ndarray
    stress: np.ndarray
    true: Stresses
    felt_rate: np.ndarray
    tool_rate: np.ndarray
    N1: np.ndarray | None = None
    N2: np.ndarray | None = None
    strain: np.ndarray | None = None


@dataclass(frozen=True)
class Instrument:
    """Faults of a rheometer; by default it has none.

    `slip`: s in 1/(Pa s): γ̇_felt = γ̇_tool − s σ [Yoshimura & Prud'homme 1988, J. Rheol. 32, 53].
    `slip_power`: γ̇_felt = γ̇_tool − s |σ|^(m−1) σ instead, with m this; slip then in 1/(Pa^m s)
        [Hatzikiriakos & Dealy 1991, J. Rheol. 35, 497].
    `compliance`: C in 1/Pa: γ_felt = γ_tool − C σ [Gottlieb & Macosko 1982, Rheol. Acta 21, 90].
    `rise_time`: τ in s: τ γ̇_tool' + γ̇_tool = γ̇_commanded, from rest.
    `inertia`: I in Pa s²: I dγ̇_tool/dt is recorded with the stress [Krieger 1990, J. Rheol. 34,
        471].
    `friction` in Pa: friction · sign(γ̇_tool) is recorded with the stress.
    `rate_gain`: γ̇_tool is 1 + this times the command.
    `gain`, `offset`, `drift`: of the stress: relative, Pa, Pa/s.
    `settling_time` in s: the drift dies out, so that drift · τ (1 − exp(−t/τ)) is recorded with the
        stress.
    `lag`, `delay`: of the stress, first-order and pure, in s.
    `resonance`, `damping`: ω in rad/s and ζ of a transducer of second order, y''/ω² + 2 ζ y'/ω + y
        = stress.
    `adc_step`: smallest step of the recorded stress, in Pa; 0: none.
    `limit`: largest stress that is recorded, in Pa, of either sign: a saturated transducer.
    `fastest`: largest rate that the motor reaches, in 1/s: a clipped range.
    `clock_slip`: recorded time is 1 + this times the true one.
    `dead`: the transducer records the offset alone.
    """

    slip: float = 0.0
    slip_power: float = 1.0
    compliance: float = 0.0
    rise_time: float = 0.0
    inertia: float = 0.0
    friction: float = 0.0
    rate_gain: float = 0.0
    gain: float = 0.0
    offset: float = 0.0
    drift: float = 0.0
    settling_time: float = np.inf
    lag: float = 0.0
    delay: float = 0.0
    resonance: float = np.inf
    damping: float = 0.3
    adc_step: float = 0.0
    limit: float = np.inf
    fastest: float = np.inf
    clock_slip: float = 0.0
    dead: bool = False

    def record(self, material: Material, flow: Flow, times: np.ndarray) -> Recording:
        """Return the record of a material in a commanded flow from rest.

        Raises ValueError if slip or compliance are asked for a material that is no rate law.
        """
        times = np.asarray(times, float)
        told = self._told(flow)
        # the filters of the record need the stress between the samples
        filtered = self.lag or self.delay or np.isfinite(self.resonance)
        dense = _filled(times) if filtered else times
        true, felt, tool, slope = self._run(material, told, dense)
        signal = (1 + self.gain) * true.sigma12 + self.inertia * slope
        signal = signal + self.friction * np.sign(tool) + self.offset + self._drifted(dense)
        signal = _lagged(dense, signal, self.lag)
        if np.isfinite(self.resonance):
            signal = _ringing(dense, signal, self.resonance, self.damping)
        if self.delay:
            signal = np.interp(dense - self.delay, dense, signal, left=0.0)
        if self.dead:
            signal = np.full_like(dense, self.offset)
        keep = np.searchsorted(dense, times)
        signal = np.clip(signal[keep], -self.limit, self.limit)
        if self.adc_step:
            signal = self.adc_step * np.round(signal / self.adc_step)
        kept = Stresses(true.sigma12[keep], true.N1[keep], true.N2[keep])
        return Recording(
            time=times * (1 + self.clock_slip), rate=np.asarray(flow.rate(times), float),
            stress=signal, true=kept, felt_rate=felt[keep], tool_rate=tool[keep], N1=kept.N1,
            N2=kept.N2,
        )  # fmt: skip

    def _told(self, flow: Flow) -> Flow:
        """Return the rate that the motor aims at; its strain where that is still in closed form."""
        gain = 1 + self.rate_gain
        if np.isfinite(self.fastest):
            # no strain: integral materials cannot be clipped here
            return Flow(
                lambda t: np.clip(gain * flow.rate(t), -self.fastest, self.fastest), None,
                flow.jumps,
            )  # fmt: skip
        return Flow(lambda t: gain * flow.rate(t), lambda t: gain * flow.strain(t), flow.jumps)

    def _drifted(self, times: np.ndarray) -> np.ndarray:
        """Return what a drift has added by the times, in Pa."""
        if np.isinf(self.settling_time):
            return self.drift * times
        return self.drift * self.settling_time * -np.expm1(-times / self.settling_time)

    def _run(self, material: Material, told: Flow, times: np.ndarray):
        """Return stresses, felt rate, tool rate and slope of the tool rate at the times."""
        rates = np.asarray(told.rate(times), float)
        series = self.slip or self.compliance
        if not (series or self.rise_time):
            return material.respond(told, times), rates, rates, _slope(told, times)
        if not isinstance(material, RateLaw):
            raise ValueError("Slip, compliance and rise time need a material that is a rate law.")
        law, rise = material, self.rise_time

        def tool_rate(t, state):
            return state[0] if rise else float(told.rate(t))

        def change(t, state):
            tool = tool_rate(t, state)
            felt = self._felt(law, state[1:], tool)
            grown = (float(told.rate(t)) - tool) / rise if rise else 0.0
            return np.append(grown, law.change(state[1:], felt))

        start = np.append(0.0, law.rest())
        scale = np.append(1.0, law.scale())
        states = integrate(change, start, times, told.jumps, scale)
        tool = states[:, 0] if rise else rates
        felt = np.array([self._felt(law, s[1:], r) for s, r in zip(states, tool, strict=True)])
        slope = (rates - tool) / rise if rise else _slope(told, times)
        tensors = [law.stress(s[1:], r) for s, r in zip(states, felt, strict=True)]
        return differences(tensors), felt, tool, slope

    def _felt(self, law: RateLaw, state: np.ndarray, tool: float) -> float:
        """Return γ̇_felt, which solves γ̇ + s |σ12|^(m−1) σ12 + C dσ12/dt = γ̇_tool at this state."""

        def missing(rate):
            stress = law.stress(state, rate)[0, 1]
            gone = self.slip * np.abs(stress) ** (self.slip_power - 1.0) * stress
            if self.compliance:
                gone += self.compliance * _stress_change(law, state, rate)
            return rate + gone - tool

        # secant steps; one is enough where the stress changes in proportion to the rate
        last, now = tool, tool - missing(tool)
        left, right = missing(last), missing(now)
        for _ in range(20):
            if right == left or abs(right) <= 1e-12 * max(abs(tool), 1e-12):
                break
            last, now = now, now - right * (now - last) / (right - left)
            left, right = right, missing(now)
        return now


def _stress_change(law: RateLaw, state: np.ndarray, rate: float) -> float:
    """Return dσ12/dt along the change of the state."""
    change = law.change(state, rate)
    step = _STEP / max(np.max(np.abs(change)) / law.modulus, 1e-12)
    ahead, behind = law.stress(state + step * change, rate), law.stress(state - step * change, rate)
    return float((ahead[0, 1] - behind[0, 1]) / (2 * step))


def _slope(flow: Flow, times: np.ndarray) -> np.ndarray:
    """Return dγ̇/dt; at a jump, that after it."""
    step = _STEP * max(float(times[-1]), _STEP)
    return (np.asarray(flow.rate(times + step)) - np.asarray(flow.rate(times))) / step


def _filled(times: np.ndarray) -> np.ndarray:
    """Return the times, 0, and 20 times between neighbours."""
    grid = np.unique(np.append(0.0, times))
    parts = [np.linspace(a, b, 20, endpoint=False) for a, b in pairwise(grid)]
    return np.append(np.concatenate(parts), grid[-1])


def _lagged(times: np.ndarray, signal: np.ndarray, lag: float) -> np.ndarray:
    """Return τ y' + y = signal from y = 0, exact for a signal that is linear between the times."""
    if lag == 0.0:
        return signal
    out = np.zeros_like(signal)
    for i in range(1, len(times)):
        step = times[i] - times[i - 1]
        slope = (signal[i] - signal[i - 1]) / step
        decay = np.exp(-step / lag)
        # particular solution: signal − τ slope
        out[i] = (out[i - 1] - signal[i - 1] + lag * slope) * decay + signal[i] - lag * slope
    return out


def _ringing(times: np.ndarray, signal: np.ndarray, frequency: float, damping: float):
    """Return y of y''/ω² + 2 ζ y'/ω + y = signal from rest; the signal is linear between times."""
    from scipy.integrate import solve_ivp

    def change(t, y):
        pull = frequency**2 * (np.interp(t, times, signal) - y[0])
        return [y[1], pull - 2 * damping * frequency * y[1]]

    size, step = max(float(np.max(np.abs(signal))), 1e-300), float(np.max(np.diff(times)))
    span, exact = (times[0], times[-1]), {"rtol": 1e-8, "atol": 1e-8 * size}
    return solve_ivp(change, span, [0.0, 0.0], t_eval=times, max_step=step, **exact).y[0]


_PERFECT = Instrument()


def relaxation_as_run(
    material: Material, strain: float, rise: float, times: np.ndarray
) -> Recording:
    """Return the relaxation after a step of strain, from its end on, with its measured strain.

    The step takes `rise` seconds, before the first sample; the file says nothing of it, so the run
    looks as if it began at rest with a rate of zero and a strain that is there already.
    """
    times = np.asarray(times, float)
    whole = _PERFECT.record(material, step_strain(strain, rise), times + rise)
    zero = np.zeros_like(times)
    return replace(
        whole, time=times, rate=zero, felt_rate=zero, tool_rate=zero, strain=zero + strain
    )


def alternation_as_from_rest(
    material: Material, amplitude: float, frequency: float, times: np.ndarray, cycles: int = 10
) -> Recording:
    """Return γ̇ = amplitude cos(ωt) in steady alternation, with its time counted from a crest."""
    times = np.asarray(times, float)
    late = times + cycles * 2 * np.pi / frequency
    whole = _PERFECT.record(material, oscillation(amplitude, frequency), late)
    return replace(whole, time=times)


def nothing(recording: Recording, level: float) -> Recording:
    """Return a record of the same times and rates without a fluid: a constant stress in Pa."""
    flat = np.full_like(recording.stress, level)
    zero = np.zeros_like(flat)
    return replace(recording, stress=flat, true=Stresses(zero, zero, zero), N1=None, N2=None)
