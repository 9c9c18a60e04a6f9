"""Programs of one structure of law and effects: rates and signal, and code that follows modes."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover.effects import AbstractEffect, KinematicEffect, RadialAverage, Record, SignalEffect
from discover.forward.augmented_fluid import AugmentedFluid, where_in_shear
from discover.forward.declared import Numbers, Structure
from discover.forward.flows import (
    Flows,
    PeriodicFlows,
    SteadyFlows,
    StressFlows,
    TransientFlows,
)
from discover.forward.periodic_states import PHASE, first_harmonic
from discover.forward.side_by_side import (
    Kernel,
    PeriodicCode,
    PeriodicSideBySide,
    SideBySide,
    SteadyCode,
    SteadySideBySide,
    StressCode,
    StressSideBySide,
    code_of,
)
from discover.protocols.kinematics import Kinematics


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
        choices = {}
        if isinstance(part, TransientFlows):
            choices = {"cycles": part.cycle_steps > 0}
        kind = (
            type(part),
            jax.tree.structure(arrays),
            shapes,
            *jax.tree.leaves(rest),
            flow is None,
            *choices.values(),
        )
        if kind not in self._kernels:
            self._kernels[kind] = self._in_lanes(numbers, type(part), flow, choices)
        return self._kernels[kind]

    def _in_lanes(
        self, numbers: Numbers, control: type, flow: Kinematics | None, choices: dict[str, bool]
    ):
        given = self.fluid, numbers, flow
        if control is SteadyFlows:
            own = self._steady_rates, self._recorded_steady
            return SteadySideBySide(self.fluid, code_of(SteadyCode, *given), *own)
        if control is PeriodicFlows:
            code = code_of(PeriodicCode, *given)
            own = self._periodic_rates, self._given_way, self._moduli_recorded
            in_cycles = partial(code_of, Kernel, *given, cycles=True)
            return PeriodicSideBySide(self.fluid, code, in_cycles, *own)
        if control is StressFlows:
            code = code_of(StressCode, *given)
            return StressSideBySide(self.fluid, code, self._driven_with_series)
        kernel = code_of(Kernel, *given, **choices)
        return SideBySide(self.fluid, kernel, self._rates, self._distorted)

    def _rates(self, theta, present, run):
        """Return the felt rate at half steps and the tool's at steps, by the effects present.

        Here and in `_distorted` one vector and run, or in arrays of NumPy many: vectors and runs
        are then the first axes of all that follows time, and the last of vectors.
        """
        instrument_times = run.times / run.clock_factor
        # what lies upstream of the tool first. A series element changes no rate here: slip and
        # compliance stand between the driven tool and the fluid, and the tool moves on as
        # commanded. So it does with a wrong gap: the angle is right, and the nominal rate of the
        # tool is the angle's over the nominal gap
        flow = run.kinematics
        rate = run.commanded_rate
        if run.steps is not None:
            rate = run.steps.in_rate(rate, run.times, theta[self.fluid.instants])

        def shaped(rate, effects):
            for effect in effects:

                def felt(rate, effect=effect):
                    values = self.fluid.values(theta, effect)
                    changed = effect.felt_rate(values, instrument_times, rate)
                    return where_in_shear(flow, changed, rate)

                rate = self._if_present(theta, present, effect, felt, rate)
            return rate

        upstream = shaped(rate, self._upstream)
        return shaped(upstream, self._downstream), upstream[..., ::2]

    def _if_present(self, theta, present, effect: AbstractEffect, change: Callable, value):
        """Return what an effect makes of a value, which stays as it is without the effect."""
        amplitude = theta[self.fluid.slices[effect.name].start]
        is_present = present[self._number[effect.name]]
        if isinstance(theta, np.ndarray):
            return np.where(amplitude != 0.0, change(value), value) if is_present else value
        return jax.lax.cond(
            is_present,
            lambda value: jnp.where(amplitude != 0.0, change(value), value),
            lambda value: value,
            value,
        )

    def _distorted(self, theta, present, run, stress, felt, tool_rate):
        """Return the recorded stress at all steps, of that before the signal."""
        times = run.times[..., ::2]
        for effect in self._signal:

            def distorted(stress, effect=effect):
                strain = run.strain_before
                record = Record(times, felt, stress, run.clock_factor, strain, tool_rate)
                return self._as_recorded(theta, effect, record, run.kinematics)

            stress = self._if_present(theta, present, effect, distorted, stress)
        return stress

    def _steady_rates(self, theta, present, run: SteadyFlows):
        """Return the rates of a flow curve that the fluid feels where nothing slips."""
        places, rate = jnp.arange(run.rate.shape[0], dtype=run.rate.dtype), run.rate
        for effect in (*self._upstream, *self._downstream):
            if effect.acts_on_steady_states:

                def felt(rate, effect=effect):
                    changed = effect.felt_rate(self.fluid.values(theta, effect), places, rate)
                    return where_in_shear(run.kinematics, changed, rate)

                rate = self._if_present(theta, present, effect, felt, rate)
        return rate

    def _recorded_steady(self, theta, present, run: SteadyFlows, stress, felt):
        """Return the recorded stress of a flow curve, of that before the signal."""
        places = jnp.arange(run.rate.shape[0], dtype=run.rate.dtype)
        rate = self._steady_rates(theta, present, run)
        for effect in self._signal:
            if effect.acts_on_steady_states:

                def distorted(stress, effect=effect):
                    record = Record(places, felt, stress, jnp.ones(()), 0.0, rate)
                    return self._as_recorded(theta, effect, record, run.kinematics)

                stress = self._if_present(theta, present, effect, distorted, stress)
        return stress

    def _periodic_rates(self, theta, present, states: PeriodicFlows):
        """Return the amplitudes of the rate that the fluid feels where nothing gives way."""
        places = jnp.arange(len(states.strain), dtype=states.strain.dtype)
        rates = states.frequency * states.strain
        for effect in (*self._upstream, *self._downstream):
            if effect.acts_on_steady_states:

                def felt(rates, effect=effect):
                    return effect.felt_rate(self.fluid.values(theta, effect), places, rates)

                rates = self._if_present(theta, present, effect, felt, rates)
        return rates

    def _recorded_modulus(self, theta, present, found, rate, nominal, frequency):
        """Return G′ and G″ as they are recorded, of those of the fluid at a rate that it feels."""
        found = found * rate / nominal
        for effect in self._of_torque:

            def distorted(found, effect=effect):
                return self._modulus_as_recorded(theta, effect, found, nominal, frequency)

            found = self._if_present(theta, present, effect, distorted, found)
        return jnp.stack([found.real, found.imag])

    def _whole(self, numbers, theta, strain, frequency, of_modes):
        """Return the modulus in Pa of all that is felt, and how far the tool turns over that."""
        rate = strain * frequency * jnp.cos(PHASE)
        beside = self.fluid.beside(numbers, theta, rate, None)
        whole = of_modes + first_harmonic(beside, PHASE) / strain
        series = self.fluid.in_series(theta, None)
        if series is None:
            return whole, jnp.ones((), dtype=complex)
        return whole, 1.0 + (series.compliance + series.slip / (1j * frequency)) * whole

    def _given_way(self, numbers, theta, states: PeriodicFlows, strain, of_modes):
        """Return by how much the tool turns further than the fluid, in each of some states."""

        def one(*of):
            return self._whole(numbers, theta, *of)[1]

        return jax.vmap(one)(strain, states.frequency, of_modes)

    def _moduli_recorded(self, numbers, theta, present, states: PeriodicFlows, strain, of_modes):
        """Return both moduli of states as they are recorded, of those of the modes."""
        rates = self._periodic_rates(theta, present, states)
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
        phase, strain = PHASE, nominal / frequency
        stress = strain * (found.real * jnp.sin(phase) + found.imag * jnp.cos(phase))
        # at the ends of the stroke the tool is at rest, whatever the rounding
        rate = nominal * jnp.where(jnp.abs(jnp.cos(phase)) < 1e-9, 0.0, jnp.cos(phase))
        there, back = (
            effect.recorded_stress(
                values, Record(phase / frequency, sign * rate, sign * stress, jnp.ones(()))
            )
            for sign in (1.0, -1.0)
        )
        return first_harmonic(0.5 * (there - back), phase) / strain

    def _driven(self, theta, run: StressFlows):
        """Return the true stress of a run at a given one in Pa, and the tool's inertia in Pa s²."""
        flow, imposed, inertia = run.kinematics, run.imposed, jnp.zeros(())
        still = jnp.zeros_like(imposed)
        for effect in reversed(self._of_torque):
            values = self.fluid.values(theta, effect)
            inertia = inertia + effect.inertia(values) * run.clock_factor**2
            if effect.acts_on_steady_states:
                # the true stress of a recorded one: these effects are linear in it
                nothing, unit = (
                    effect.recorded_stress(
                        values, Record(run.times, still, still + size, run.clock_factor)
                    )
                    for size in (0.0, 1.0)
                )
                imposed = (imposed - nothing) / (unit - nothing)
        inertia = where_in_shear(flow, inertia, jnp.zeros(()))
        return where_in_shear(flow, imposed, run.imposed), inertia

    def _driven_with_series(self, theta, run: StressFlows):
        """Return these, and the strain at step ends of what gives way in series."""
        imposed, inertia = self._driven(theta, run)
        series = self.fluid.in_series(theta, run.kinematics)
        strain = jnp.zeros_like(imposed)
        if series is not None:
            strain = series.strain(run.times, imposed)
        return imposed, inertia, strain

    def _as_recorded(self, theta, effect: SignalEffect, record: Record, flow: Kinematics | None):
        """Return the stress after an effect on the signal of torque or force, where it is that."""
        changed = effect.recorded_stress(self.fluid.values(theta, effect), record)
        if flow is None:
            return record.stress if effect.of_force else changed
        return jnp.where(flow.records_torque != effect.of_force, changed, record.stress)


program_of = lru_cache(maxsize=16)(Program)
