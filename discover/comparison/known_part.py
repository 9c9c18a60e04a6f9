"""Known part of a comparison: the declared law as fitted, records without the instrument."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.comparison.flows import (
    MEASURED,
    Flow,
    FlowBand,
    Stresses,
    columns_of,
    comparison_flows,
    with_each_run,
)
from discover.comparison.outcome import LearnerOutcome, simulated
from discover.dataset import Run
from discover.dataset.run import COLUMN_OF
from discover.effects import ConstitutiveEffect, KnownEffect, StateEffect
from discover.errors import InputError
from discover.forward import make_batch
from discover.loop.final_model import augmented_fluid
from discover.loop.from_posterior import FinishedSearch
from discover.loop.task import require_possible
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel

_INSIDE = 1e-3
"""Least share of its interval by which an instant is away from a sample."""


@dataclass(frozen=True)
class Frame:
    """What learners are given, and how what they find appears in the records.

    `added`: what the instrument adds to the records of a run, by its name.
    """

    model: StudyModel  # the known part, nothing of it left to be fitted
    data: StudyData  # the runs that they learn from, without what the instrument did
    flows: list[Flow]  # the flows in which their laws are simulated, with the records as they are
    added: Mapping[str, Stresses] = field(default_factory=dict)
    effects: tuple[KnownEffect, ...] = ()  # of the instrument, taken out of the records

    def recorded(self, flow: Flow, stresses: Stresses | None) -> Stresses | None:
        """Return what would be recorded of the stresses in a flow."""
        added = self.added.get(flow.name) if flow.kind in MEASURED else None
        if stresses is None or added is None:
            return stresses
        return {quantity: values + added[quantity] for quantity, values in stresses.items()}

    def outcome(self, own: LearnerOutcome) -> LearnerOutcome:
        """Return a learner's outcome with predictions of the records."""
        predictions, bands = dict(own.predictions), dict(own.bands)
        for flow in self.flows if self.added else ():
            predictions[flow.key] = self.recorded(flow, predictions[flow.key])
            if (band := bands.get(flow.key)) is not None:
                ends = (self.recorded(flow, one) for one in (band.middle, band.low, band.high))
                bands[flow.key] = FlowBand(*ends)  # pyright: ignore[reportArgumentType]
        return replace(own, predictions=predictions, bands=bands)

    def of_declared(
        self, declared: StudyModel, ended: FinishedSearch
    ) -> dict[str, Stresses | None]:
        """Return what the declared model predicts as fitted alone, by the key of the flow."""
        model = _as_fitted(declared, ended, ended.declared_theta)
        _, added = without_instrument(self.data, ended, model.effects, ended.declared_theta)
        found, own = simulated(model.fluid, self.flows), replace(self, added=added)
        return {flow.key: own.recorded(flow, found[flow.key]) for flow in self.flows}


def known_part(
    declared: StudyModel,
    ended: FinishedSearch,
    data: StudyData,
    high_deborah: tuple[float, ...],
    pipkin: Sequence[tuple[float, float]],
) -> Frame:
    """Return the known part with constants and instrument of the likeliest hypothesis.

    What that holds of the instrument is taken out of the records where it can be undone. Raises
    InputError if learners cannot be given a declared effect.
    """
    data = _dated(ended, data)
    model = _as_fitted(declared, ended, ended.theta)
    known = tuple(model.effects)
    found = known if ended.verdict != "effects_added" else (*known, *_found(ended))
    try:
        without, added = without_instrument(data, ended, found, ended.fit.theta)
    except InputError:  # the runs are of another kind
        found = known
        without, added = without_instrument(data, ended, known, ended.fit.theta)
    flows = comparison_flows(data, high_deborah, pipkin)
    return Frame(replace(model, effects=()), without, flows, added, found)


def _as_fitted(
    declared: StudyModel, ended: FinishedSearch, theta: Float[np.ndarray, " p"]
) -> StudyModel:
    """Return the declared model with numbers for what was fitted, `theta`.

    Its effects of the fluid are in its law, modes and solvent then, and the others are of the
    instrument. Raises InputError if learners cannot take an effect.
    """
    model = ended.posterior.problem.model
    effects = (
        replace(known, values=tuple(map(float, theta[model.positions(known.name)])))
        if known.free
        else known
        for known in declared.effects
    )
    effects = [known for known in effects if known.values[0] != 0.0]  # else it is none
    of_fluid = [known for known in effects if isinstance(known.effect, ConstitutiveEffect)]
    for known in of_fluid:
        _require_terms(known)
    own = model.declared
    free = theta[2 : 2 + len(own.free_parameters)]
    names = [parameter.name for parameter in own.free_parameters]
    fluid = augmented_fluid(model, theta, [known.name for known in of_fluid])
    return replace(
        declared,
        law=fluid.law if of_fluid else own.law_with(free),
        law_name=" with ".join([declared.law_name, *(known.text for known in of_fluid)]),
        parameters=declared.parameters | dict(zip(names, map(float, free), strict=True)),
        modulus=np.asarray(fluid.modulus), relaxation_time=np.asarray(fluid.relaxation_time),
        solvent_viscosity=float(fluid.solvent_viscosity),
        effects=tuple(k for k in effects if not isinstance(k.effect, ConstitutiveEffect)), free=(),
    )  # fmt: skip


