"""Programs of one structure of law and effects: rates and signal, and code that follows modes."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from discover.effects import KinematicEffect, RadialAverage, Record, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid
from discover.forward.declared import Numbers, Structure
from discover.forward.flows import (
    Flows,
    PeriodicFlows,
    SteadyFlows,
    StressFlows,
    TransientFlows,
)
from discover.forward.side_by_side import (
    Kernel,
    PeriodicSideBySide,
    SideBySide,
    SteadyCode,
    SteadySideBySide,
    StressCode,
    StressSideBySide,
    code_of,
)
from discover.programs import compiled
from discover.protocols.kinematics import Kinematics

# ωt at which what needs no steps is looked at: a stress beside the modes, a signal
_PHASE = np.linspace(0.0, np.pi, 161)


def _first_harmonic(
    stress: Float[Array, " s"], phase: Float[Array | np.ndarray, " s"]
) -> Complex[Array, ""]:
    """Return G′γ₀ + iG″γ₀ of a stress G′γ₀ sin ωt + G″γ₀ cos ωt + higher odd harmonics.

    G′ = (2/Tγ₀) ∫ σ sin ωt dt and G″ = (2/Tγ₀) ∫ σ cos ωt dt   [Hyun et al. 2011, Prog. Polym. Sci.
    36, 1697]. `stress` in Pa over half a cycle, its ends included. `phase`: ωt there, 0 to π,
    evenly spaced.
    """
    # of a periodic function the trapezoidal rule over a period is exact to all orders
    share = jnp.ones(stress.shape).at[jnp.array([0, -1])].set(0.5) / (len(stress) - 1)
    return 2j * jnp.sum(share * jnp.exp(-1j * phase) * stress)


class Program:
    """What records of one structure of law and effects are predicted with, made when asked for."""

    def __init__(self, structure: Structure):
        self.fluid = AugmentedFluid(structure)
        self._number = {effect.name: i for i, effect in enumerate(structure.effects)}
        still = KinematicEffect.felt_rate
        kinematic = [
            e
            for e in structure.effects
            if isinstance(e, KinematicEffect) and type(e).felt_rate is not still
        ]
        self._upstream = [e for e in kinematic if e.shapes_command]
        self._downstream = [e for e in kinematic if not e.shapes_command]
        signal = (e for e in structure.effects if isinstance(e, SignalEffect))
        self._signal = sorted(signal, key=lambda effect: effect.is_zero)
        self.averages = [e for e in structure.effects if isinstance(e, RadialAverage)]
        self._of_torque = [effect for effect in self._signal if not effect.of_force]
        self.of_force = [e for e in self._signal if e.of_force and e.acts_on_steady_states]
        self._kernels: dict[Any, Any] = {}

    def side_by_side(self, numbers: Numbers, part: Flows) -> Any:
        """Return what predicts many vectors of runs of one control at once."""
        flow = None
        if not isinstance(part, PeriodicFlows):
            flow = jax.tree.map(lambda leaf: np.asarray(leaf)[0], part.kinematics)
        arrays, rest = eqx.partition(numbers.law, eqx.is_array)
        shapes = tuple(leaf.shape for leaf in jax.tree.leaves(arrays))
        kind = (
            type(part),
            jax.tree.structure(arrays),
            shapes,
            *jax.tree.leaves(rest),
            flow is None,
        )
        if kind not in self._kernels:
            self._kernels[kind] = self._in_lanes(numbers, type(part), flow)
        return self._kernels[kind]

    def _in_lanes(self, numbers: Numbers, control: type, flow: Kinematics | None):
        given = self.fluid, numbers, flow
        if control is SteadyFlows:
            own = self._steady_rates, self._recorded_steady
            return SteadySideBySide(self.fluid, code_of(SteadyCode, *given), *own)
        if control is PeriodicFlows:
            code = code_of(Kernel, *given)
            own = self._steady_rates, self._given_way, self._moduli_recorded
            return PeriodicSideBySide(self.fluid, code, *own)
        if control is StressFlows:
            code = code_of(StressCode, *given)
            return StressSideBySide(self.fluid, code, self._driven)
        kernel = code_of(Kernel, *given)
        return SideBySide(self.fluid, kernel, self._rates, self._distorted)

    # Rates and records of many vectors and runs, in arrays of NumPy with axes of these and of time;
    # of `theta` parameters come first, and behind its vectors there are two axes of one

    def _rates(self, theta, present, run: TransientFlows):
        """Return the felt rate at half steps and the tool's at steps, by the effects present."""
        times, rate = run.times / run.clock_factor[:, None], run.commanded_rate
        if run.steps is not None:
            rate = run.steps.in_rate(rate, run.times, theta[self.fluid.instants])
        # what lies upstream of the tool first. A series element changes no rate here: slip and
        # compliance stand between the driven tool and the fluid, and the tool moves on as
        # commanded. So it does with a wrong gap: the angle is right, and the nominal rate of the
        # tool is the angle's over the nominal gap
        upstream = self._shaped(theta, present, run.kinematics, times, rate, self._upstream)
        felt = self._shaped(theta, present, run.kinematics, times, upstream, self._downstream)
        return felt, upstream[..., ::2]

    def _distorted(self, theta, present, run: TransientFlows, stress, felt, tool_rate):
        """Return the recorded stress at all steps, of that before the signal."""
        of_run = run.clock_factor[:, None], run.strain_before[:, None]
        record = Record(run.times[..., ::2], felt, stress, *of_run, tool_rate)
        return self._signalled(theta, present, run.kinematics, record, self._signal)

    def _steady_rates(self, theta, present, rate, flow: Kinematics | None):
        """Return the rates of flow curves, or of oscillations, felt where nothing slips."""
        effects = [e for e in (*self._upstream, *self._downstream) if e.acts_on_steady_states]
        places = np.arange(float(rate.shape[-1]))[None]
        return self._shaped(theta, present, flow, places, rate, effects)

    def _recorded_steady(self, theta, present, run: SteadyFlows, stress, felt):
        """Return the recorded stress of flow curves, of that before the signal."""
        rate = self._steady_rates(theta, present, run.rate, run.kinematics)
        places = np.arange(float(run.rate.shape[1]))[None]
        record = Record(places, felt, stress, np.ones((1, 1)), np.zeros((1, 1)), rate)
        effects = [effect for effect in self._signal if effect.acts_on_steady_states]
        return self._signalled(theta, present, run.kinematics, record, effects)

    def _shaped(self, theta, present, flow: Kinematics | None, times, rate, effects):
        in_shear = True if flow is None else flow.is_shear[:, None]
        for effect in effects:
            if present[self._number[effect.name]]:
                values = self.fluid.values(theta, effect)
                changed = _felt(effect, values, times, rate)
                rate = np.where((values[0] != 0.0) & in_shear, changed, rate)
        return rate

    def _signalled(self, theta, present, flow: Kinematics | None, record: Record, effects):
        torque = np.ones((1, 1), bool) if flow is None else flow.records_torque[:, None]
        for effect in effects:
            if present[self._number[effect.name]]:
                values = self.fluid.values(theta, effect)
                is_its = (values[0] != 0.0) & (torque != effect.of_force)
                changed = np.where(is_its, _recorded(effect, values, record), record.stress)
                record = replace(record, stress=changed)
        return record.stress

    def _recorded_modulus(self, theta, present, found, rate, nominal, frequency):
        """Return G′ and G″ as they are recorded, of those of the fluid at a rate that it feels."""
        found = found * rate / nominal
        for effect in self._of_torque:

            def distorted(found, effect=effect):
                changed = self._modulus_as_recorded(theta, effect, found, nominal, frequency)
                return jnp.where(self.fluid.values(theta, effect)[0] != 0.0, changed, found)

            is_present = present[self._number[effect.name]]
            found = jax.lax.cond(is_present, distorted, lambda found: found, found)
        return jnp.stack([found.real, found.imag])

    def _whole(self, numbers, theta, strain, frequency, of_modes):
        """Return the modulus in Pa of all that is felt, and how far the tool turns over that."""
        rate = strain * frequency * jnp.cos(_PHASE)
        beside = self.fluid.beside(numbers, theta, rate, None)
        whole = of_modes + _first_harmonic(beside, _PHASE) / strain
        series = self.fluid.in_series(theta)
        if series is None:
            return whole, jnp.ones((), dtype=complex)
        return whole, 1.0 + (series.compliance + series.slip / (1j * frequency)) * whole

    def _given_way(self, numbers, theta, states: PeriodicFlows, strain, of_modes):
        """Return by how much the tool turns further than the fluid, in each of some states."""

        def one(*of):
            return self._whole(numbers, theta, *of)[1]

        return jax.vmap(one)(strain, states.frequency, of_modes)

    def _moduli_recorded(
        self, numbers, theta, present, states: PeriodicFlows, strain, of_modes, rates
    ):
        """Return both moduli of states as they are recorded, of those of the modes."""
        commanded = states.frequency * states.strain

        def one(rate, nominal, frequency, strain, found):
            whole, taken = self._whole(numbers, theta, strain, frequency, found)
            return self._recorded_modulus(theta, present, whole / taken, rate, nominal, frequency)

        return jax.vmap(one)(rates, commanded, states.frequency, strain, of_modes)

    def _modulus_as_recorded(self, theta, effect, found, nominal, frequency):
        """Return G′ + iG″ in Pa after an effect of the torque's signal.

        What acts sample by sample acts on the wave of the first harmonic.
        """
        values = self.fluid.values(theta, effect)
        found = found * effect.response(values, frequency) - effect.inertia(values) * frequency**2
        if not effect.acts_on_steady_states:
            return found
        phase, strain = _PHASE, nominal / frequency
        stress = strain * (found.real * jnp.sin(phase) + found.imag * jnp.cos(phase))
        # at the ends of the stroke the tool is at rest, whatever the rounding
        rate = nominal * jnp.where(jnp.abs(jnp.cos(phase)) < 1e-9, 0.0, jnp.cos(phase))
        there, back = (
            effect.recorded_stress(
                values, Record(phase / frequency, sign * rate, sign * stress, jnp.ones(()))
            )
            for sign in (1.0, -1.0)
        )
        return _first_harmonic(0.5 * (there - back), phase) / strain

    def _driven(self, theta, present, run: StressFlows):
        """Return the true stress of runs at a given one in Pa, and the tool's inertia in Pa s².

        And the strain at step ends of what gives way in series.
        """
        imposed, clock, flow = run.imposed, run.clock_factor[:, None], run.kinematics
        still, none = np.zeros_like(imposed), np.zeros((1, 1))
        inertia = strain = none
        for effect in reversed(self._of_torque):
            if not present[self._number[effect.name]]:
                continue
            values = self.fluid.values(theta, effect)
            inertia = inertia + np.asarray(effect.inertia(values)) * clock**2
            if effect.acts_on_steady_states:
                # the true stress of a recorded one: these effects are linear in it
                nothing, unit = (
                    _recorded(effect, values, Record(run.times, still, still + size, clock, none))
                    for size in (0.0, 1.0)
                )
                imposed = (imposed - nothing) / (unit - nothing)
        series = self.fluid.in_series(theta)
        if series is not None:
            strain = series.strain(run.times, imposed)
        in_shear = True if flow is None else flow.is_shear[:, None]
        pairs = (imposed, run.imposed), (inertia, 0.0), (strain, 0.0)
        return [np.where(in_shear, changed, unchanged) for changed, unchanged in pairs]


