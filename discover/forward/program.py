"""What is compiled of a model: predictions for one structure of law and effects."""

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np

from discover.effects import (
    ConstitutiveEffect,
    KinematicEffect,
    ModeDependence,
    ModeEffect,
    Record,
    SeriesElement,
    SignalEffect,
    StateEffect,
)
from discover.forward.added_terms import AddedTerms, InUse
from discover.forward.batches import (
    Flows,
    PeriodicFlows,
    Records,
    SteadyFlows,
    StressFlows,
    TransientFlows,
)
from discover.forward.by_mode import DEGREE, constants_of_modes, decades
from discover.forward.dynamics import Dynamics, Modes, Series, declared_weights
from discover.forward.integrators.imposed_stress import answer_to_stress
from discover.forward.integrators.with_effects import RUNS, Judged, integrate
from discover.forward.starts.half_cycles import first_harmonic
from discover.forward.starts.periodic_start import Cycle
from discover.forward.starts.periodic_states import PHASE, complex_modulus
from discover.forward.starts.steady_states import steady_states
from discover.forward.structure import Numbers, Structure
from discover.laws import LAWS, AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, of_each_mode, over_modes, with_modes
from discover.programs import compiled
from discover.protocols.kinematics import Kinematics
from tensor_library.kinematics import rate_of_deformation

# Modes up to which the steps at a given rate are one piece of machine code; see `contracted`. With
# eight runs and all candidates a prediction takes 2.0 ms so and 6.3 otherwise for 3 modes, 4.8 and
# 7.5 for 6, 10 and 7.8 for 9: arithmetic on many numbers is faster in pieces of its own
_FEW_MODES = 6

# Modes from which on weights of steps are worth a program of their own
_MANY_MODES = 4


