"""The fluid that a vector of parameters is: a declared law with effects, as integrators take it."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    ModeEffect,
    SeriesElement,
    StateEffect,
)
from discover.forward.added_terms import AddedTerms, InUse
from discover.forward.declared import DEGREE, Structure, constants_of_modes, decades
from discover.forward.dynamics import Dynamics, Modes, Series
from discover.laws import LAWS, AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, of_each_mode, over_modes, with_modes
from discover.protocols.kinematics import Kinematics


class OfModes(NamedTuple):
    """What a vector says of each mode.

    `declared`, `extra`: the declared modes, and those of effects. `amplitudes`: of effects whose
    amplitude differs from mode to mode, by name.
    """

    law: AbstractConstitutiveLaw
    declared: Modes
    extra: Modes | None
    amplitudes: dict[str, Float[Array, " k"]]


class AugmentedFluid:
    """What a structure makes of a vector: the fluid, and what gives way in series with it.

    `slices`, `of_effects`, `instants`: where in the vector the parameters of each effect, of all of
    them, and the instants of steps of the rate stand. `size`: its length.
    """

    def __init__(self, structure: Structure):
        self.structure = structure
        effects = structure.effects
        self.slices: dict[str, slice] = {}
        # first the logarithms of the factors on moduli and times, then the law's free parameters
        position = max(
            [2 + len(structure.free_parameters), *(end for *_, end in structure.by_mode)]
        )
        first = position
        for effect in effects:
            self.slices[effect.name] = slice(position, position + len(effect.parameters))
            position += len(effect.parameters)
        self.of_effects = slice(first, position)
        self._amplitudes = np.array([self.slices[e.name].start for e in effects], dtype=int)
        self.instants = slice(position, position + structure.step_instants)
        self.size = self.instants.stop
        self.constitutive = [e for e in effects if isinstance(e, ConstitutiveEffect)]
        # of the law's constants, and of effects' amplitudes
        slots = {name: slice(start, end) for name, start, end in structure.by_mode}
        free = structure.free_parameters
        self._varying_law = {name: at for name, at in slots.items() if name in free}
        self.varying_effects = {
            e: slots[e.name] for e in self.constitutive if e.name in slots and e.name not in free
        }
        of_effects = {e.name: at for e, at in self.varying_effects.items()}
        self.added = AddedTerms(self.constitutive, self.slices, of_effects)
        self._modes = [e for e in effects if isinstance(e, ModeEffect)]
        self.states = [e for e in effects if isinstance(e, StateEffect)]
        self.series = [e for e in effects if isinstance(e, SeriesElement)]

    def values(self, theta, effect: AbstractEffect):
        """Return the parameters of an effect."""
        return theta[self.slices[effect.name]]

    def present(self, thetas: Float[Array, "*trials p"] | np.ndarray) -> Any:
        """Return of each effect whether its amplitude is not zero, in one of several vectors."""
        return (thetas.reshape(-1, self.size)[:, self._amplitudes] != 0.0).any(axis=0)

    def in_use(self, theta: np.ndarray) -> InUse:
        """Return the branches that a parameter vector takes."""
        states = [i for i, e in enumerate(self.states) if theta[self.slices[e.name].start] != 0.0]
        several = len(self.states) + 1
        return self.added.in_use(theta)._replace(
            states=np.int32(0 if not states else states[0] + 1 if len(states) == 1 else several),
            times=np.int32(any(self.states[i].changes_times for i in states)),
        )

    def beside(self, numbers, theta, rate, flow: Kinematics | None):
        """Return the recorded stress of the solvent and of what effects add beside the modes.

        Any flow of the same intensity has the stress of a generalised Newtonian fluid   [Bird,
        Armstrong & Hassager 1987, vol. 1, chapter 4].
        """
        intensity, viscous = (1.0, 1.0) if flow is None else (flow.intensity, flow.viscous)
        total = numbers.solvent_viscosity * viscous * rate
        for effect in self.constitutive:
            shear = effect.instantaneous_stress(self.values(theta, effect), intensity * rate)
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
        """Return the law with its free parameters, by mode where these differ."""
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

    def of_modes(self, numbers, theta) -> OfModes:
        """Return what a vector of parameters says of each mode."""
        extra = None
        if self._modes:
            pairs = [effect.mode(self.values(theta, effect)) for effect in self._modes]
            extra = Modes(*(jnp.stack(column) for column in zip(*pairs, strict=True)))
        places = None
        if self._varying_law or self.varying_effects:
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
        amplitudes = {
            e.name: self._varied(
                theta,
                self.values(theta, e)[0],
                (float(e.parameters[0].low), float(e.parameters[0].high)),
                at,
                places,
            )
            for e, at in self.varying_effects.items()
        }
        return OfModes(law, Modes(modulus, relaxation_time), extra, amplitudes)

    def dynamics(self, numbers, used, theta, flow: Kinematics | None) -> Dynamics:
        """Return the fluid and what gives way in series with it, in a flow; None is simple shear.

        `used`: the branches that the vector takes.
        """
        law, declared, extra, amplitudes = self.of_modes(numbers, theta)
        of_law = over_modes(lambda law, *flow: law.stress_rate(*flow), law, -1)
        added = self.added.rate(theta, used, amplitudes)

        def modes_rate(stress, gradient):
            return of_law(stress, gradient) - added(stress, gradient)

        return Dynamics(
            modes_rate,
            law.linear_relaxation,
            declared,
            extra,
            {effect: self.values(theta, effect) for effect in self.states},
            self.in_series(theta, flow),
            self.beside(numbers, theta, jnp.ones(1), flow and flow.driven)[0],
            self._of_modes_at_rest("relaxations", law, declared.modulus, extra)
            if law.retracts
            else None,
            used.times,
            used.states,
            law.variables,
            self._of_modes_at_rest("shares", law, declared.modulus, extra) if law.tensors else None,
        )

    def in_series(self, theta, flow: Kinematics | None) -> Series | None:
        """Return what gives way in series with the fluid; None where there is no such effect."""
        if not self.series:
            return None
        pairs = [e.slip_and_compliance(self.values(theta, e)) for e in self.series]
        both = jnp.stack([jnp.asarray(sum(column)) for column in zip(*pairs, strict=True)])
        slip, compliance = where_in_shear(flow, both, jnp.zeros(2))
        return Series(slip, compliance, self._slip_by_stress(theta, flow))

    def _slip_by_stress(self, theta, flow: Kinematics | None):
        """Return what slip depends on the stress, as a function of it; None where nothing does."""
        elements = [e for e in self.series if e.slips_by_stress]
        if not elements:
            return None

        def slip(stress):
            found = jnp.zeros(())
            for element in elements:
                found = found + element.slip_at(self.values(theta, element), stress)
            return where_in_shear(flow, found, jnp.zeros(()))

        return slip

    def _of_modes_at_rest(
        self, name: str, law: AbstractConstitutiveLaw, modulus, extra: Modes | None
    ):
        """Return what decides how modes are stepped through; no gradient passes through that."""
        count = len(modulus) + (0 if extra is None else len(extra.modulus))
        values = of_each_mode(lambda law: getattr(law, name)(), law, count)
        return jax.lax.stop_gradient(jnp.moveaxis(values, 0, -1))


def where_in_shear(flow: Kinematics | None, changed, unchanged):
    """Return what a rotational rheometer's drive changes: runs in shear alone."""
    return changed if flow is None else jnp.where(flow.is_shear, changed, unchanged)
