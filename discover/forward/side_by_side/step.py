"""A step of one mode of one vector, as functions of numbers from which lanes are written.

Krogstad's method, taken apart where a loop over the modes stands. A branch by a flag that all
vectors of a call share costs nothing where it is not taken.
"""

from collections.abc import Callable, Sequence
from functools import reduce
from operator import add
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover.effects import ConstitutiveEffect, StateEffect
from discover.forward.augmented_fluid import AugmentedFluid, where_in_shear
from discover.forward.declared import Numbers
from discover.forward.exponential_weights import (
    KrogstadWeights,
    StressWeights,
    krogstad_weights,
    relax,
)
from discover.laws.each_mode import apart, of_each_mode
from tensor_library.algebra import contracted, integrity_basis, rate_of_deformation

WEIGHTS = 10
"""Weights of a step of each mode: those of `KrogstadWeights` but for the last."""


class Mode(NamedTuple):
    """What differs from mode to mode: each leaf has a leading axis of modes, or is of one mode.

    `relaxations`, `shares`: how chains that retract are stepped through, as the law's; None for
    others.
    """

    modulus: Any
    relaxation_time: Any
    amplitudes: dict[str, Any]
    law: Any
    relaxations: Any = None
    shares: Any = None


class Shared(NamedTuple):
    """What all modes share: parameters of effects, the law but for what differs, the solvent."""

    theta: Any
    law: Any
    solvent_viscosity: Any


def laid_out(fluid: AugmentedFluid, numbers: Numbers, theta) -> tuple[Mode, Shared]:
    """Return what a vector says of each mode, and what of all of them."""
    law, declared, extra, amplitudes = fluid.of_modes(numbers, theta)
    modulus, time = declared
    if extra is not None:
        modulus = jnp.append(modulus, extra.modulus)
        time = jnp.append(time, extra.relaxation_time)
    own, common = apart(law)
    of_rest = [
        of_each_mode(lambda law, name=name: getattr(law, name)(), law, len(modulus))
        if has
        else None
        for name, has in (("relaxations", law.retracts), ("shares", law.tensors))
    ]
    of_effects = jnp.concatenate([theta[:2], theta[fluid.of_effects]])
    return (
        Mode(modulus, time, amplitudes, own, *of_rest),
        Shared(of_effects, common, numbers.solvent_viscosity),
    )


class Flags:
    """Which parts of a program vectors need: a flag for each, and which parameters set it."""

    def __init__(self, fluid: AugmentedFluid):
        first = {
            e.name: [at.start] for e in fluid.structure.effects for at in [fluid.slices[e.name]]
        }
        varied = {e.name: [*range(at.start, at.stop)] for e, at in fluid.varying_effects.items()}
        library = fluid.library
        setting: dict[str, list[int]] = {
            f"tensor {tensor}": [
                int(at)
                for at, row in zip(library.positions, library.rows, strict=True)
                if row == tensor
            ]
            for tensor in library.tensors
        }
        setting["library"] = [at for positions in setting.values() for at in positions]
        others = fluid.other_terms
        of_others = {e.name: first[e.name] + varied.get(e.name, []) for e in others}
        setting["terms"] = sum(of_others.values(), list(setting["library"]))
        setting |= {f"term {name}": at for name, at in of_others.items()}
        setting |= {f"beside {e.name}": first[e.name] for e in beside_modes(fluid)}
        setting |= {f"state {e.name}": first[e.name] for e in fluid.states}
        setting["states"] = [first[e.name][0] for e in fluid.states]
        setting["times"] = [first[e.name][0] for e in fluid.states if e.changes_times]
        setting["series"] = [first[e.name][0] for e in fluid.series]
        # the last is set by what is called, for weights of steps that are not those of the table
        self.names = [*setting, "own weights"]
        self._set_by = np.zeros((fluid.size, len(self.names)))
        for i, positions in enumerate(setting.values()):
            self._set_by[positions, i] = 1.0

    def of(self, thetas: np.ndarray) -> np.ndarray:
        """Return which parts each vector needs, shape (trials, flags); the last is left unset."""
        # of truths NumPy has no fast product
        return (thetas != 0.0).astype(float) @ self._set_by > 0.0