def _felt(effect: KinematicEffect, values, times, rate):
    """Return `felt_rate` of many vectors and runs, one after another if it takes no NumPy."""
    if effect.takes_numpy:
        return effect.felt_rate(values, times, rate)
    each = _one_by_one(effect.felt_rate, "(p),(n),(n)->(n)")
    return np.asarray(each(np.moveaxis(values[..., 0], 0, -1), times, rate))


def _recorded(effect: SignalEffect, values, record: Record):
    """Return `recorded_stress` of many vectors and runs, likewise."""
    if effect.takes_numpy:
        return effect.recorded_stress(values, record)
    each = _one_by_one(effect.recorded_stress, "(p),(n),(n),(n),(1),(1),(n)->(n)")
    return np.asarray(each(np.moveaxis(values[..., 0], 0, -1), *vars(record).values()))


@lru_cache(maxsize=32)
def _one_by_one(function: Callable, signature: str) -> Callable:
    def one(values, *arrays):
        if len(arrays) == 2:
            return function(values, *arrays)
        times, rate, stress, clock_factor, strain_before, tool_rate = arrays
        of_run = clock_factor[0], strain_before[0]
        return function(values, Record(times, rate, stress, *of_run, tool_rate))

    return compiled(jnp.vectorize(one, signature=signature))


program_of = lru_cache(maxsize=16)(Program)
