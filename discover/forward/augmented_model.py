"""One model that holds the declared law and every candidate effect, compiled once.

An effect at zero amplitude changes nothing, so a subset of effects is a vector of parameters with
zeros, never another program. Runs are padded to one grid and mapped over. Trial vectors are not: in
a call of its own, each leaves out the terms that it has at zero.
"""

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import (
    AbstractEffect,
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
from discover.forward.declared import DeclaredModel
from discover.forward.dynamics import Dynamics, Modes, Series
from discover.forward.imposed_stress import strain_at_stress
from discover.forward.integrator import integrate
from discover.forward.run_batch import (
    Batch,
    MixedBatch,
    Part,
    RunBatch,
    SteadyBatch,
    StressBatch,
)
from discover.forward.steady_states import steady_states
from discover.laws import LAWS, AbstractConstitutiveLaw
from discover.programs import compiled
from discover.protocols.kinematics import Kinematics
from tensor_library.kinematics import rate_of_deformation

# Of the upper end of its range, to which the first trial of a parameter is kept
_TRIAL_SHARE = 0.5

# Calls side by side: one uses a single core, whatever the number of runs
_WORKERS = min(os.cpu_count() or 1, 4)


class _Numbers(eqx.Module):
    """What of a declared model is data to the compiled program."""

    law: AbstractConstitutiveLaw
    modulus: Float[Array, " k"]
    relaxation_time: Float[Array, " k"]
    solvent_viscosity: Float[Array, ""]


class _Structure(NamedTuple):
    """What decides which program is compiled; models that share it share the program."""

    effects: tuple[AbstractEffect, ...]
    free_parameters: tuple[str, ...]
    law_name: str
    parameters: tuple[tuple[str, float], ...]
    fit_modulus: bool
    fit_relaxation_time: bool


class _Program:
    """Predictions and residuals for one structure, compiled when first called."""

    def __init__(self, structure: _Structure):
        self.structure = structure
        effects = structure.effects
        self.slices: dict[str, slice] = {}
        # first the logarithms of the factors on moduli and times, then the law's free parameters
        position = 2 + len(structure.free_parameters)
        for effect in effects:
            self.slices[effect.name] = slice(position, position + len(effect.parameters))
            position += len(effect.parameters)
        self.size = position
        self._constitutive = [e for e in effects if isinstance(e, ConstitutiveEffect)]
        self.added = AddedTerms(self._constitutive, self.slices)
        self._by_mode = next((e for e in effects if isinstance(e, ModeDependence)), None)
        self._modes = [e for e in effects if isinstance(e, ModeEffect)]
        self._states = [e for e in effects if isinstance(e, StateEffect)]
        kinematic = [e for e in effects if isinstance(e, KinematicEffect)]
        self._upstream = [e for e in kinematic if e.shapes_command]
        self._downstream = [e for e in kinematic if not e.shapes_command]
        self._series = [e for e in kinematic if isinstance(e, SeriesElement)]
        self._signal = [e for e in effects if isinstance(e, SignalEffect)]
        over_runs = jax.vmap(self._predict_run, in_axes=(None, None, None, 0))
        # a name does not tell one law from another that was registered under it in its place
        build = LAWS[structure.law_name].build if structure.free_parameters else None
        self.predict = compiled(over_runs, made_from=(structure, build))
        self.met: set[tuple] = set()
        """Shapes of runs for which it is compiled."""

    def in_use(self, theta: np.ndarray) -> InUse:
        """Return the branches that a parameter vector takes."""
        used = self.added.in_use(theta)
        if self._by_mode is None:
            return used
        differ = theta[self.slices[self._by_mode.name].start] != 0.0
        return used._replace(by_mode=np.int32(differ))

    def _values(self, theta, effect):
        return theta[self.slices[effect.name]]

    def _predict_run(self, numbers, used, theta, run: Part):
        if isinstance(run, SteadyBatch):
            return self._predict_steady_states(numbers, used, theta, run)
        if isinstance(run, StressBatch):
            return self._predict_strain(numbers, used, theta, run)
        return self._predict_transient(numbers, used, theta, run)

    def _predict_transient(self, numbers, used, theta, run: RunBatch):
        instrument_times = run.times / run.clock_factor
        # what lies upstream of the tool first. A series element changes no rate here: slip and
        # compliance stand between the driven tool and the fluid, and the tool moves on as
        # commanded. So it does with a wrong gap: the angle is right, and the nominal rate of the
        # tool is the angle's over the nominal gap
        flow = run.kinematics
        rate = run.commanded_rate
        for effect in self._upstream:
            changed = effect.felt_rate(self._values(theta, effect), instrument_times, rate)
            rate = _where_in_shear(flow, changed, rate)
        tool_rate = rate[::2]
        for effect in self._downstream:
            changed = effect.felt_rate(self._values(theta, effect), instrument_times, rate)
            rate = _where_in_shear(flow, changed, rate)
        times = run.times[::2]
        dynamics = self._dynamics(numbers, used, theta, flow)
        stress, felt = integrate(dynamics, times, rate, flow)
        stress = stress + self._beside(numbers, theta, felt, flow)
        for effect in self._signal:
            record = Record(times, felt, stress, run.clock_factor, run.strain_before, tool_rate)
            stress = self._as_recorded(theta, effect, record, flow)
        return stress[run.sample_index]

    def _predict_steady_states(self, numbers, used, theta, run: SteadyBatch):
        flow = run.kinematics
        places = jnp.arange(run.rate.shape[0], dtype=run.rate.dtype)
        rate = run.rate
        for effect in (*self._upstream, *self._downstream):
            if effect.acts_on_steady_states:
                changed = effect.felt_rate(self._values(theta, effect), places, rate)
                rate = _where_in_shear(flow, changed, rate)
        dynamics = self._dynamics(numbers, used, theta, flow)
        kept = {e: values for e, values in dynamics.states.items() if e.acts_on_steady_states}
        dynamics = dynamics._replace(states=kept)
        stress, felt = steady_states(dynamics, rate, flow)
        stress = stress + self._beside(numbers, theta, felt, flow)
        for effect in self._signal:
            if effect.acts_on_steady_states:
                record = Record(places, felt, stress, jnp.ones(()), 0.0, rate)
                stress = self._as_recorded(theta, effect, record, flow)
        return stress

    def _predict_strain(self, numbers, used, theta, run: StressBatch):
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
        return strain_at_stress(dynamics, run.times, imposed, inertia, flow)[run.sample_index]

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

    def _law(self, numbers, theta):
        """Return the law with the values of its free parameters."""
        free = self.structure.free_parameters
        if not free:
            return numbers.law
        known = dict(self.structure.parameters) | dict(
            zip(free, theta[2 : 2 + len(free)], strict=True)
        )
        return LAWS[self.structure.law_name].build(*known.values())

    def _terms_by_mode(self, law, added, theta, modes: Modes):
        """Return the function by how much h of each mode differs from that of equal constants."""
        by_mode = self._by_mode
        assert by_mode is not None
        factors = by_mode.factors(self._values(theta, by_mode), *modes)

        def of_mode(stress, gradient):
            return law.extra_term(stress, rate_of_deformation(gradient))

        of_law = jax.vmap(of_mode, in_axes=-1, out_axes=-1)

        def differing(stress, gradient):
            # a mode that an effect adds stands after the declared ones, and is as they are in mean
            declared = jnp.ones(stress.shape[-1]).at[: len(factors)].set(factors)
            return (declared - 1.0) * (of_law(stress, gradient) + added(stress, gradient))

        return differing

    def _dynamics(self, numbers, used, theta, flow: Kinematics | None) -> Dynamics:
        law = self._law(numbers, theta)
        # factors that are not fitted stay constants: no trial and no derivative passes through
        modulus, relaxation_time = numbers.modulus, numbers.relaxation_time
        if self.structure.fit_modulus:
            modulus = modulus * jnp.exp(theta[0])
        if self.structure.fit_relaxation_time:
            relaxation_time = relaxation_time * jnp.exp(theta[1])
        of_law = jax.vmap(law.stress_rate, in_axes=-1, out_axes=-1)
        added = self.added.rate(theta, used)

        extra = None
        if self._modes:
            pairs = [effect.mode(self._values(theta, effect)) for effect in self._modes]
            extra = Modes(*(jnp.stack(column) for column in zip(*pairs, strict=True)))

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
            series = Series(slip, compliance)
        return Dynamics(
            modes_rate,
            law.linear_relaxation,
            Modes(modulus, relaxation_time),
            extra,
            {effect: self._values(theta, effect) for effect in self._states},
            series,
            self._beside(numbers, theta, jnp.ones(1), flow)[0],
        )


def _where_in_shear(flow: Kinematics | None, changed, unchanged):
    """Return what a rotational rheometer's drive changes: runs in shear alone.

    An extension is made on another instrument, with flaws of its own. What distorts the signal of
    the torque changes neither that nor the normal force.
    """
    return changed if flow is None else jnp.where(flow.is_shear, changed, unchanged)


_program = lru_cache(maxsize=16)(_Program)


class AugmentedModel:
    """The declared model with a list of effects, as functions of one parameter vector.

    Models that differ in numbers only (moduli, times, scales of the data) share one compiled
    program for each shape of the runs.

    Parameters
    ----------
    declared
        The declared model.
    effects
        Candidates; their parameters follow one another in the vector, after the declared ones.
        Those that the declared model knows follow, if they are not among them.
    scales
        Size of each property of the data in which parameters are scaled; see `data_scales`.
    """

    def __init__(
        self,
        declared: DeclaredModel,
        effects: Sequence[AbstractEffect],
        scales: Mapping[str, float] | None = None,
    ):
        self.declared = declared
        names = {effect.name for effect in effects}
        known = (known.effect for known in declared.effects if known.name not in names)
        self.effects = (*effects, *known)
        free = declared.free_parameters
        self._program = _program(
            _Structure(
                self.effects,
                tuple(p.name for p in free),
                # a law without free parameters is data; with them, its values are rebuilt
                declared.law_name if free else "",
                declared.parameters if free else (),
                declared.fit_modulus,
                declared.fit_relaxation_time,
            )
        )
        self.slices, self.size = self._program.slices, self._program.size
        parameters = [p for effect in self.effects for p in effect.parameters]
        sizes = {"one": 1.0} | dict(scales or {})
        units = [sizes.get(p.range_scale, 1.0) for p in parameters]
        lows = [p.low * unit for p, unit in zip(parameters, units, strict=True)]
        highs = [p.high * unit for p, unit in zip(parameters, units, strict=True)]
        self.low = np.array([-10.0, -10.0, *(p.low for p in free), *lows])
        self.high = np.array([10.0, 10.0, *(p.high for p in free), *highs])
        trials = [p.first_trial * sizes.get(p.scale, 1.0) for p in parameters]
        # well inside the range, whatever the data's own size suggests
        trials = [
            float(np.clip(trial, max(low, _TRIAL_SHARE * low), _TRIAL_SHARE * high))
            for trial, low, high in zip(trials, lows, highs, strict=True)
        ]
        self.first_trial = np.array([0.01] * (2 + len(free)) + trials)

    @cached_property
    def _numbers(self) -> _Numbers:
        declared = self.declared
        return _Numbers(
            declared.law,
            jnp.asarray(declared.modulus),
            jnp.asarray(declared.relaxation_time),
            jnp.asarray(float(declared.solvent_viscosity)),
        )

    def zero(self) -> Float[np.ndarray, " p"]:
        """Return the vector of the declared model: amplitudes zero, inner parameters at start.

        Known effects have their values, and where these are to be fitted, a first trial.
        """
        theta = np.zeros(self.size)
        for i, parameter in enumerate(self.declared.free_parameters):
            theta[2 + i] = parameter.start
        for effect in self.effects:
            for i in range(1, len(effect.parameters)):
                position = self.slices[effect.name].start + i
                theta[position] = self.first_trial[position]
        for known in self.declared.effects:
            for position, value in zip(self.positions(known.name), known.values, strict=True):
                theta[position] = self.first_trial[position] if value is None else value
        return theta

    @property
    def free_positions(self) -> list[int]:
        """Positions of what is fitted of the declared model, its known effects included."""
        free = self.declared.free_positions
        for known in self.declared.effects:
            pairs = zip(self.positions(known.name), known.values, strict=True)
            free += [position for position, value in pairs if value is None]
        return free

    def positions(self, name: str) -> list[int]:
        """Return the positions of an effect's parameters in the vector."""
        at = self.slices[name]
        return list(range(at.start, at.stop))

    def predict(self, theta, batch: Batch) -> Float[np.ndarray, "runs n"]:
        """Return the predicted records: stresses in Pa, and strains of runs at a given stress."""
        return self.predictions([theta], batch)[0]

    def predictions(
        self, thetas: Sequence[np.ndarray] | np.ndarray, batch: Batch
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return the predicted records of any number of parameter vectors."""
        if not isinstance(batch, MixedBatch):
            return self._of_part(thetas, batch)
        out = np.zeros((len(thetas), *batch.recorded.shape))
        for rows, part in zip(batch.rows, batch.parts, strict=True):
            found = self._of_part(thetas, part)
            out[:, rows, : found.shape[2]] = found
        return out

    def _of_part(self, thetas, part: Part) -> Float[np.ndarray, "trials runs n"]:
        program = self._program

        def one(theta: np.ndarray) -> np.ndarray:
            used = program.in_use(theta)
            return np.asarray(program.predict(self._numbers, used, theta, part))

        trials, out = list(thetas), []
        # the first of a shape alone, so that the program is compiled once
        shape = (type(part), *(leaf.shape for leaf in jax.tree.leaves(part)))
        if shape not in program.met:
            out.append(one(trials.pop(0)))
            program.met.add(shape)
        if len(trials) > 1:
            with ThreadPoolExecutor(_WORKERS) as pool:
                out += pool.map(one, trials)
        else:
            out += map(one, trials)
        return np.stack(out)

    def residuals(
        self, thetas: Sequence[np.ndarray] | np.ndarray, batch: Batch
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return the weighted residuals of parameter vectors; not finite where one fails."""
        difference = self.predictions(thetas, batch) - np.asarray(batch.recorded)
        return difference * np.asarray(batch.weight)