def beside_modes(fluid: AugmentedFluid) -> list[ConstitutiveEffect]:
    """Return the effects that add a stress beside the modes."""
    plain = ConstitutiveEffect.instantaneous_stress
    return [e for e in fluid.constitutive if type(e).instantaneous_stress is not plain]


class Step:
    """The functions of which a step consists.

    `law`: what of it is no array. `states`: of the fluid that are followed; by default all. `kept`:
    how many weights of a step are kept of each mode.
    """

    kept = WEIGHTS

    def __init__(
        self, fluid: AugmentedFluid, law: Any, states: Sequence[StateEffect] | None = None
    ):
        self.fluid = fluid
        self.states = fluid.states if states is None else states
        self._law = law
        self.decay = 1.0 if law.linear_relaxation else 0.0

    def _change(self, shared: Shared, mode: Mode, on, stress, gradient):
        """Return dσ/dt of a mode in its own time, and that of the law's variables."""
        law = eqx.combine(mode.law, shared.law, self._law)
        change = law.stress_rate(stress, gradient)
        rate = rate_of_deformation(gradient)
        nothing = jnp.zeros(4)
        added = _if(on["terms"], lambda: self._added(shared, mode, on, stress[:4], rate), nothing)
        return change - (added if len(change) == 4 else jnp.pad(added, (0, len(change) - 4)))

    def _added(self, shared: Shared, mode: Mode, on, stress, rate):
        library, values = self.fluid.library, self.fluid.values
        total: Any = jnp.zeros(4)
        if library.tensors:
            total = _if(on["library"], lambda: self._of_library(shared, on, stress, rate), total)
        for effect in self.fluid.other_terms:
            own = values(shared.theta, effect)
            if effect.name in mode.amplitudes:
                own = jnp.concatenate([mode.amplitudes[effect.name][None], own[1:]])

            def more(effect=effect, own=own, total=total):
                return total + effect.extra_term(own, stress, rate)

            total = _if(on[f"term {effect.name}"], more, total)
        return total

    def _of_library(self, shared: Shared, on, stress, rate):
        library = self.fluid.library
        monomials, basis = library.monomials(stress, rate), integrity_basis(stress, rate)
        matrix = library.matrix(shared.theta)
        total: Any = jnp.zeros(4)
        for tensor in library.tensors:

            def more(tensor=tensor, total=total):
                seen = sorted(set(library.columns[library.rows == tensor].tolist()))
                products = (matrix[tensor, i] * monomials[i] for i in seen)
                return total + reduce(add, products) * basis[tensor]

            total = _if(on[f"tensor {tensor}"], more, total)
        return total

    def _remainder(self, shared, mode, on, flow, w, slow, stress, rate, now):
        """Return what of the change is not relaxation."""
        gradient = now * mode.relaxation_time * rate
        if flow is not None:
            gradient = gradient * flow.gradient
        change = self._change(shared, mode, on, stress, gradient)
        change = _if(on["times"], lambda: slow / now * change, change)
        return w.remainder(stress, change, self.decay)

    def weights(self, mode: Mode, on, width, table):
        """Return the weights of a step: those of a table, or of a mode's own time.

        Where chains retract always the latter, of stress and trace of each tensor: they depend on
        the law.
        """

        def own(faster=0.0):
            h = width / mode.relaxation_time
            return jnp.stack(krogstad_weights(-(self.decay + faster) * h, h)[: self.kept])

        if mode.relaxations is None:
            return _if(on["own weights"], own, table)
        rates = [rate for whole, trace in mode.relaxations for rate in (whole, whole + trace)]
        return jnp.stack([own(), *(own(rate) for rate in rates[1:])])

    def _of_step(self, mode: Mode, weights) -> StressWeights:
        """Return weights as a step takes them."""
        rows = weights.reshape(-1, self.kept)
        more = jnp.zeros((len(rows), len(KrogstadWeights._fields) - self.kept))
        rows = jnp.concatenate([rows, more], axis=1)
        return StressWeights.of_kinds(rows, mode.relaxations, mode.shares)

    def of_mode(self, shared, mode, on, flow, slow, stress, rates, taken, earlier, weights):
        """Return a mode after a step.

        `slow`, `rates`: the factor on all times, and the rate in 1/s without what series elements
        take, at start, middle and end. `taken`, `earlier`: rate that these take in this step and in
        the one before.
        """
        w = self._of_step(mode, weights)
        first, middle, last = rates

        @jax.jit  # so that it is traced once, and not at each of the four stages
        def remainder(stress, rate, now):
            return self._remainder(shared, mode, on, flow, w, slow[1], stress, rate, now)

        n1 = remainder(stress, first + earlier, slow[0])
        if self.fluid.series:
            # the upper-convected derivative is linear in the rate
            change = (taken - earlier) * slow[1] * mode.relaxation_time
            along = jnp.zeros_like(stress).at[0].set(2.0 * stress[3]).at[3].set(1.0 + stress[1])
            n1 = _if(on["series"], lambda: n1 + change * along, n1)
        n2 = remainder(w.second(stress, n1), middle + taken, slow[1])
        n3 = remainder(w.third(stress, n1, n2), middle + taken, slow[1])
        n4 = remainder(w.fourth(stress, n1, n3), last + taken, slow[2])
        return w.end(stress, n1, n2, n3, n4)

    def felt(self, mode: Mode, flow, stress):
        """Return what a mode adds to the stress that states feel, and to the recorded one."""
        if flow is None:
            return mode.modulus * stress[3], mode.modulus * stress[3]
        sheared = flow.equivalent_shear_stress(stress[:4])
        return mode.modulus * sheared, mode.modulus * contracted(flow.recorded, stress[:4])

    def beside(self, shared: Shared, on, flow, rate):
        """Return the recorded stress beside the modes; see `AugmentedFluid.beside`."""
        intensity, viscous = (1.0, 1.0) if flow is None else (flow.intensity, flow.viscous)
        total: Any = shared.solvent_viscosity * viscous * rate
        for effect in beside_modes(self.fluid):

            def more(effect=effect, total=total):
                values = self.fluid.values(shared.theta, effect)
                shear = effect.instantaneous_stress(values, (intensity * rate)[None])[0]
                return total + viscous / intensity * shear

            total = _if(on[f"beside {effect.name}"], more, total)
        return total

    def _factor(self, name: str, shared, on, levels):
        """Return the product of a factor of all states."""
        total: Any = jnp.ones(())
        for effect, level in zip(self.states, levels, strict=True):
            if getattr(type(effect), name) is getattr(StateEffect, name):
                continue

            def more(effect=effect, level=level, total=total):
                values = self.fluid.values(shared.theta, effect)
                return total * getattr(effect, name)(values, level)

            total = _if(on[f"state {effect.name}"], more, total)
        return total

    def stiffness(self, shared, on, levels):
        """Return the factor of the states on the moduli."""
        return self._factor("modulus_factor", shared, on, levels)

    def _later(self, shared, on, levels, rate, stress, widths):
        """Return the states after steps of several widths, source and decay constant in each."""
        after = []
        for effect, level in zip(self.states, levels, strict=True):

            def moved(effect=effect, level=level):
                values = self.fluid.values(shared.theta, effect)
                terms = effect.source_and_decay(values, rate, stress)
                return tuple(relax(*terms, level, width) for width in widths)

            after.append(_if(on[f"state {effect.name}"], moved, tuple(level for _ in widths)))
        return [tuple(column) for column in zip(*after, strict=True)] or [() for _ in widths]

    def before_modes(self, shared, on, flow, levels, sheared, rate, width):
        """Return the shear stress, the factor on it at the end, and those on the times."""
        rate = rate if flow is None else flow.intensity * rate
        still = (jnp.ones(()), jnp.ones(3))
        if not levels:
            return sheared, *still
        before = self._factor("modulus_factor", shared, on, levels) * sheared

        def moving():
            halfway, end = self._later(shared, on, levels, rate, before, (0.5 * width, width))
            slow = [self._factor("time_factor", shared, on, at) for at in (levels, halfway, end)]
            return self._factor("modulus_factor", shared, on, end), jnp.stack(slow)

        return before, *_if(on["states"], moving, still)

    def after_modes(
        self, shared, on, flow, levels, rate, width, before, scale_last, sheared, recorded
    ):
        """Return the states after a step, and the shear stress and the recorded one with them."""
        if not levels:
            return levels, sheared, recorded
        rate = rate if flow is None else flow.intensity * rate

        def moved():
            middle = 0.5 * (before + scale_last * sheared)
            (after,) = self._later(shared, on, levels, rate, middle, (width,))
            factor = self._factor("modulus_factor", shared, on, after)
            return after, factor * sheared, factor * recorded

        return _if(on["states"], moved, (levels, sheared, recorded))

    def foreseen(self, shared, mode, on, flow, slow, stress, rate, weights):
        """Return what a mode adds to the stress after a step, and to its stiffness."""
        of_step = self._of_step(mode, weights)
        n1 = self._remainder(shared, mode, on, flow, of_step, slow[1], stress, rate, slow[0])
        w = of_step.whole
        whole = w.b1 + 2.0 * w.b23 + w.b4
        stretch = slow[1] * mode.relaxation_time * (1.0 + stress[1])
        predicted = w.full * stress[3] + whole * n1[3]
        return mode.modulus * predicted, mode.modulus * whole * stretch

    def taken(
        self, shared, on, flow, rates, width, jump, before, missing, earlier, scale, foreseen
    ):
        """Return the rate that series elements take.

        Their strain at the end must be −C σ − ∫ s σ dt. The stress there is predicted by one
        exponential Euler step, linear in the rate; what this misses is taken to the next step in
        `missing`.
        """
        slip, compliance = self._series(shared, flow, before)
        viscous = self.beside(shared, on, flow and flow.driven, jnp.ones(()))
        predicted, stiffness = scale * foreseen[0], scale * foreseen[1]
        compliance = compliance + 0.5 * slip * width
        predicted = predicted + viscous * (rates[2] + earlier)
        torque = before + viscous * (rates[0] + earlier)
        taken = compliance * (predicted - (stiffness + viscous) * earlier)
        taken = taken + 0.5 * slip * width * torque + missing
        now = -taken / (width + compliance * (stiffness + viscous))
        return jnp.where(width > jump, now, earlier)

    def missing(self, shared, on, flow, rates, width, before, after, missing, taken):
        """Return what series elements have yet to take after a step."""
        viscous = self.beside(shared, on, flow and flow.driven, jnp.ones(()))
        torque = 0.5 * (before + after + viscous * (rates[0] + rates[2] + 2.0 * taken))
        slip, _ = self._series(shared, flow, torque)
        return missing + taken * width + slip * width * torque

    def _series(self, shared: Shared, flow, stress):
        slip, compliance = jnp.zeros(()), jnp.zeros(())
        for element in self.fluid.series:
            values = self.fluid.values(shared.theta, element)
            more, soft = element.slip_and_compliance(values)
            slip, compliance = slip + more, compliance + soft
            if element.slips_by_stress:
                slip = slip + element.slip_at(values, stress)
        both = where_in_shear(flow, jnp.stack([slip, compliance]), jnp.zeros(2))
        return both[0], both[1]


def _if(flag, yes: Callable[[], Any], no: Any) -> Any:
    """Return what is computed where a flag is set, and else what is there already."""
    if not jax.tree.leaves(no):
        return no
    return jax.lax.cond(flag, yes, lambda: jax.tree.map(jnp.asarray, no))
