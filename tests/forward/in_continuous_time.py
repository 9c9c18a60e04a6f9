"""A fluid with effects in continuous time, by scipy: what lanes are compared with.

Laws and effects say what they are, as everywhere; how modes, states of the fluid and what gives way
in series move together is written out anew, and no step is the package's.
"""

from copy import copy
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from discover.effects import KinematicEffect, Record, SignalEffect
from discover.protocols.protocol import shear_rates
from tensor_library.algebra import rate_of_deformation

# Samples of a run between which a rate that an instrument shapes is a straight line
_DENSE = 801


class ContinuousFluid:
    """The fluids of vectors of parameters in shear, or in the flow of a run."""

    def __init__(self, model, theta, flow=None):
        self._fluid, self._numbers = model._predictor.program.fluid, model._predictor._numbers
        self._flow = flow
        levels = [effect.levels for effect in self._fluid.states]
        self._ends = np.cumsum(levels) if levels else np.zeros(0, int)
        self._changes, self._stresses = jax.jit(self._change), jax.jit(self._stress)
        self._together = jax.jit(self._change_and_stress)
        # as one program: step by step each operation would be compiled by itself
        self._all_seen = jax.jit(self._stress_and_beside)
        self._turn_to(theta)

    def of(self, theta):
        """Return the fluid of another vector, which shares what is compiled."""
        other = copy(self)
        other._turn_to(theta)
        return other

    def _turn_to(self, theta):
        self._theta = jnp.asarray(theta)
        modes = self._modes(self._theta)[1]
        rest = [np.full(effect.levels, effect.rest) for effect in self._fluid.states]
        self.rest = np.concatenate([np.zeros(4 * len(modes)), *rest])
        one = jnp.ones(1)
        self.viscosity = float(self._fluid.beside(self._numbers, self._theta, one, self._flow)[0])
        series = self._fluid.in_series(self._theta)
        gives_way = series is not None and (self._flow is None or bool(self._flow.is_shear))
        self.slip, self.compliance = map(float, series) if gives_way else (0.0, 0.0)

    def stress(self, y):
        """Return the recorded stress of the modes in Pa."""
        return float(self._stresses(self._theta, y))

    def _modes(self, theta):
        """Return moduli in Pa and times in s."""
        _, declared, extra, _ = self._fluid.of_modes(self._numbers, theta)
        pairs = [declared] if extra is None else [declared, extra]
        return [jnp.concatenate(column) for column in zip(*pairs, strict=True)]

    def _values(self, effect, theta=None):
        return (self._theta if theta is None else theta)[self._fluid.slices[effect.name]]

    def _parts(self, theta, y):
        times = self._modes(theta)[1]
        modes = y[: 4 * len(times)].reshape(len(times), 4)
        levels = jnp.split(y[modes.size :], self._ends[:-1]) if len(self._ends) else []
        states = self._fluid.states
        return modes, [
            own if effect.levels > 1 else own[0] for effect, own in zip(states, levels, strict=True)
        ]

    def _factor(self, name, theta, levels):
        total = 1.0
        for effect, level in zip(self._fluid.states, levels, strict=True):
            total = total * getattr(effect, name)(self._values(effect, theta), level)
        return total

    def _stress(self, theta, y):
        modes, levels = self._parts(theta, y)
        own = modes[:, 3] if self._flow is None else self._flow.stress(modes.T)
        return self._factor("modulus_factor", theta, levels) * jnp.sum(self._modes(theta)[0] * own)

    def _change(self, theta, y, rate):
        modes, levels = self._parts(theta, y)
        moduli, times = self._modes(theta)
        flow, slow = self._flow, self._factor("time_factor", theta, levels)
        unit = 1.0 if flow is None else flow.gradient
        law = self._fluid.of_modes(self._numbers, theta).law
        effects = [e for e in self._fluid.constitutive if e.adds_term]

        def of_mode(stress, time):
            gradient = slow * time * rate * unit
            change = law.stress_rate(stress, gradient)
            deformation = rate_of_deformation(gradient)
            for effect in effects:
                values = self._values(effect, theta)
                change = change - effect.extra_term(values, stress, deformation)
            return change / (slow * time)

        sheared = modes[:, 3] if flow is None else flow.equivalent_shear_stress(modes.T)
        sheared = self._factor("modulus_factor", theta, levels) * jnp.sum(moduli * sheared)
        felt = rate if flow is None else flow.intensity * rate
        moved = []
        for effect, level in zip(self._fluid.states, levels, strict=True):
            source, decay = effect.source_and_decay(self._values(effect, theta), felt, sheared)
            moved.append(jnp.ravel(source - decay * level))
        return jnp.concatenate([jax.vmap(of_mode)(modes, times).ravel(), *moved])

    def _change_and_stress(self, theta, y, rate):
        """Return these, and the change of the stress."""
        moved = self._change(theta, y, rate)
        return moved, *jax.jvp(lambda y: self._stress(theta, y), (y,), (moved,))

    def _stress_and_beside(self, theta, states, rates):
        own = jax.vmap(partial(self._stress, theta))(states)
        return own + self._fluid.beside(self._numbers, theta, rates, self._flow)

    def at_rate(self, tool, times):
        """Return the recorded stress and the felt rate at times after rest; NaN where none is.

        `tool`: its rate in 1/s, of time. The strain of what gives way is C σ + ∫ s σ dt.
        """
        viscosity, slip, soft = self.viscosity, self.slip, self.compliance

        def felt(t, y):
            if soft:
                return y[-1]
            given = slip * self.stress(y) if slip else 0.0
            return (tool(t) - given) / (1.0 + slip * viscosity)

        def slope(t, y):
            rate, own = felt(t, y), y[:-1] if soft else y
            if not soft:
                return np.asarray(self._changes(self._theta, own, rate))
            moved, stress, grows = self._together(self._theta, own, rate)
            stress = float(stress) + viscosity * rate
            left = (tool(t) - rate - slip * stress) / soft - float(grows)
            return np.append(moved, left / viscosity)

        start = np.append(self.rest, 0.0) if soft else self.rest
        close = {"rtol": 1e-8, "atol": 1e-9}
        reached = solve_ivp(slope, (0.0, times[-1]), start, "LSODA", times, **close)
        found = reached.y.T
        rates = np.array([felt(*each) for each in zip(reached.t, found, strict=True)])
        stress = np.asarray(self._all_seen(self._theta, found[:, : self.rest.size], rates))
        missing = len(times) - len(stress)
        return tuple(np.pad(of, (0, missing), constant_values=np.nan) for of in (stress, rates))

    def at_stress(self, imposed, inertia, times):
        """Return the strain of the fluid and of what gives way, at times after rest."""
        size = self.rest.size

        def slope(t, y):
            own, left = y[:size], imposed(t) - self.stress(y[:size])
            rate = y[-1] if inertia else left / self.viscosity
            moved = [*np.asarray(self._changes(self._theta, own, rate)), rate, imposed(t)]
            return [*moved, (left - self.viscosity * rate) / inertia] if inertia else moved

        start = np.append(self.rest, np.zeros(2 + bool(inertia)))
        found = solve_ivp(slope, (0.0, times[-1]), start, "LSODA", times, rtol=1e-8, atol=1e-9).y
        given = self.compliance * np.array([imposed(t) - imposed(0.0) for t in times])
        return found[size] + given + self.slip * found[size + 1]

    def recorded(self, run):
        """Return what is recorded of a run at a given rate, with what its instrument does."""
        effects, times = self._fluid.structure.effects, run.time
        acting = [
            e
            for e in effects
            if isinstance(e, KinematicEffect | SignalEffect)
            and self._flow is None
            and self._values(e)[0] != 0.0
        ]
        if acting:
            times = np.unique(np.concatenate([np.linspace(0.0, run.time[-1], _DENSE), run.time]))
        commanded = tool = jnp.asarray(shear_rates(run.protocol, times))
        for effect in acting:
            if isinstance(effect, KinematicEffect):
                tool = jax.jit(effect.felt_rate)(self._values(effect), times, tool)
        rates = np.asarray(tool)
        exact = acting or run.protocol.amplitudes.size == 0

        def at(t):
            if exact:
                return np.interp(t, times, rates)
            return shear_rates(run.protocol, np.array([t]))[0]

        stress, felt = self.at_rate(at, times)
        for effect in acting:
            if isinstance(effect, SignalEffect):
                stress = np.asarray(
                    _distorted(effect, self._values(effect), times, felt, stress, commanded)
                )
        return stress[np.searchsorted(times, run.time)]

    def modulus(self, strain, frequency, cycles):
        """Return G′ + iG″ in Pa of the last of so many cycles of the tool."""
        period = 2.0 * np.pi / frequency
        phase = np.linspace(0.0, 2.0 * np.pi, 65)[1:]
        times = (cycles - 1) * period + phase / frequency
        stress, _ = self.at_rate(lambda t: strain * frequency * np.cos(frequency * t), times)
        # of what is periodic, the sum over a period is exact to all orders
        return np.mean(stress * 2j * np.exp(-1j * phase)) / strain


@partial(jax.jit, static_argnums=0)
def _distorted(effect, values, times, felt, stress, commanded):
    """Return the record that an effect on the signal makes of a stress."""
    return effect.recorded_stress(values, Record(times, felt, stress, jnp.ones(()), 0.0, commanded))
