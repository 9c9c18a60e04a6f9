"""Records without what a known instrument did, for learners and classical laws."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import jax.numpy as jnp
import numpy as np

from discover.comparison.flows import Stresses, columns_of, with_each_run
from discover.dataset import Run
from discover.effects import (
    ConstitutiveEffect,
    KnownEffect,
    ModeEffect,
    StateEffect,
)
from discover.effects.signal import NORMAL_FORCE_GAIN
from discover.errors import InputError
from discover.forward import make_batch
from discover.laws.each_mode import with_modes
from discover.laws.expansion import law_of_terms
from discover.laws.textbook.classical import UpperConvectedMaxwell
from discover.loop.from_posterior import Ended
from discover.loop.task import require_possible
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel
from tensor_library.law_terms import LawTerms

ONLY_LOOP = (
    "Leave it out of [model] effects, or, where it comes from an earlier result, give it an "
    "amplitude of 0 there; discover close-loop knows it."
)
"""What to do with an effect that no learner can be told of."""
_RATES = (1.0, 2.0)


def absorbed(declared: DeclaredModel) -> DeclaredModel:
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
        if isinstance(known.effect, ConstitutiveEffect):
            declared = _with_effect(declared, known, known.effect)
    instrument = (k for k in declared.effects if not isinstance(k.effect, ConstitutiveEffect))
    return replace(declared, effects=tuple(instrument))


def _with_effect(
    declared: DeclaredModel, known: KnownEffect, effect: ConstitutiveEffect
) -> DeclaredModel:
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


_NORMAL = ("first_normal_stress_difference", "second_normal_stress_difference")


def without_instrument(
    data: StudyData, ended: Ended, effects: Sequence[KnownEffect]
) -> tuple[StudyData, Mapping[str, Stresses]]:
    """Return data without what the instrument did to them, and what that is, by name of the run.

    What effects did is by how much they change what the likeliest hypothesis records. So where that
    misses a run by 5 % and a gain is 10 %, the record is corrected to 0.5 %; and a motor or a
    transducer with a memory is taken out as well as a gain. Runs in extension, which another
    instrument makes, stay as they are.

    `data`: as recorded. `effects`: of the instrument, with their values. Raises InputError if an
    effect acts on a measured rate that contains it, or a run is not at a given rate in time.
    """
    require_possible(effects, data.dataset.runs)
    other = next((run for run in data.dataset if run.protocol.control != "rate"), None)
    # an instrument is the same, whatever the loading
    runs = [replace(run, loading=None) for run in data.dataset if run.flow == "shear"]
    if not effects or not runs:
        return data, {}
    if other is not None:
        names = ", ".join(known.name for known in effects)
        raise InputError(
            f"compare takes effects of an instrument ({names}) out of runs at a given rate in "
            f"time, and {other.name} is none. Leave it out of [data], leave the effects out, or "
            "use discover close-loop."
        )
    model, with_it = ended.posterior.problem.model, ended.fit.theta.copy()
    without = with_it.copy()
    for known in effects:
        with_it[model.positions(known.name)] = known.values
        without[model.positions(known.name)[0]] = 0.0  # at zero amplitude an effect is none
    with np.errstate(all="ignore"):  # a law that diverges in a run tells nothing of it
        recorded, felt = model.observables([with_it, without], make_batch(runs))
    force = [k.values[0] or 0.0 for k in effects if k.effect.name == NORMAL_FORCE_GAIN.name]
    recorded[..., 1:] *= 1.0 + sum(force)
    added = np.nan_to_num(recorded - felt, posinf=0.0, neginf=0.0)
    by_run = {run.name: columns_of(own[: len(run)]) for run, own in zip(runs, added, strict=True)}

    def undone(run: Run) -> Run:
        own = by_run.get(run.name)
        if own is None:
            return run
        normal = {
            name: values - own[quantity]
            for name, quantity in zip(_NORMAL, ("N1", "N2"), strict=True)
            if (values := getattr(run, name)) is not None
        }
        stress = run.stress - own["sigma12"] if run.quantity == "sigma12" else run.stress
        return replace(run, stress=stress, **normal)

    return with_each_run(data, undone), by_run