def _require_terms(known: KnownEffect) -> None:
    """Refuse an effect of the fluid that no law of library terms carries."""
    effect, values = known.effect, [value or 0.0 for value in known.values]
    if isinstance(effect, StateEffect):
        why = "it gives the fluid a state that no law of stress and rate carries"
    elif isinstance(effect, ConstitutiveEffect) and effect.as_terms(values) is None:
        why = "what it adds to the law is not a sum of library terms"
    else:
        return
    raise InputError(
        f"compare cannot take {known.name} as known: {why}. Leave it out of [model] effects, or, "
        "where it comes from an earlier result, give it an amplitude of 0 there; discover "
        "close-loop knows it."
    )


def _found(ended: FinishedSearch) -> list[KnownEffect]:
    """Return the effects of the instrument in the likeliest hypothesis, with their values."""
    problem = ended.posterior.problem
    return [
        KnownEffect(effect, tuple(map(float, ended.fit.theta[problem.model.positions(name)])))
        for name in ended.fit.names
        if not isinstance(effect := problem.effects[name], ConstitutiveEffect)
    ]


def _dated(ended: FinishedSearch, data: StudyData) -> StudyData:
    """Return data whose rates step when the posterior says."""
    problem = ended.posterior.problem
    theta, first = ended.held_out_theta(ended.fit), problem.model.instants.start
    runs = (*problem.fitted.runs, *(() if problem.predicted is None else problem.predicted.runs))
    steps = {run.source: run.rate_steps for run in runs if run.rate_steps}

    def dated(run: Run) -> Run:
        protocol = run.protocol
        knots, rates = np.asarray(protocol.table_times), np.asarray(protocol.table_rates)
        own = steps.get(run.source, ())
        for step in own:
            share = step.share if step.place is None else float(theta[first + step.place])
            instant = step.at(float(np.clip(share, _INSIDE, 1.0 - _INSIDE)))
            after = int(np.searchsorted(knots, instant))
            levels = rates[after - 1], rates[after]
            knots = np.insert(knots, after, [instant, instant])
            rates = np.insert(rates, after, levels)
        if not own:
            return run
        moved = replace(protocol, table_times=jnp.asarray(knots), table_rates=jnp.asarray(rates))
        return replace(run, protocol=moved, rate_steps=())

    return with_each_run(data, dated) if steps else data


def without_instrument(
    data: StudyData,
    ended: FinishedSearch,
    effects: Sequence[KnownEffect],
    theta: Float[np.ndarray, " p"],
) -> tuple[StudyData, Mapping[str, Stresses]]:
    """Return data without what the instrument did to them, and what that is, by name of the run.

    What effects did is by how much they change what a hypothesis records. So where that misses a
    run by 5 % and a gain is 10 %, the record is corrected to 0.5 %; and a motor or a transducer
    with a memory is taken out as well as a gain. Runs in extension, which another instrument makes,
    stay as they are.

    `data`: as recorded. `effects`: of the instrument, with their values. `theta`: constants of the
    hypothesis. Raises InputError if an effect acts on a measured rate that contains it, or a run is
    not at a given rate in time.
    """
    require_possible(effects, data.dataset.runs)
    other = next((run for run in data.dataset if run.protocol.control != "rate"), None)
    runs = [run for run in data.dataset if run.flow == "shear"]
    if not effects or not runs:
        return data, {}
    if other is not None:
        names = ", ".join(known.name for known in effects)
        raise InputError(
            f"compare takes effects of an instrument ({names}) out of runs at a given rate in "
            f"time, and {other.name} is none. Leave it out of [data], leave the effects out, or "
            "use discover close-loop."
        )
    model, with_it = ended.posterior.problem.model, theta.copy()
    without = with_it.copy()
    for known in effects:
        with_it[model.positions(known.name)] = known.values
        without[model.positions(known.name)[0]] = 0.0  # at zero amplitude an effect is none
    with np.errstate(all="ignore"):  # a law that diverges in a run tells nothing of it
        recorded, felt = model.observables([with_it, without], make_batch(runs))
    added = np.nan_to_num(recorded - felt, posinf=0.0, neginf=0.0)
    by_run = {run.name: columns_of(own[: len(run)]) for run, own in zip(runs, added, strict=True)}

    def undone(run: Run) -> Run:
        own = by_run.get(run.name)
        if own is None:
            return run
        there = [q for q in ("N1", "N2") if getattr(run, COLUMN_OF[q]) is not None]
        if run.quantity == "sigma12":
            there.append("sigma12")
        columns = [(COLUMN_OF[quantity], own[quantity]) for quantity in there]
        return replace(run, **{name: getattr(run, name) - added for name, added in columns})

    return with_each_run(data, undone), by_run
