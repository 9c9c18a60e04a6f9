"""The fluid that a vector of parameters is: a declared law with effects, as integrators take it."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float
from scipy.integrate import cumulative_trapezoid

from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    LibraryTerm,
    ModeEffect,
    SeriesElement,
    StateEffect,
)
from discover.forward.declared import DEGREE, Structure, constants_of_modes, decades
from discover.forward.dynamics import Modes
from discover.laws import LAWS, AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, with_modes
from discover.protocols.kinematics import Kinematics
from tensor_library.algebra import scalar_invariants


class LibraryMatrix:
    """Coefficients of library terms, basis tensors × monomials of the invariants."""

    def __init__(self, terms: Sequence[LibraryTerm], positions: Sequence[int]):
        self.positions = np.asarray(positions, dtype=int)
        self.powers = tuple(dict.fromkeys(term.term.powers for term in terms))
        self.rows = np.array([term.term.tensor for term in terms], dtype=int)
        self.columns = np.array([self.powers.index(t.term.powers) for t in terms], dtype=int)
        self.tensors = tuple(sorted(set(self.rows.tolist())))
        """Basis tensors that occur."""

    def matrix(self, theta: Float[Array, " p"]) -> Float[Array, "8 m"]:
        """Return the coefficients as a matrix."""
        empty = jnp.zeros((8, len(self.powers)))
        return empty.at[self.rows, self.columns].add(theta[self.positions])

    def monomials(self, stress, rate) -> Float[Array, " m"]:
        """Return the monomials of the invariants, in the order of the columns."""
        invariants = scalar_invariants(stress, rate)
        values = []
        for powers in self.powers:
            value = jnp.ones(())
            for i, power in enumerate(powers):
                for _ in range(power):
                    value = value * invariants[i]
            values.append(value)
        return jnp.stack(values)


class Series(NamedTuple):
    """Elements in series with the fluid: slip in 1/(Pa s) and compliance in 1/Pa."""

    slip: Float[Array, ""]
    compliance: Float[Array, ""]

    def strain(
        self, times: Float[np.ndarray, "runs s"], imposed: Float[np.ndarray, "*vectors runs s"]
    ) -> Float[np.ndarray, "vectors runs s"]:
        """Return their strain at times in s under a given stress in Pa."""
        slipped = cumulative_trapezoid(imposed, np.broadcast_to(times, imposed.shape), initial=0.0)
        given = np.asarray(self.compliance) * (imposed - imposed[..., :1])
        return given + np.asarray(self.slip) * slipped


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

    `library`, `other_terms`: what effects add to the law of each mode. `slices`, `of_effects`,
    `instants`: where in the vector the parameters of each effect, of all of
    them, and the instants of steps of the rate stand. `size`: its length.
    """

    def __init__(self, structure: Structure):
        self.structure = structure
        effects = structure.effects
        self.slices: dict[str, slice] = {}
        # first the logarithms of the factors on moduli and times, then the law's free parameters
        position = max(
            [
                2 + len(structure.free_parameters) + structure.law_numbers,
                *(end for *_, end in structure.by_mode),
            ]
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
        plain = [
            e
            for e in self.constitutive
            if isinstance(e, LibraryTerm)
            and e.term.closed_form is None
            and e not in self.varying_effects
        ]
        self.library = LibraryMatrix(plain, [self.slices[term.name].start for term in plain])
        self.other_terms = [e for e in self.constitutive if e.adds_term and e not in plain]
        self._modes = [e for e in effects if isinstance(e, ModeEffect)]
        self.states = [e for e in effects if isinstance(e, StateEffect)]
        self.series = [e for e in effects if isinstance(e, SeriesElement)]

    def values(self, theta, effect: AbstractEffect):
        """Return the parameters of an effect."""
        return theta[self.slices[effect.name]]

    def present(self, thetas: Float[Array, "*trials p"] | np.ndarray) -> Any:
        """Return of each effect whether its amplitude is not zero, in one of several vectors."""
        return (thetas.reshape(-1, self.size)[:, self._amplitudes] != 0.0).any(axis=0)

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
        free, own = self.structure.free_parameters, self.structure.law_numbers
        if own:
            moving, rest = eqx.partition(numbers.law, eqx.is_inexact_array)
            return eqx.combine(ravel_pytree(moving)[1](theta[2 : 2 + own]), rest)
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
        return LawOfEachMode(law=jax.vmap(named.build)(*columns))

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
                times = numbers.relaxation_time
                added_at = decades(numbers.modulus, times, extra.relaxation_time)
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

    def in_series(self, theta) -> Series | None:
        """Return what gives way in series with the fluid; None where there is no such effect.

        Slip that depends on the stress is left out.
        """
        if not self.series:
            return None
        pairs = [e.slip_and_compliance(self.values(theta, e)) for e in self.series]
        return Series(*(jnp.asarray(sum(column)) for column in zip(*pairs, strict=True)))


def where_in_shear(flow: Kinematics | None, changed, unchanged):
    """Return what a rotational rheometer's drive changes: runs in shear alone."""
    return changed if flow is None else jnp.where(flow.is_shear, changed, unchanged)