class Program:
    """Predictions and residuals for one structure, compiled when first called."""

    def __init__(self, structure: Structure):
        self.structure = structure
        effects = structure.effects
        self.slices: dict[str, slice] = {}
        # first the logarithms of the factors on moduli and times, then the law's free parameters
        position = max(
            [2 + len(structure.free_parameters), *(end for *_, end in structure.by_mode)]
        )
        for effect in effects:
            self.slices[effect.name] = slice(position, position + len(effect.parameters))
            position += len(effect.parameters)
        self.instants = slice(position, position + structure.step_instants)
        self.size = self.instants.stop
        self._constitutive = [e for e in effects if isinstance(e, ConstitutiveEffect)]
        # of the law's constants, and of effects' amplitudes
        slots = {name: slice(start, end) for name, start, end in structure.by_mode}
        free = structure.free_parameters
        self._varying_law = {name: at for name, at in slots.items() if name in free}
        self._varying_effects = {
            e: slots[e.name] for e in self._constitutive if e.name in slots and e.name not in free
        }
        of_effects = {e.name: at for e, at in self._varying_effects.items()}
        self.added = AddedTerms(self._constitutive, self.slices, of_effects)
        self._by_mode = next((e for e in effects if isinstance(e, ModeDependence)), None)
        self._modes = [e for e in effects if isinstance(e, ModeEffect)]
        self._states = [e for e in effects if isinstance(e, StateEffect)]
        kinematic = [e for e in effects if isinstance(e, KinematicEffect)]
        self._upstream = [e for e in kinematic if e.shapes_command]
        self._downstream = [e for e in kinematic if not e.shapes_command]
        self._series = [e for e in kinematic if isinstance(e, SeriesElement)]
        self._signal = [e for e in effects if isinstance(e, SignalEffect)]
        # a name does not tell one law from another that was registered under it in its place
        build = LAWS[structure.law_name].build if structure.free_parameters else None
        self.predict = compiled(self._predict_all, made_from=(structure, build))
        self.met: set[tuple] = set()
        """Shapes of runs for which it is compiled."""

    def in_use(self, theta: np.ndarray) -> InUse:
        """Return the branches that a parameter vector takes."""
        states = [i for i, e in enumerate(self._states) if theta[self.slices[e.name].start] != 0.0]
        several = len(self._states) + 1
        used = self.added.in_use(theta)._replace(
            states=np.int32(0 if not states else states[0] + 1 if len(states) == 1 else several),
            times=np.int32(any(self._states[i].changes_times for i in states)),
        )
        if self._by_mode is None:
            return used
        differ = theta[self.slices[self._by_mode.name].start] != 0.0
        return used._replace(by_mode=np.int32(differ))

    def _values(self, theta, effect):
        return theta[self.slices[effect.name]]

    def weights(self, numbers: Numbers, theta: np.ndarray, runs: Flows):
        """Return the weights of all steps that trials of the same times share; None of few modes.

        None too where the law's own constants decide how a mode relaxes.
        """
        if not isinstance(runs, TransientFlows) or len(numbers.modulus) < _MANY_MODES:
            return None
        if numbers.law.retracts:
            return None
        times = np.asarray(numbers.relaxation_time) * np.exp(theta[1])
        return declared_weights(
            runs.times, times, jnp.asarray(float(numbers.law.linear_relaxation))
        )

    def is_judged_by_modes(self, theta: np.ndarray) -> bool:
        """Return whether nothing alters the record after the modes, or gives way in series."""
        after = (*self._signal, *self._series)
        return not any(theta[self.slices[effect.name].start] for effect in after)

    def _predict_all(
        self, numbers, used, theta, runs: Flows, records: Records | None, weights, limit
    ):
        if isinstance(runs, PeriodicFlows):
            return self._predict_moduli(numbers, used, theta, runs)
        if isinstance(runs, TransientFlows):
            # of all runs, so that a step that is padding in each of them is not taken
            steps = jnp.max(runs.last_step)
            assert records is not None  # of transients alone
            of_run = jax.vmap(
                self._predict_transient,
                in_axes=(None, None, None, 0, 0, None, 0, None),
                axis_name=RUNS,
            )
            return of_run(numbers, used, theta, runs, records, steps, weights, limit)
        return jax.vmap(self._predict_run, in_axes=(None, None, None, 0))(
            numbers, used, theta, runs
        )

    def _predict_run(self, numbers, used, theta, run: SteadyFlows | StressFlows):
        if isinstance(run, SteadyFlows):
            return self._predict_steady_states(numbers, used, theta, run)
        return self._predict_strain(numbers, used, theta, run)

    def _predict_transient(
        self,
        numbers,
        used,
        theta,
        run: TransientFlows,
        judging: Records,
        steps,
        weights,
        limit,
    ):
        instrument_times = run.times / run.clock_factor
        # what lies upstream of the tool first. A series element changes no rate here: slip and
        # compliance stand between the driven tool and the fluid, and the tool moves on as
        # commanded. So it does with a wrong gap: the angle is right, and the nominal rate of the
        # tool is the angle's over the nominal gap
        flow = run.kinematics
        rate = run.commanded_rate
        if run.steps is not None:
            rate = run.steps.in_rate(rate, run.times, theta[self.instants])
        for effect in self._upstream:
            changed = effect.felt_rate(self._values(theta, effect), instrument_times, rate)
            rate = _where_in_shear(flow, changed, rate)
        tool_rate = rate[::2]
        for effect in self._downstream:
            changed = effect.felt_rate(self._values(theta, effect), instrument_times, rate)
            rate = _where_in_shear(flow, changed, rate)
        times = run.times[::2]
        dynamics = self._dynamics(
            numbers, used, theta, flow, in_one_piece=len(numbers.modulus) <= _FEW_MODES
        )
        cycle = None
        if run.cycle_steps:
            cycle = Cycle(run.cycle[0], run.cycle[1], run.cycle_steps)
        # as it is where `is_judged_by_modes`, which is where there is a limit
        beside = self._beside(numbers, theta, rate[::2], flow)
        nothing = jnp.zeros_like(times)
        weight = nothing.at[run.sample_index].add(judging.weight)
        recorded = nothing.at[run.sample_index].add(judging.recorded)
        judged = Judged(weight, recorded, beside, limit)
        stress, felt = integrate(dynamics, times, rate, steps, judged, flow, cycle, weights)
        stress = stress + self._beside(numbers, theta, felt, flow)
        for effect in self._signal:
            record = Record(times, felt, stress, run.clock_factor, run.strain_before, tool_rate)
            stress = self._as_recorded(theta, effect, record, flow)
        return stress[run.sample_index]

    def _predict_steady_states(self, numbers, used, theta, run: SteadyFlows):
        flow = run.kinematics
        places = jnp.arange(run.rate.shape[0], dtype=run.rate.dtype)
        rate = run.rate
        for effect in (*self._upstream, *self._downstream):
            if effect.acts_on_steady_states:
                changed = effect.felt_rate(self._values(theta, effect), places, rate)
                rate = _where_in_shear(flow, changed, rate)
        dynamics = self._dynamics(numbers, used, theta, flow)
        kept = {e: values for e, values in dynamics.states.items() if e.acts_on_steady_states}
        dynamics = dynamics._replace(states=kept, states_in_use=None)
        stress, felt = steady_states(dynamics, rate, flow)
        stress = stress + self._beside(numbers, theta, felt, flow)
        for effect in self._signal:
            if effect.acts_on_steady_states:
                record = Record(places, felt, stress, jnp.ones(()), 0.0, rate)
                stress = self._as_recorded(theta, effect, record, flow)
        return stress

    def _predict_moduli(self, numbers, used, theta, states: PeriodicFlows):
        places = jnp.arange(len(states.strain), dtype=states.strain.dtype)
        commanded = states.frequency * states.strain
        rates = commanded
        for effect in (*self._upstream, *self._downstream):
            if effect.acts_on_steady_states:
                rates = effect.felt_rate(self._values(theta, effect), places, rates)
        dynamics = self._dynamics(numbers, used, theta, None)
        kept = {e: values for e, values in dynamics.states.items() if e.acts_on_steady_states}
        dynamics = dynamics._replace(states=kept, states_in_use=None)

        def beside(felt):
            return self._beside(numbers, theta, felt, None)

        def one(state):
            rate, nominal, frequency, steps = state
            found = complex_modulus(dynamics, rate / frequency, frequency, steps, beside)
            found = found * rate / nominal
            for effect in self._signal:
                found = self._modulus_as_recorded(theta, effect, found, nominal, frequency)
            return jnp.stack([found.real, found.imag])

        # not side by side: each in as many cycles, and as many steps of each, as it needs, which
        # takes a quarter of the time of all in those of the largest
        return jax.lax.map(one, (rates, commanded, states.frequency, states.steps))

    def _modulus_as_recorded(self, theta, effect, found, nominal, frequency):
        """Return G′ + iG″ in Pa after an effect of the torque's signal.

        What acts sample by sample acts on the wave of the first harmonic. An oscillation takes the
        inertia of the tool, and what answers late, each frequency by itself.
        """
        values = self._values(theta, effect)
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

    def _predict_strain(self, numbers, used, theta, run: StressFlows):
        flow = run.kinematics
        dynamics = self._dynamics(numbers, used, theta, flow)
        imposed, inertia = run.imposed, jnp.zeros(())
        still = jnp.zeros_like(imposed)
        for effect in reversed(self._signal):
            values = self._values(theta, effect)
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
        inertia = _where_in_shear(flow, inertia, jnp.zeros(()))
        imposed = _where_in_shear(flow, imposed, run.imposed)
        answer = answer_to_stress(dynamics, run.times, imposed, inertia, flow)
        return answer.strain[run.sample_index]

    def _as_recorded(self, theta, effect: SignalEffect, record: Record, flow: Kinematics | None):
        """Return the stress after an effect of the torque's signal, where that is recorded."""
        changed = effect.recorded_stress(self._values(theta, effect), record)
        return changed if flow is None else jnp.where(flow.records_torque, changed, record.stress)

    def _beside(self, numbers, theta, rate, flow: Kinematics | None):
        """Return the recorded stress of the solvent and of what effects add beside the modes.

        What an effect says of shear holds for any flow of the same intensity: the stress is that of
        a generalised Newtonian fluid   [Bird, Armstrong & Hassager 1987, vol. 1, chapter 4].
        """
        intensity, viscous = (1.0, 1.0) if flow is None else (flow.intensity, flow.viscous)
        total = numbers.solvent_viscosity * viscous * rate
        for effect in self._constitutive:
            shear = effect.instantaneous_stress(self._values(theta, effect), intensity * rate)
            total = total + viscous / intensity * shear
        return total

    def _varied(self, theta, mean, ends: tuple[float, float], at: slice, places):
        """Return a constant of each mode; one that an effect adds deviates from no polynomial."""
        coefficients, deviations = jnp.split(theta[at], [DEGREE])
        deviations = jnp.append(deviations, jnp.zeros(len(places) - len(deviations)))
        low, high = ends
        mean = jnp.asarray(mean)
        return constants_of_modes(mean, low, high, coefficients, deviations, places)

    def _law(self, theta, numbers, places):
        """Return the law with the values of its free parameters, which may differ by mode.

        Of constants by mode, a mode that an effect adds has the one of its own time.
        """
        free = self.structure.free_parameters
        if not free:
            return numbers.law
        named = LAWS[self.structure.law_name]
        known = dict(self.structure.parameters) | dict(
            zip(free, theta[2 : 2 + len(free)], strict=True)
        )
        if not self._varying_law:
            return named.build(*known.values())
        for name, at in self._varying_law.items():
            known[name] = self._varied(theta, known[name], named.parameters[name], at, places)
        columns = [jnp.broadcast_to(value, places.shape) for value in known.values()]
        built = jax.vmap(named.build)(*columns)
        return LawOfEachMode(law=built, linear_relaxation=built.linear_relaxation)

    def _terms_by_mode(self, law, added, theta, modes: Modes):
        """Return the function by how much h of each mode differs from that of equal constants."""
        by_mode = self._by_mode
        assert by_mode is not None
        factors = by_mode.factors(self._values(theta, by_mode), *modes)

        def of_mode(law, stress, gradient):
            return law.extra_term(stress, rate_of_deformation(gradient))

        of_law = over_modes(of_mode, law, -1)

        def differing(stress, gradient):
            # a mode that an effect adds stands after the declared ones, and is as they are in mean
            declared = jnp.ones(stress.shape[-1]).at[: len(factors)].set(factors)
            extra = of_law(stress, gradient) + added(stress, gradient)
            return (declared - 1.0) * extra.at[4:].set(0.0)

        return differing

    def _dynamics(
        self, numbers, used, theta, flow: Kinematics | None, in_one_piece: bool = True
    ) -> Dynamics:
        extra = None
        if self._modes:
            pairs = [effect.mode(self._values(theta, effect)) for effect in self._modes]
            extra = Modes(*(jnp.stack(column) for column in zip(*pairs, strict=True)))
        places = None
        if self._varying_law or self._varying_effects:
            places = decades(numbers.modulus, numbers.relaxation_time)
            if extra is not None:
                own = self.structure.added_modes > 0
                times = numbers.relaxation_time * (jnp.exp(theta[1]) if own else 1.0)
                added_at = decades(numbers.modulus, times, extra.relaxation_time, beyond=own)
                places = jnp.append(places, added_at)
        law = self._law(theta, numbers, places)
        if extra is not None and not self._varying_law:
            every = jnp.append(numbers.relaxation_time, extra.relaxation_time)
            law = with_modes(law, numbers.relaxation_time, every)
        modulus, relaxation_time = numbers.modulus, numbers.relaxation_time
        # a factor that is not fitted stays a constant: no trial and no derivative passes through
        if self.structure.fit_modulus:
            modulus = modulus * jnp.exp(theta[0])
        # that on the times is tried where it is not fitted too
        relaxation_time = relaxation_time * jnp.exp(theta[1])
        of_law = over_modes(lambda law, *flow: law.stress_rate(*flow), law, -1)
        amplitudes = {
            e.name: self._varied(
                theta,
                self._values(theta, e)[0],
                (float(e.parameters[0].low), float(e.parameters[0].high)),
                at,
                places,
            )
            for e, at in self._varying_effects.items()
        }
        added = self.added.rate(theta, used, amplitudes, in_one_piece)

        def modes_rate(stress, gradient):
            same = of_law(stress, gradient) - added(stress, gradient)
            if self._by_mode is None:
                return same
            differing = self._terms_by_mode(law, added, theta, Modes(modulus, relaxation_time))
            return same - jax.lax.switch(
                used.by_mode, [lambda s, _: jnp.zeros_like(s), differing], stress, gradient
            )

        series = None
        if self._series:
            pairs = [e.slip_and_compliance(self._values(theta, e)) for e in self._series]
            both = jnp.stack([jnp.asarray(sum(column)) for column in zip(*pairs, strict=True)])
            slip, compliance = _where_in_shear(flow, both, jnp.zeros(2))
            series = Series(slip, compliance, self._slip_by_stress(theta, flow))
        return Dynamics(
            modes_rate,
            law.linear_relaxation,
            Modes(modulus, relaxation_time),
            extra,
            {effect: self._values(theta, effect) for effect in self._states},
            series,
            self._beside(numbers, theta, jnp.ones(1), flow)[0],
            self._of_modes_at_rest("relaxations", law, modulus, extra) if law.retracts else None,
            used.times,
            used.states,
            law.variables,
            self._of_modes_at_rest("shares", law, modulus, extra) if law.tensors else None,
            in_one_piece,
        )

    def _slip_by_stress(self, theta, flow: Kinematics | None):
        """Return what slip depends on the stress, as a function of it; None where nothing does."""
        elements = [e for e in self._series if e.slips_by_stress]
        if not elements:
            return None

        def slip(stress):
            found = jnp.zeros(())
            for element in elements:
                found = found + element.slip_at(self._values(theta, element), stress)
            return _where_in_shear(flow, found, jnp.zeros(()))

        return slip

    def _of_modes_at_rest(
        self, name: str, law: AbstractConstitutiveLaw, modulus, extra: Modes | None
    ):
        """Return what decides how modes are stepped through; no gradient passes through that."""
        count = len(modulus) + (0 if extra is None else len(extra.modulus))
        values = of_each_mode(lambda law: getattr(law, name)(), law, count)
        return jax.lax.stop_gradient(jnp.moveaxis(values, 0, -1))


def _where_in_shear(flow: Kinematics | None, changed, unchanged):
    """Return what a rotational rheometer's drive changes: runs in shear alone.

    An extension is made on another instrument, with flaws of its own. What distorts the signal of
    the torque changes neither that nor the normal force.
    """
    return changed if flow is None else jnp.where(flow.is_shear, changed, unchanged)


program_of = lru_cache(maxsize=16)(Program)
