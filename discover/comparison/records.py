"""Records without what a known instrument did, for learners and classical laws."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    KinematicEffect,
    KnownEffect,
    ModeEffect,
    Record,
    SeriesElement,
    SignalEffect,
    StateEffect,
)
from discover.effects.signal import NORMAL_FORCE_GAIN
from discover.errors import InputError
from discover.forward import TransientFlows
from discover.forward.flows import transients
from discover.laws.each_mode import with_modes
from discover.laws.expansion import law_of_terms
from discover.laws.textbook.classical import UpperConvectedMaxwell
from discover.loop.task import require_possible
from discover.protocols.protocol import FlowProtocol
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel
from tensor_library.law_terms import LawTerms

ONLY_LOOP = (
    "Leave it out of [model] effects, or, where it comes from an earlier result, give it an "
    "amplitude of 0 there; discover close-loop knows it."
)
"""What to do with an effect that no learner can be told of."""
_RATES = (1.0, 2.0)


def absorbed(declared: StudyModel) -> StudyModel:
    """Return the declared model with known effects of the fluid in its law, modes and solvent.

    Its other effects are of the instrument. Raises InputError if learners cannot take an effect.
    """
    # at zero amplitude an effect is none
    declared = replace(declared, effects=tuple(k for k in declared.effects if k.values[0] != 0.0))
    for known in declared.effects:
        if isinstance(known.effect, StateEffect):
            raise InputError(
                f"compare cannot take {known.name} as known: it gives the fluid a state that no "
                f"law of stress and rate carries. {ONLY_LOOP}"
            )
        if isinstance(known.effect, SeriesElement):
            raise InputError(
                f"compare cannot take {known.name} as known: the rate that the fluid feels would "
                f"depend on the law that is looked for. {ONLY_LOOP}"
            )
        if isinstance(known.effect, ConstitutiveEffect):
            declared = _with_effect(declared, known, known.effect)
    instrument = (k for k in declared.effects if not isinstance(k.effect, ConstitutiveEffect))
    return replace(declared, effects=tuple(instrument))


def _with_effect(
    declared: StudyModel, known: KnownEffect, effect: ConstitutiveEffect
) -> StudyModel:
    values = jnp.asarray([value for value in known.values if value is not None])
    assert len(values) == len(known.values)  # what was to be fitted has a value by now
    terms = effect.as_terms([float(value) for value in values])
    if terms is None:
        raise InputError(
            f"compare cannot take {known.name} as known: what it adds to the law is not a sum "
            f"of library terms. {ONLY_LOOP}"
        )
    law = declared.law
    for term in terms:
        base = None if isinstance(law, UpperConvectedMaxwell) else law
        law = law_of_terms(LawTerms.of([term]), law.linear_relaxation, base)
    viscous = np.asarray(effect.instantaneous_stress(values, jnp.asarray(_RATES)))
    if not np.isclose(viscous[1], _RATES[1] * viscous[0], rtol=1e-9):
        raise InputError(
            f"compare cannot take {known.name} as known: learners know no stress besides the "
            f"modes but a solvent's. {ONLY_LOOP}"
        )
    modulus, relaxation_time = declared.modulus, declared.relaxation_time
    if isinstance(effect, ModeEffect):
        extra = [float(value) for value in effect.mode(values)]
        modulus, relaxation_time = (
            np.append(column, value)
            for column, value in zip((modulus, relaxation_time), extra, strict=True)
        )
        law = with_modes(law, declared.relaxation_time, relaxation_time)
    return replace(
        declared,
        law=law,
        law_name=f"{declared.law_name} with {known.text}" if terms else declared.law_name,
        modulus=modulus,
        relaxation_time=relaxation_time,
        solvent_viscosity=declared.solvent_viscosity + float(viscous[0]),
    )


_FOLLOWED = 1e-4
"""Error of a felt rate, over its largest, up to which its table leaves points out."""

_POINTWISE = 1e-9
_NORMAL = ("first_normal_stress_difference", "second_normal_stress_difference")
_FEWEST_ENTRIES = 64


@dataclass(frozen=True)
class InRecord:
    """Instrument in the stress of one run: recorded = gain · stress + offset, at the samples."""

    gain: Float[np.ndarray, " n"]
    offset: Float[np.ndarray, " n"]

    def recorded(self, stress: Float[np.ndarray, "*m n"]) -> Float[np.ndarray, "*m n"]:
        """Return what is recorded of a stress in Pa."""
        return self.gain * stress + self.offset

    def undone(self, recorded: Float[np.ndarray, "*m n"]) -> Float[np.ndarray, "*m n"]:
        """Return the stress in Pa behind a record."""
        return (recorded - self.offset) / self.gain


def corrected(
    data: StudyData, effects: Sequence[KnownEffect]
) -> tuple[StudyData, Mapping[str, InRecord]]:
    """Return data with the rate that the fluid felt and the stress without the instrument's part.

    Runs in extension, which another instrument makes, stay as they are.

    `data`: as recorded. `effects`: of the instrument, with their values.

    Returns the corrected data, and by name of the run what the instrument makes of its stress.
    Raises InputError if an effect acts on a measured rate that contains it, or has a memory of the
    stress; or if a run is not at a given rate in time.
    """
    runs = list(data.dataset.runs)
    require_possible(effects, runs)
    if not effects or not runs:
        return data, {}
    other = next((run for run in runs if run.protocol.control != "rate"), None)
    if other is not None:
        names = ", ".join(known.name for known in effects)
        raise InputError(
            f"compare takes effects of an instrument ({names}) out of runs at a given rate in "
            f"time, and {other.name} is none. Leave it out of [data], leave the effects out, or "
            "use discover close-loop."
        )
    # an instrument is the same, whatever the loading
    flows = transients([replace(run, loading=None) for run in runs])
    values = [jnp.asarray(known.values, dtype=float) for known in effects]
    felt, gain, offset, missed = (
        np.asarray(part) for part in _instrument(tuple(k.effect for k in effects))(values, flows)
    )
    for known, row in zip(effects, missed, strict=True):
        if np.max(row) > _POINTWISE:
            raise InputError(
                f"compare cannot take {known.name} as known: it mixes the stress of earlier times "
                f"into the signal, and noise prevents undoing that. {ONLY_LOOP}"
            )
    found, made = {}, {}
    moves = any(isinstance(known.effect, KinematicEffect) for known in effects)
    of_force = [k.values[0] or 0.0 for k in effects if k.effect.name == NORMAL_FORCE_GAIN.name]
    force = 1.0 + sum(of_force)
    for i, run in enumerate(runs):
        if run.flow != "shear":
            found[run.name] = run
            continue
        n = len(run)
        at = np.asarray(flows.sample_index)[i, :n]
        one = InRecord(gain[i, at], offset[i, at])
        if np.any(one.gain <= 0.0):
            raise InputError(
                f"With the known effects nothing would be recorded of the stress of {run.name}. "
                "Check their values in [model] effects."
            )
        normal = {
            name: values / force for name in _NORMAL if (values := getattr(run, name)) is not None
        }
        changed = replace(run, stress=one.undone(run.stress), **normal)
        if run.quantity == "sigma12":  # what distorts the torque leaves the normal force alone
            made[run.name] = one
        if moves:
            times = np.asarray(flows.times)[i]
            last = 2 * int(at[-1]) + 1
            protocol = _felt_protocol(
                run.protocol,
                times[:last],
                np.asarray(flows.commanded_rate)[i][:last],
                felt[i][:last],
            )
            rate = felt[i][::2][at]
            changed = replace(changed, protocol=protocol, rate=rate, strain=None, rate_before=0.0)
        found[run.name] = changed
    dataset = replace(data.dataset, runs=tuple(found[run.name] for run in runs))
    fit, held_out = dataset.select(data.fit.names), dataset.select(data.held_out.names)
    return StudyData(dataset, fit, held_out, data.each), made


@lru_cache(maxsize=16)
def _instrument(effects: tuple[AbstractEffect, ...]) -> Any:
    """Return the compiled function of the values of effects and of the flows of runs.

    It returns the felt rate on the half-step grid, gain and offset at step ends, and how far each
    effect is from acting on each stress by itself.
    """

    def of_run(values, run: TransientFlows):
        clock = run.times / run.clock_factor
        rate = run.commanded_rate
        pairs = list(zip(effects, values, strict=True))
        kinematic = [(e, v) for e, v in pairs if isinstance(e, KinematicEffect)]
        for effect, own in kinematic:
            if effect.shapes_command:
                rate = effect.felt_rate(own, clock, rate)
        tool = rate[::2]
        for effect, own in kinematic:
            if not effect.shapes_command:
                rate = effect.felt_rate(own, clock, rate)
        times, felt = run.times[::2], rate[::2]
        gain, offset = jnp.ones_like(times), jnp.zeros_like(times)
        missed = []
        # a stress that changes its sign from step to step shows any memory
        probe = jnp.where(jnp.arange(times.size) % 2 == 0, 1.0, -0.5)
        for effect, own in pairs:
            if not isinstance(effect, SignalEffect) or effect.of_force:
                missed.append(jnp.zeros(()))
                continue

            def recorded(stress, effect=effect, own=own):
                record = Record(times, felt, stress, run.clock_factor, run.strain_before, tool)
                return effect.recorded_stress(own, record)

            added = recorded(jnp.zeros_like(times))
            factor = recorded(jnp.ones_like(times)) - added
            size = jnp.max(jnp.abs(added)) + 1.0
            missed.append(jnp.max(jnp.abs(recorded(probe) - factor * probe - added)) / size)
            gain, offset = factor * gain, factor * offset + added
        return rate, gain, offset, jnp.stack(missed)

    mapped = jax.jit(jax.vmap(of_run, in_axes=(None, 0), out_axes=(0, 0, 0, 1)))
    return mapped


def _felt_protocol(
    protocol: FlowProtocol,
    times: Float[np.ndarray, " m"],
    commanded: Float[np.ndarray, " m"],
    felt: Float[np.ndarray, " m"],
) -> FlowProtocol:
    """Return the protocol of a felt rate: the command by a factor, or a table through the rate."""
    size = float(np.max(np.abs(felt)))
    largest = int(np.argmax(np.abs(commanded)))
    factor = felt[largest] / commanded[largest] if commanded[largest] else 1.0
    if np.allclose(felt, factor * commanded, rtol=0.0, atol=1e-12 * max(size, 1e-300)):
        return replace(
            protocol,
            table_rates=factor * protocol.table_rates,
            amplitudes=factor * protocol.amplitudes,
        )
    kept = _followed(times, felt, _FOLLOWED * size)
    knots, rates = times[kept], felt[kept]
    # tables of a few lengths, so that runs share compiled programs
    entries = max(_FEWEST_ENTRIES, 1 << int(np.ceil(np.log2(len(knots)))))
    more = entries - len(knots)
    knots = np.concatenate([knots, knots[-1] * (1.0 + 1e-3 * np.arange(1, more + 1))])
    return replace(
        protocol,
        table_times=jnp.asarray(knots),
        table_rates=jnp.asarray(np.pad(rates, (0, more), mode="edge")),
        amplitudes=jnp.zeros(1),
        frequencies=jnp.zeros(1),
        phases=jnp.zeros(1),
    )


def _followed(
    times: Float[np.ndarray, " m"], values: Float[np.ndarray, " m"], tolerance: float
) -> np.ndarray:
    """Return positions through which straight lines follow a curve   [Douglas & Peucker 1973]."""
    kept, stack = {0, len(times) - 1}, [(0, len(times) - 1)]
    while stack:
        low, high = stack.pop()
        if high - low < 2:
            continue
        inside = slice(low + 1, high)
        ends = times[[low, high]], values[[low, high]]
        off = np.abs(values[inside] - np.interp(times[inside], *ends))
        worst = int(np.argmax(off))
        if off[worst] > tolerance:
            middle = low + 1 + worst
            kept.add(middle)
            stack += [(low, middle), (middle, high)]
    return np.array(sorted(kept))
